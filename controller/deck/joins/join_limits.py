"""Limits of a join: speed and acceleration of body points relative to its motions', taken over the time PEAKS_OVER."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from math import ceil

import numpy as np

from controller.deck.joins.deck_motions import PEAKS_OVER, Motion
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton

# Limits of a join: speed and acceleration of a body point, as multiples of the largest in its motions.
FASTEST, HARDEST = 1.5, 2.0


@dataclass(frozen=True)
class Bounds:
    """The largest speed, m/s, and acceleration, m/s^2, allowed for a joint in the world."""

    speed: float
    acceleration: float

    @classmethod
    def of(cls, motions: Collection[Motion], faster: float, harder: float) -> Bounds:
        """Multiples of the largest speed and of the largest acceleration of these motions."""
        return cls(
            faster * max(motion.speed for motion in motions), harder * max(motion.acceleration for motion in motions)
        )

    def at(self, tempo: float) -> Bounds:
        """Those at a tempo: faster than as recorded, the motions need more themselves."""
        faster = max(1.0, abs(tempo))
        return Bounds(faster * self.speed, faster**2 * self.acceleration)


class JoinLimits:
    """Watches the joints in the world while motions are joined, from the last two poses that were shown."""

    def __init__(self, skeleton: Skeleton, before: Pose | None, now: Pose) -> None:
        self._skeleton = skeleton
        self._shown: deque[Array] = deque(self._joints(pose) for pose in (before, now) if pose is not None)
        self._motions: tuple[Motion, ...] = ()
        self._bounds = Bounds(0.0, 0.0)

    def begin(self, *motions: Motion) -> None:
        """Sets the limits to those of a join of these motions; the motions of the join that it interrupts count too."""
        self._bounds, self._motions = Bounds.of((*self._motions, *motions), FASTEST, HARDEST), motions

    def use(self, pose: Pose, dt: float, tempo: float = 1.0) -> float:
        """The use of the limits at a tempo if this pose comes dt seconds after the last; 1 is the limit."""
        shown, bounds, ticks = self._shown, self._bounds.at(tempo), ceil(PEAKS_OVER / dt - 1e-6)
        while len(shown) > 2 * ticks:
            shown.popleft()
        while 2 <= len(shown) < 2 * ticks:
            shown.appendleft(2.0 * shown[0] - shown[1])  # before the first poses it moved on as between them
        between = min(ticks, len(shown))
        over = between * dt
        step = self._joints(pose) - shown[-between]
        change = step - (shown[-between] - shown[-2 * between]) if 2 * between <= len(shown) else np.zeros(3)
        speed, acceleration = (float(np.square(part).sum(-1).max()) ** 0.5 for part in (step, change))
        return max(speed / (bounds.speed * over), acceleration / (bounds.acceleration * over * over))

    def accept(self, pose: Pose) -> None:
        """Takes a pose for the last one that was shown."""
        self._shown.append(self._joints(pose))

    def _joints(self, pose: Pose) -> Array:
        return self._skeleton.joints(pose.root_position, pose.rotation)
