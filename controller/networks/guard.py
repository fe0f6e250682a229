"""A guard around a network: detects that it has lost its place, and restarts it there.

It looks for four signs:

- an impossible state: one that undisturbed playing never reaches (every frame);
- far away: no anchor of the motion is near (every LOOK_SECONDS);
- frozen: the output moves a fraction of the least that the motion ever moves (every LOOK_SECONDS);
- out of order: a one-shot is not near where it was LOOK_SECONDS ago, or a little further on.

It restarts from a stored state: in a loop the one whose frame is nearest to the last good frame, in a one-shot the next
one. The frame jumps by the distance to it, so a safety envelope belongs between this and a robot. Without such a sign a
guarded run is the plain run, bit by bit.

A comparison takes one frame and at most MOST_ANCHORS anchors, whatever the length of the motion.
"""

# ruff: noqa: D102 (`base.Network` documents the methods of a `FrameNetwork`)

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import AutonomousNetwork, Channels, FrameNetwork

LOOK_SECONDS = 1.0 / 24.0
MOST_ANCHORS = 128
FAR = 0.6
FROZEN = 0.3
DISORDER = 0.3
STILL = 0.02
MEMORY = 0.1


@dataclass(frozen=True)
class Beat:
    """The settings of a guard for one motion."""

    anchors: NDArray[np.int64]  # those of the network that frames are compared with, shape (A,)
    places: Channels  # their frames, each channel divided by its spread over all motions, shape (A, C)
    squares: Channels  # |place|^2, shape (A,)
    pace: float  # the mean movement between two comparisons
    slowest: float  # the least smoothed movement that counts as playing; 0 where standing still is right
    disorder: float  # the largest distance of a one-shot from its place
    stride: float | None  # anchors that a one-shot advances between two comparisons; None for a loop
    look_every: int  # frames between two comparisons


