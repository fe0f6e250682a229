"""Stuck limbs: a second solution, started from rest, for limbs that small steps do not bring to their goals.

Least squares may end in a local minimum at a joint's limit, though the goal is in reach by another way: an arm behind
the back, say. While a limb is far off, a second solution (the scout) follows the same goals from rest, without limits
of speed. If it gets much closer, the limb's joints go over to it at full speed.
"""

from collections.abc import Callable, Sequence

import numpy as np

from controller.motion.rotations import Array, Flags
from sim.retargeting.limb_finder import FEET

# Error of a vector from which its limb is far off, as a share of its length; the scout's relative error to take over.
FAR, BETTER = 0.4, 0.5
OFF = 0.1  # error from which a limb of the first pose is tried from other angles, as a share of its length
# Steps of the scout a second, their largest number, and the pause until the next scout, s.
STEP_RATE, LOOKS, PAUSE = 400.0, 20, 0.25
SETTLED, THERE = 0.02, 0.02  # rad

Advance = Callable[[Array, Array, Array, Array], tuple[Array, Array]]
"""q (N,), goals (K, 3), least and greatest step (N,) to the next q and the squared misses (K,), m^2."""


class StuckLimbs:
    """Leads stuck limbs of one robot to a second solution; the joints `crossing` (N,) are on their way to it."""

    def __init__(
        self, names: Sequence[str], moved: Flags, length: Array, rest: Array, advance: Advance, dt: float
    ) -> None:
        """Args: K vectors, the N joints that move them (K, N), their lengths, the rest pose, the step, the tick."""
        self._rest, self._advance = rest, advance
        self._far, self._off, self._pause = np.square(FAR * length), np.square(OFF * length), round(PAUSE / dt)
        self._steps = max(round(STEP_RATE * dt), 1)
        kinds = [(f"{side}_", arm) for side in "rl" for arm in (True, False)]
        limbs = [np.array([name.startswith(side) and ("arm" in name) == arm for name in names]) for side, arm in kinds]
        self._limbs = np.array([limb for limb in limbs if limb.any()]).reshape(-1, len(names))
        # A limb's own joints move nothing but that limb.
        is_limb = np.array([name != FEET for name in names])
        own = [moved[limb].any(axis=0) & ~moved[~limb & is_limb].any(axis=0) for limb in self._limbs]
        self._joints = np.array(own, dtype=bool).reshape(-1, len(rest))
        self.reset()

    def reset(self) -> None:
        """Drops the scout."""
        self.crossing = np.zeros(len(self._rest), dtype=bool)
        self._scout: Array | None = None
        self._looked = self._waiting = 0

    def of_limbs_off(self, missed: Array) -> Flags:
        """The joints (N,) of limbs that are off, for squared errors (K,), m^2."""
        off = missed > self._off
        return np.any([joints & off[one].any() for one, joints in zip(self._limbs, self._joints, strict=True)], axis=0)

    def better_limbs(self, q: Array, missed: Array, other: Array, there: Array) -> tuple[Array, Array]:
        """Joints (N,) and squared errors (K,), with limbs of other ones that are much closer."""
        for limb, joints in zip(self._limbs, self._joints, strict=True):
            if there[limb].sum() < BETTER**2 * missed[limb].sum():
                q, missed = np.where(joints, other, q), np.where(limb, there, missed)
        return q, missed

    def __call__(
        self, q: Array, missed: Array, goals: Array, low: Array, high: Array, lowest: Array, highest: Array
    ) -> Array:
        """The joints (N,), rad, with those of a stuck limb one step on their way.

        For joints q (N,) after this tick's steps, squared errors (K,), m^2, goals (K, 3), the joints' range and bounds
        of this tick, (N,) each.
        """
        if self._scout is None:
            self._waiting -= 1
            if self._waiting > 0 or not (missed > self._far).any():
                return q
            self._scout, self._looked = np.clip(self._rest, low, high), 0
        before = scout = self._scout
        there = missed
        for _ in range(self._steps):
            before = scout
            scout, there = self._advance(scout, goals, low - scout, high - scout)
        self._scout = scout
        if not self.crossing.any():
            self._looked += self._steps
            if self._looked < LOOKS and np.abs(scout - before).max() > SETTLED:
                return q
            for limb, joints in zip(self._limbs, self._joints, strict=True):
                far = (missed[limb] > self._far[limb]).any()
                if far and there[limb].sum() < BETTER**2 * missed[limb].sum():
                    self.crossing |= joints
            if not self.crossing.any():
                self._scout, self._waiting = None, self._pause
                return q
        crossing = self.crossing
        q = np.where(crossing, np.clip(scout, lowest, highest), q)
        if np.abs(scout - q)[crossing].max() < THERE:
            self.reset()
        return q
