"""The safety envelope: whatever is asked of the joints, what they are given obeys four limits and can stop in time.

Position, velocity, acceleration and jerk are those of the emitted targets themselves, by differences from tick to tick.
Each tick has three rules, the first that applies:

1. A target that the limits allow, from where it can still be stopped, passes unchanged: playback is not filtered.
2. A target that is out of reach is caught up with: the acceleration is chosen whose stop, seen from the moving target,
   would end exactly on it.
3. Either gives way to the law of stopping as far as needed for the joint to come to rest inside its position limits.

Rule 3 holds by induction: from rest a joint can stop; afterwards only such steps are taken from which it still can.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from controller.errors import MotiondeckError
from controller.realtime.interfaces import JointLimits
from controller.realtime.stopping import braked, held_back, longest_run, stopping_run
from controller.rotations import Array

CHANGED = 1e-9
"""A target that is changed by more than this (rad) counts as changed."""

_ROUNDING = 1e-12  # rad, by which a sum of many positions may miss what it should be
_CANDIDATES = 17  # accelerations looked at between the two extremes, when one has to be chosen


class LimitError(MotiondeckError):
    """Limits, or a start, that no joint can obey; the message names the joint."""


class SafetyEnvelope:
    """Turns targets into safe targets for J joints, one call a tick.

    Attributes:
        limits: as given.
        changed: how many targets of each joint were changed since the start, shape (J,).
    """

    def __init__(self, limits: JointLimits, dt: float) -> None:
        """An envelope for ticks of dt seconds; the joints rest in the middle of their range until `start`.

        Raises:
            LimitError: if a limit is not finite, a range is empty, or a rate is not positive.
        """
        check_limits(limits)
        self.limits = limits
        inset = np.minimum(1e-10, 0.5 * (limits.upper - limits.lower))  # insets keep rounding inside the limits
        inside = 1.0 - 1e-9
        self._lower, self._upper = limits.lower + inset, limits.upper - inset
        self._v_max = limits.velocity * (inside * dt)
        self._a_max = limits.acceleration * (inside * dt**2)
        self._j_max = limits.jerk * (inside * dt**3)
        self.changed = np.zeros(len(self._lower), dtype=np.int64)
        self._safe = np.empty(len(self._lower))
        self._shown = self._safe.view()
        self._shown.flags.writeable = False  # no output can change what the next one is given
        self.start(0.5 * (self._lower + self._upper))

    def start(self, position: Array) -> None:
        """Begins anew with the joints at rest at `position` (J,), rad.

        A joint found outside its position limits may stay there, and moves inside only.

        Raises:
            LimitError: if a position is not finite; it names the joint.
        """
        for joint in np.flatnonzero(~np.isfinite(position)):
            raise LimitError(f"joint {joint}: the position to start from is {position[joint]}, not a number")
        self._p = np.array(position, dtype=np.float64)
        self._v, self._a = np.zeros_like(self._p), np.zeros_like(self._p)
        self._goal, self._goal_v = self._p, self._v
        self.changed[:] = 0

    @property
    def position(self) -> Array:
        """The targets given last, or the start, shape (J,), rad; do not write into it."""
        return self._p

    @property
    def at_rest(self) -> bool:
        """Whether no joint moves any more."""
        return not (self._v.any() or self._a.any())

    def __call__(self, targets: Array) -> Array:
        """The safe targets of this tick, shape (J,), rad, for any targets (J,).

        Where a target is not finite, the joint holds the last one that was. The array returned is read-only, and
        overwritten by the next tick.
        """
        goal = np.clip(np.where(np.isfinite(targets), targets, self._goal), self._lower, self._upper)
        goal_v = goal - self._goal
        goal_a = goal_v - self._goal_v
        lag = self._p - self._goal
        self._goal, self._goal_v = goal, goal_v

        # Rule 1 for most joints, most of the time, by tests that are cheap and a little too strict.
        v = goal - self._p
        a = v - self._v
        size = np.abs(a)
        matched = np.maximum(np.abs(lag), np.abs(a - goal_a - lag)) <= self._j_max
        reach = longest_run(v, a, self._a_max, self._j_max)
        passes = (
            matched
            & (np.abs(a - self._a) <= self._j_max)
            & (size <= self._a_max)
            & (np.abs(v) + 0.5 * (size - 0.5 * self._j_max) ** 2 / self._j_max <= self._v_max)
            & (goal + reach <= self._upper)
            & (goal - reach >= self._lower)
        )
        position = goal.copy()
        if not passes.all():
            bent = np.flatnonzero(~passes)
            position[bent], a[bent] = self._bent(bent, a[bent], matched[bent], goal_a[bent])
        self._move_to(position, a)
        self.changed += ~(np.abs(self._safe - targets) <= CHANGED)  # a NaN compares false, so it counts
        return self._shown

    def brake(self) -> Array:
        """The targets of one tick on the way to rest, as __call__ returns them; where the joints stop is held then."""
        a = braked(self._v, self._a, self._a_max, self._j_max)
        self._move_to(self._p + (self._v + a), a)
        self._goal, self._goal_v = self._p, self._v
        return self._shown

    def _move_to(self, position: Array, a: Array) -> None:
        # The velocity is summed, not differenced from positions: their rounding would grow with each difference.
        self._p, self._v, self._a = position, self._v + a, a
        np.copyto(self._safe, position)

    def _bent(
        self, who: NDArray[np.intp], direct: Array, matched: NDArray[np.bool_], goal_a: Array
    ) -> tuple[Array, Array]:
        """The next positions and accelerations of the joints `who`, by the three rules with exact tests.

        `direct` is the acceleration that reaches the target in this tick, and `matched` says whether the joint would
        then soon move as the target does.
        """
        p, v, a, goal = self._p[who], self._v[who], self._a[who], self._goal[who]
        v_max, a_max, j_max = self._v_max[who], self._a_max[who], self._j_max[who]

        # The accelerations within the limits; letting one go must not drive the velocity over its limit either.
        stop = braked(v, a, a_max, j_max)
        low = np.minimum(np.maximum(np.maximum(a - j_max, -a_max), -held_back(v_max + v, j_max)), stop)
        high = np.maximum(np.minimum(np.minimum(a + j_max, a_max), held_back(v_max - v, j_max)), stop)

        passes = matched & (low <= direct) & (direct <= high)
        chosen = direct
        if not passes.all():
            goal_v = self._goal_v[who]
            steady = (np.abs(goal_a) <= a_max) & (np.abs(goal_v) <= v_max)  # else it jumps: nothing to predict
            goal_v, goal_a = np.clip(goal_v, -v_max, v_max), np.where(steady, goal_a, 0.0)

            def overshoot(c: Array) -> Array:
                return p + v + c - goal + stopping_run(v + c - goal_v, c - goal_a, a_max, j_max).rest

            chosen = np.where(passes, direct, _rising_zero(overshoot, low, high))

        bottom, top = np.minimum(self._lower[who], p) - _ROUNDING, np.maximum(self._upper[who], p) + _ROUNDING

        def stops_inside(c: Array) -> NDArray[np.bool_]:
            run = stopping_run(v + c, c, a_max, j_max)
            return (p + v + c + run.rise <= top) & (p + v + c + run.fall >= bottom)

        inside = stops_inside(chosen)
        if not inside.all():
            share = np.linspace(0.0, 1.0, _CANDIDATES)[:, None]
            allowed = stops_inside(stop + share * (chosen - stop))
            allowed[0] = True  # rule 3: found safe when the last step was taken
            farthest = np.argmin(allowed, axis=0) - 1
            chosen = np.where(inside, chosen, stop + share[farthest, 0] * (chosen - stop))
        return np.where(passes & inside, goal, p + (v + chosen)), chosen


def _rising_zero(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where an increasing function of (K, n) arrays crosses zero between low and high (n,), or the nearest end."""
    grid = low + np.linspace(0.0, 1.0, _CANDIDATES)[:, None] * (high - low)
    value = function(grid)
    after = np.clip((value < 0.0).sum(axis=0), 1, _CANDIDATES - 1)
    column = np.arange(len(low))
    y0, y1 = value[after - 1, column], value[after, column]
    share = np.clip(-y0 / np.where(y1 > y0, y1 - y0, 1.0), 0.0, 1.0)
    return grid[after - 1, column] + share * (grid[after, column] - grid[after - 1, column])


def check_limits(limits: JointLimits) -> None:
    """Checks that the limits are ones a joint can live in.

    Raises:
        LimitError: if lengths differ, a limit is not finite, a range is empty or a rate is not positive.
    """
    rates = {"velocity": limits.velocity, "acceleration": limits.acceleration, "jerk": limits.jerk}
    joints = len(limits.lower)
    if any(values.shape != (joints,) for values in (limits.upper, *rates.values())):
        raise LimitError(f"joint limits must all have one value for each of the {joints} joints")
    for joint, (lower, upper) in enumerate(zip(limits.lower, limits.upper, strict=True)):
        if not (np.isfinite(lower) and np.isfinite(upper) and lower <= upper):
            raise LimitError(f"joint {joint}: positions from {lower} to {upper} rad are no range; give lower <= upper")
        for name, values in rates.items():
            if not (np.isfinite(values[joint]) and values[joint] > 0.0):
                raise LimitError(f"joint {joint}: a {name} limit of {values[joint]} is not a positive number")
