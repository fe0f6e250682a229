"""The phases of a run as a stream of safe targets: approach, play, home, emergency stop, and the final stop."""

# ruff: noqa: D102 (`deck.deck.Deck` documents what a `Player` has)

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple, Protocol

import numpy as np

from controller.loop.correction import Correction
from controller.loop.output_channel import Channel, FaultCounter
from controller.loop.safety.approach import Approach
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose

_FOLLOWS_WITHIN = 0.1  # s, from the targets being where an output holds its joints
_RESTS_WITHIN = 0.5  # s, from when the deck brakes at its end, joints that an output brakes on its own
_TRIES = 5  # of moving there: an output may come to rest later


class Player(Protocol):
    """A deck, as the loop plays it."""

    def update(self, dt: float) -> tuple[Array, Pose]: ...


class Start(NamedTuple):
    """The joint positions to begin at, shape (J,), rad, in place of a channel."""

    measured: Array | None
    held: None = None
    at_rest: bool = True


Measuring = Channel | Start


class Source:
    """The latest targets and pose of a deck; they keep their values while the deck raises."""

    def __init__(
        self,
        deck: Player,
        dt: float,
        before: Callable[[Array], Array] | None = None,
        correction: Correction | None = None,
    ) -> None:
        """Takes the first targets; an exception of the deck is raised here.

        `before` delays the targets (J,) of each update on their way to the envelope; a correction is added to targets
        that are followed.
        """
        self._deck, self._before, self.correction = deck, before, correction
        self.dt = dt
        self.counter = FaultCounter()
        self.updates = 0  # how many there were after the first one
        self.running = False  # whether the deck's time passes; while the joints approach it, it waits
        targets, self.pose = deck.update(dt)
        self._latest = targets.copy()
        # For the envelope, shape (J,), rad: where joints lag less than others, those of a while ago.
        self.targets = self._latest if before is None else before(self._latest)

    def update(self) -> None:
        """Advances the deck by one tick."""
        self.updates += 1
        self.running = True
        counter = self.counter
        if not counter.given_up:
            try:
                targets, pose = self._deck.update(self.dt)
                if targets.shape != self._latest.shape:
                    raise ValueError(f"targets of shape {targets.shape} instead of {self._latest.shape}")
                self._latest[:], self.pose = targets, pose
                if self.correction is not None:
                    self.correction.update()
                counter.in_a_row = 0
            except Exception as error:
                counter.count(error)
        if self._before is not None:
            self.targets = self._before(self._latest)


def safe_targets(
    source: Source,
    channels: Sequence[Measuring],
    envelope: SafetyEnvelope,
    stop: StopRequest,
    seconds: float,
    rest: Array | None,
) -> Iterator[Array]:
    """The safe targets (J,), rad, of each tick of a run; the stream ends when a requested stop is complete.

    A stop requested before the first tick gives none: nothing has moved yet. It is requested here when the time is over
    or the deck keeps failing. A change of mode begins with braking in the tick in which it is noticed. If the run ends
    while the emergency stop is on, the joints stay where they are, as they do without rest positions (J,), rad, of home
    and end. Where they are at the start, the channels measure.
    """
    if stop:
        return
    envelope.start(_measured(channels, _reachable(source.targets, envelope)))
    ticks = seconds / source.dt - 0.5
    phases = {
        "playing": lambda: _follow(source, channels, envelope, stop),
        "home": lambda: _go_home(source, channels, envelope, rest),
        "held": lambda: _hold(source, envelope, stop),
        "emergency stop": lambda: _hold(source, envelope, stop),
    }
    done, phase = None, iter(())
    while not stop.reason:
        if source.counter.given_up:
            stop.ask(f"the deck keeps failing: {source.counter.fault}")
            break
        if source.updates > ticks:
            stop.ask("played to the end")
            break
        wanted = stop.state.phase, stop.home
        if wanted != done:
            done, stop.approaching = wanted, False
            phase = phases[stop.mode]()
        yield next(phase)

    # Outputs that brake on their own do so too, at once: those that follow may be behind.
    stop.state.lose()
    waits = math.ceil(_RESTS_WITHIN / source.dt)
    while not (envelope.at_rest and (waits <= 0 or all(channel.at_rest for channel in channels))):
        yield envelope.brake()
        waits -= 1
    stop.state.rested()
    if not stop.emergency:
        stop.state.go_on()
    homeward = _end(channels, envelope, rest, source.dt)
    while not stop.emergency:
        targets = next(homeward, None)
        if targets is None:
            break
        yield targets
    while not envelope.at_rest:
        yield envelope.brake()


