"""The course of a run, target by target: approach, play, home, emergency stop, and in the end the way to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np

from controller.loop.approach import Approach
from controller.loop.guarded_calls import Attempts
from controller.loop.output_channel import Channel
from controller.loop.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.mocap.posture import Pose
from controller.rotations import Array


class Player(Protocol):
    """What the loop plays: a deck."""

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Goes dt seconds on; the joint targets (J,), rad, and the pose they come from."""
        ...


class Source:
    """The latest targets and pose of a deck; they stay as they are while the deck raises.

    Attributes:
        targets: shape (J,), rad.
        pose: where they come from.
        attempts: how the updates went.
        updates: how many there were after the first one.
    """

    def __init__(self, deck: Player, dt: float) -> None:
        """Takes the first targets; what the deck raises here is raised."""
        self._deck = deck
        self.dt = dt
        self.attempts = Attempts()
        self.updates = 0
        targets, self.pose = deck.update(dt)
        self.targets = targets.copy()

    def update(self) -> None:
        """Lets the deck go on by one tick."""
        self.updates += 1
        self.attempts(self._take)

    def _take(self) -> None:
        targets, pose = self._deck.update(self.dt)
        if targets.shape != self.targets.shape:
            raise ValueError(f"targets of shape {targets.shape} instead of {self.targets.shape}")
        self.targets[:], self.pose = targets, pose


def course(
    source: Source,
    channels: Sequence[Channel],
    envelope: SafetyEnvelope,
    stop: StopRequest,
    seconds: float,
    rest: Array | None,
) -> Iterator[Array]:
    """The safe targets (J,), rad, of each tick of a run; it ends by itself after a stop was asked for.

    Where that was before the first tick, there are none: what has not moved need not be brought to rest.

    A change of mode begins with braking in the very tick that it is noticed in. While the emergency stop is on, an end
    leaves the joints where they stand.

    Args:
        source: what is played.
        channels: where the joints are measured before the first step is taken.
        envelope: what every target passes.
        stop: ends the play; it is asked for here when the time is over or the deck fails for good.
        seconds: how long to play.
        rest: joint positions (J,), rad, to go home to and to end at; without them the joints stay where they stop.
    """
    if stop:
        return
    envelope.start(_measured(channels, _reachable(source.targets, envelope)))
    ticks = seconds / source.dt - 0.5
    legs = {
        "playing": lambda: _follow(source, envelope),
        "home": lambda: _stand(source, envelope, rest, stop),
        "held": lambda: _stand(source, envelope, None, stop),
        "emergency stop": lambda: _stand(source, envelope, None, stop),
    }
    mode, leg = "", iter(())
    while not stop:
        if source.attempts.given_up:
            stop.ask(f"the deck keeps failing: {source.attempts.fault}")
            break
        if source.updates > ticks:
            stop.ask("played to the end")
            break
        if stop.mode != mode:
            mode = stop.mode
            leg = legs[mode]()
        yield next(leg)

    way_home = _come_to(rest, envelope, source.dt)
    while not stop.emergency:
        targets = next(way_home, None)
        if targets is None:
            break
        yield targets
    while not envelope.at_rest:
        yield envelope.brake()


def _follow(source: Source, envelope: SafetyEnvelope) -> Iterator[Array]:
    """Slowly to where the deck is, and then with it."""
    yield from _come_to(_reachable(source.targets, envelope), envelope, source.dt)
    while True:
        source.update()
        yield envelope(source.targets)


def _stand(source: Source, envelope: SafetyEnvelope, place: Array | None, stop: StopRequest) -> Iterator[Array]:
    """Slowly to a place, or to rest where there is none, and there for ever; the deck's time goes on."""
    for targets in _come_to(place, envelope, source.dt):
        source.update()
        yield targets
    while True:
        stop.halted = True
        source.update()
        yield envelope.brake()


def _come_to(place: Array | None, envelope: SafetyEnvelope, dt: float) -> Iterator[Array]:
    """To rest, and from there slowly to a place (J,), rad, if there is one."""
    while not envelope.at_rest:
        yield envelope.brake()
    if place is not None:
        for targets in _walk(Approach.within(envelope.limits, envelope.position, place), dt):
            yield envelope(targets)
        while not envelope.at_rest:
            yield envelope.brake()


def _reachable(targets: Array, envelope: SafetyEnvelope) -> Array:
    """Targets (J,) brought inside the position limits; a joint without a finite one is put in the middle."""
    limits = envelope.limits
    known = np.where(np.isfinite(targets), targets, 0.5 * (limits.lower + limits.upper))
    return np.clip(known, limits.lower, limits.upper)


def _measured(channels: Sequence[Channel], assumed: Array) -> Array:
    """Where the joints are: as the first output that knows it says of each, or else as assumed, shape (J,), rad."""
    present = assumed.copy()
    for channel in reversed(channels):
        if channel.measured is not None and channel.measured.shape == present.shape:
            np.copyto(present, channel.measured, where=np.isfinite(channel.measured))
    return present


def _walk(approach: Approach, dt: float) -> Iterator[Array]:
    """The joint positions of an approach, tick by tick, the last of them its goal."""
    for tick in range(math.ceil(approach.duration / dt)):
        yield approach.at((tick + 1) * dt)