class LossWatch:
    """Watches R runs of one motion from `frames` (R, C) on, each channel over its spread `scale` (C,)."""

    def __init__(self, beat: Beat, scale: Channels, frames: Channels) -> None:
        self.beat = beat
        self._scale = scale
        self._seen = frames / scale
        self._pace = np.full(len(frames), beat.pace)
        self._place = self._distances(self._seen).argmin(1).astype(np.float64)
        self._count = 0

    def inspect(self, frames: Channels, astray: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which runs are lost, shape (R,), by their newest frames (R, C) and whether their states are impossible."""
        lost = astray | ~np.isfinite(frames).all(1)
        self._count += 1
        if self._count % self.beat.look_every:
            return lost
        seen = np.where(lost[:, None], self._seen, frames / self._scale)
        step = np.sqrt(np.square(seen - self._seen).mean(1))
        self._seen = seen
        self._pace += MEMORY * (step - self._pace)
        if self.beat.stride is None:
            lost |= self._distances(seen).min(1) > FAR**2
            lost |= self._pace < self.beat.slowest
            self._pace[lost] = self.beat.pace
            return lost
        return lost | self._disordered(seen, self.beat.stride)

    def _disordered(self, seen: Channels, stride: float) -> NDArray[np.bool_]:
        """Which one-shots are out of order; advances their places."""
        last = len(self.beat.places) - 1
        expected = np.minimum(self._place + stride, last)
        reach = np.arange(-2, 3) * max(1.0, 0.5 * stride)
        around = np.clip(np.rint(expected[:, None] + reach), 0, last).astype(np.int64)
        distance = np.take_along_axis(self._distances(seen), around, axis=1)
        nearest = distance.argmin(1)
        rows = np.arange(len(seen))
        lost = distance[rows, nearest] > self.beat.disorder**2
        # It may play slower or faster, but not jump.
        found = np.clip(around[rows, nearest], self._place + 0.5 * stride, self._place + 1.5 * stride)
        self._place = np.minimum(np.where(lost, expected, found), last)
        return lost

    def restart(self, rows: NDArray[Any]) -> NDArray[np.int64]:
        """The network's anchors at which to restart some runs."""
        if self.beat.stride is not None:
            return self.beat.anchors[self._place[rows].astype(np.int64)]
        return self.beat.anchors[self._distances(self._seen[rows]).argmin(1)]

    def _distances(self, places: Channels) -> Channels:
        """Mean squared distance of places (R, C) to each anchor, shape (R, A)."""
        square = np.square(places).sum(1)[:, None] + self.beat.squares - 2.0 * places @ self.beat.places.T
        return square / places.shape[1]


class Guard:
    """Plays a network and restarts it where it is lost; fits `base.FrameNetwork`.

    The lengths of motions are in frames, the rate in Hz. `recues` counts the restarts, `anchor` belongs to the last.
    """

    def __init__(
        self, network: AutonomousNetwork, lengths: dict[str, int], loops: dict[str, bool], rate: float
    ) -> None:
        self.network = network
        self.motions, self.channels = network.motions, network.channels
        self.scale = spread(network)
        self.beats = {m: beat(network, m, self.scale, lengths[m], rate, loop=loops[m]) for m in network.motions}
        self.recues = self.anchor = 0
        self._newest = np.zeros((1, network.channels))
        self._astray = np.zeros(1, dtype=bool)
        self.cue(self.motions[0], 0)

    as_phase_network = None

    def anchors(self, motion: str) -> Channels:
        return self.network.anchors(motion)

    def cue(self, motion: str, anchor: int) -> None:
        self.network.cue(motion, anchor)
        self._motion = motion
        self._watch = LossWatch(self.beats[motion], self.scale, self.network.anchors(motion)[anchor : anchor + 1])

    def advance(self, out: Channels) -> None:
        if self.network.astray():
            self._restart()
        self.network.advance(out)
        self._newest[0], self._astray[0] = out, self.network.astray()
        if self._watch.inspect(self._newest, self._astray)[0]:
            self._restart()
            if self._astray[0] or not np.isfinite(out).all():
                self.network.advance(out)

    def _restart(self) -> None:
        self.recues += 1
        self.anchor = int(self._watch.restart(np.zeros(1, dtype=np.int64))[0])
        self.network.cue(self._motion, self.anchor)


def spread(network: FrameNetwork) -> Channels:
    """The standard deviation of each channel over the anchors of all motions, 1 where it never moves, shape (C,)."""
    deviation = np.concatenate([network.anchors(name) for name in network.motions]).std(0)
    return np.where(deviation > 1e-6, deviation, 1.0)


def beat(network: FrameNetwork, motion: str, scale: Channels, length: int, rate: float, *, loop: bool) -> Beat:
    """The settings for a motion of some length in frames at a rate in Hz."""
    look_every = max(1, round(LOOK_SECONDS * rate))
    frames = network.anchors(motion) / scale
    anchors = np.arange(0, len(frames), -(-len(frames) // MOST_ANCHORS))
    pace = slowest = 0.0
    if loop:
        # Twice round, because the smoothed movement depends on what came before.
        looks_per_anchor = length / len(frames) / look_every
        steps = np.sqrt(np.square(np.roll(frames, -1, axis=0) - frames).mean(1)) / looks_per_anchor
        pace = float(steps.mean())
        if pace > STILL:
            smooth, least = pace, pace
            share = 1.0 - (1.0 - MEMORY) ** looks_per_anchor
            for step in np.concatenate([steps, steps]):
                smooth += share * (step - smooth)
                least = min(least, smooth)
            slowest = FROZEN * least
    stride = None if loop else look_every * len(anchors) / length
    unrest = DISORDER * float(np.sqrt(np.square(frames - frames.mean(0)).mean()))
    return Beat(anchors, frames[anchors], np.square(frames[anchors]).sum(1), pace, slowest, unrest, stride, look_every)