def _follow(
    source: Source, channels: Sequence[Measuring], envelope: SafetyEnvelope, stop: StopRequest
) -> Iterator[Array]:
    """Approaches the deck's targets slowly and follows them, and again where an output has held its joints."""
    correction = source.correction
    while True:
        source.running, stop.approaching = False, True
        yield from _rejoin(channels, envelope, source.dt)
        for targets in _move_to(_reachable(source.targets, envelope), envelope, source.dt):
            yield targets
            if _held(channels) is not None:
                break
        stop.approaching = False
        while _held(channels) is None:
            source.update()
            yield envelope(source.targets) if correction is None else correction.follow(source.targets, envelope)


def _go_home(
    source: Source, channels: Sequence[Measuring], envelope: SafetyEnvelope, rest: Array | None
) -> Iterator[Array]:
    """Moves slowly to the rest pose (or just brakes, without one) and stays there; the deck's time goes on."""
    while True:
        for targets in chain(_rejoin(channels, envelope, source.dt), _move_to(rest, envelope, source.dt)):
            source.update()
            yield targets
        while _held(channels) is None:
            source.update()
            yield envelope.brake()


def _end(channels: Sequence[Measuring], envelope: SafetyEnvelope, rest: Array | None, dt: float) -> Iterator[Array]:
    """Moves slowly to the rest pose (or just brakes, without one), once more if an output has held joints meanwhile."""
    for _ in range(2):
        yield from chain(_rejoin(channels, envelope, dt), _move_to(rest, envelope, dt))
        if _held(channels) is None:
            return


def _hold(source: Source, envelope: SafetyEnvelope, stop: StopRequest) -> Iterator[Array]:
    """Brakes and holds; the deck's time goes on."""
    while True:
        if envelope.at_rest:
            stop.state.rested()
        source.update()
        yield envelope.brake()


def _rejoin(channels: Sequence[Measuring], envelope: SafetyEnvelope, dt: float) -> Iterator[Array]:
    """Moves slowly to where outputs hold joints on their own, and waits some ticks for them to follow again."""
    for _ in range(_TRIES):
        held = _held(channels)
        if held is None:
            return
        yield from _move_to(_reachable(np.where(np.isfinite(held), held, envelope.position), envelope), envelope, dt)
        for _ in range(math.ceil(_FOLLOWS_WITHIN / dt)):
            if _held(channels) is None:
                return
            yield envelope.brake()


def _move_to(position: Array | None, envelope: SafetyEnvelope, dt: float) -> Iterator[Array]:
    """Brakes to rest, and then moves slowly to a position (J,), rad, if one is given."""
    while not envelope.at_rest:
        yield envelope.brake()
    if position is not None:
        approach = Approach.within(envelope.limits, envelope.position, position)
        for tick in range(math.ceil(approach.duration / dt)):
            yield envelope(approach.at((tick + 1) * dt))
        while not envelope.at_rest:
            yield envelope.brake()


def _reachable(targets: Array, envelope: SafetyEnvelope) -> Array:
    """Targets (J,) clipped to the position limits; one that is not finite becomes the middle of the range."""
    limits = envelope.limits
    known = np.where(np.isfinite(targets), targets, 0.5 * (limits.lower + limits.upper))
    return np.clip(known, limits.lower, limits.upper)


def _held(channels: Sequence[Measuring]) -> Array | None:
    """Where outputs hold joints on their own, shape (J,), rad, NaN for others; None if each follows its targets."""
    held: Array | None = None
    for channel in channels:
        if channel.held is not None:
            held = channel.held if held is None else np.where(np.isfinite(held), held, channel.held)
    return held


def _measured(channels: Sequence[Measuring], assumed: Array) -> Array:
    """Where the joints are, shape (J,), rad: as the first output that measures each, else as assumed."""
    present = assumed.copy()
    for channel in reversed(channels):
        if channel.measured is not None and channel.measured.shape == present.shape:
            np.copyto(present, channel.measured, where=np.isfinite(channel.measured))
    return present
