"""The course of a run, target by target: approach the first pose, play, come to rest, go to the rest pose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np

from controller.mocap.posture import Pose
from controller.realtime.approach import Approach
from controller.realtime.attempts import Attempts
from controller.realtime.channel import Channel
from controller.realtime.safety import SafetyEnvelope
from controller.realtime.stop import StopRequest
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
    """

    def __init__(self, deck: Player, dt: float) -> None:
        """Takes the first targets; what the deck raises here is raised."""
        self._deck = deck
        self.dt = dt
        self.attempts = Attempts()
        targets, self.pose = deck.update(dt)
        self.targets = targets.copy()

    def update(self) -> None:
        """Lets the deck go on by one tick."""
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

    Args:
        source: what is played.
        channels: where the joints are measured before the first step is taken.
        envelope: what every target passes.
        stop: ends the play; it is asked for here when the time is over or the deck fails for good.
        seconds: how long to play.
        rest: joint positions (J,), rad, to go to in the end, if any.
    """
    limits, dt = envelope.limits, source.dt
    first = np.where(np.isfinite(source.targets), source.targets, 0.5 * (limits.lower + limits.upper))
    first = np.clip(first, limits.lower, limits.upper)
    envelope.start(_measured(channels, first))
    for targets in _walk(Approach.within(limits, envelope.position, first), dt):
        if stop:
            break
        yield envelope(targets)

    ticks = seconds / dt - 0.5
    played = 0
    while not stop:
        if played > ticks:
            stop.ask("played to the end")
            break
        source.update()
        if source.attempts.given_up:
            stop.ask(f"the deck keeps failing: {source.attempts.fault}")
            break
        yield envelope(source.targets)
        played += 1

    while not envelope.at_rest:
        yield envelope.brake()
    if rest is not None:
        for targets in _walk(Approach.within(limits, envelope.position, rest), dt):
            yield envelope(targets)


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
