"""The safety envelope: for any requested targets, the emitted ones obey four limits and can always stop in time.

Position, velocity, acceleration and jerk are those of the emitted targets themselves, by differences from tick to tick.
Three rules hold in each tick:

1. A target within the limits, from which the joint can still stop, passes unchanged: playback is not filtered.
2. A target out of reach is caught up with: the acceleration is chosen whose stop, seen from the moving target, would
   end exactly on it.
3. Both give way to the law of stopping as far as the joint needs it to come to rest inside its position limits.

Rule 3 holds by induction: a joint at rest can stop, and afterwards only steps are taken from which it still can.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.braking import braked, held_back, longest_run, stopping_run
from controller.rotations import Array
from motiondeck_base.errors import MotiondeckError

CHANGED = 1e-9
"""A target that is changed by more than this (rad) is counted as changed."""

_ROUNDING = 1e-12  # rad; the rounding error of a sum of many positions
_STEPS = 16  # an acceleration is chosen to one part in so many between two extremes


class LimitError(MotiondeckError):
    """Limits or a start that a joint cannot obey; the message names the joint."""


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
        joints = len(self._lower)
        # One column holds the whole state of a joint, so that a joint that needs the exact tests is read in one go.
        self._table = np.zeros((12, joints))
        self._table[7:] = self._v_max, self._a_max, self._j_max, self._lower, self._upper
        self._p, self._v, self._a, self._goal, self._goal_v, self._direct, self._goal_a = self._table[:7]
        self._tests = np.empty((6, joints))
        self._bounds = np.array([self._v_max, self._a_max, *[self._j_max] * 3, self._upper])
        self.changed = np.zeros(joints, dtype=np.int64)
        self._safe = np.empty(joints)
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
        self._table[:7] = 0.0
        self._p[:] = self._goal[:] = position
        self.changed[:] = 0

    @property
    def position(self) -> Array:
        """The targets emitted last, or the start, shape (J,), rad."""
        return self._p.copy()

    @property
    def at_rest(self) -> bool:
        """Whether all joints have come to rest."""
        return not (self._v.any() or self._a.any())

    def __call__(self, targets: Array) -> Array:
        """The safe targets of this tick, shape (J,), rad, for any targets (J,).

        Where a target is not finite, the joint holds the last one that was. The array returned is read-only, and
        overwritten by the next tick.
        """
        p, v, direct, goal_a = self._p, self._v, self._direct, self._goal_a
        finite = np.isfinite(targets)
        wanted = targets if finite.all() else np.where(finite, targets, self._goal)
        goal = np.minimum(np.maximum(wanted, self._lower), self._upper)
        goal_v = goal - self._goal
        np.subtract(goal_v, self._goal_v, out=goal_a)
        lag = p - self._goal
        self._goal[:], self._goal_v[:] = goal, goal_v

        # Rule 1 covers most joints most of the time, by tests that are cheap and a little too strict: no row of
        # `tests` may exceed that of `bounds`.
        tests, bounds = self._tests, self._bounds
        fastest, size, jerk, behind, parting, reach = tests
        np.subtract(goal, p, out=fastest)
        np.subtract(fastest, v, out=direct)
        size[:] = direct
        np.subtract(direct, self._a, out=jerk)
        behind[:] = lag
        np.subtract(direct, goal_a, out=parting)
        parting -= lag
        np.abs(tests[:5], out=tests[:5])
        reach[:] = longest_run(fastest, size, self._a_max, self._j_max)
        fastest += 0.5 * (size - 0.5 * self._j_max) ** 2 / self._j_max
        np.minimum(self._upper - goal, goal - self._lower, out=bounds[5])
        passes = tests <= bounds
        if passes.all():
            self._move_to(goal, direct)
        else:
            position, a = goal.copy(), direct.copy()
            who = np.flatnonzero(~passes.all(axis=0))
            matched = (passes[3] & passes[4])[who].tolist()
            for joint, row, soon in zip(who.tolist(), self._table[:, who].T.tolist(), matched, strict=True):
                position[joint], a[joint] = _limited(soon, *row)
            self._move_to(position, a)
        self.changed += ~(np.abs(self._safe - targets) <= CHANGED)  # a NaN compares false, so it counts
        return self._shown

    def brake(self) -> Array:
        """The targets of one tick of braking, as __call__ returns them; once at rest the joints are held."""
        states = zip(self._v.tolist(), self._a.tolist(), self._a_max.tolist(), self._j_max.tolist(), strict=True)
        a = np.array([braked(*state) for state in states])
        self._move_to(self._p + (self._v + a), a)
        self._goal[:], self._goal_v[:] = self._p, self._v
        return self._shown

    def _move_to(self, position: Array, a: Array) -> None:
        # The velocity is summed, not differenced from positions: their rounding would grow with each difference.
        self._v += a
        self._p[:] = self._safe[:] = position
        self._a[:] = a


def _limited(
    matched: bool,
    p: float,
    v: float,
    a: float,
    goal: float,
    goal_v: float,
    direct: float,
    goal_a: float,
    v_max: float,
    a_max: float,
    j_max: float,
    lower: float,
    upper: float,
) -> tuple[float, float]:
    """The next position and acceleration of one joint, by the three rules with exact tests.

    `direct` is the acceleration that reaches the target in this tick, and `matched` says whether the joint would
    then soon move as the target does.
    """

    # The accelerations within the limits; letting one go must not drive the velocity over its limit either.
    stop = braked(v, a, a_max, j_max)
    low = min(max(a - j_max, -a_max, -held_back(v_max + v, j_max)), stop)
    high = max(min(a + j_max, a_max, held_back(v_max - v, j_max)), stop)

    chosen = direct
    passes = matched and low <= direct <= high
    if not passes:
        steady = abs(goal_a) <= a_max and abs(goal_v) <= v_max  # else it jumps: nothing to predict
        goal_v, goal_a = min(max(goal_v, -v_max), v_max), goal_a if steady else 0.0

        def overshoot(c: float) -> float:
            return p + v + c - goal + stopping_run(v + c - goal_v, c - goal_a, a_max, j_max)[2]

        chosen = _rising_zero(overshoot, low, high)

    bottom, top = min(lower, p) - _ROUNDING, max(upper, p) + _ROUNDING

    def stops_inside(c: float) -> bool:
        rise, fall, _ = stopping_run(v + c, c, a_max, j_max)
        return p + v + c + rise <= top and p + v + c + fall >= bottom

    if stops_inside(chosen):
        return goal if passes else p + (v + chosen), chosen
    # Rule 3: stopping was found safe in the tick before; from there towards the choice as far as it stays safe.
    way = chosen - stop
    inside = 0
    while inside + 1 < _STEPS and stops_inside(stop + (inside + 1) / _STEPS * way):
        inside += 1
    chosen = stop + inside / _STEPS * way
    return p + (v + chosen), chosen


def _rising_zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Where an increasing function crosses zero between low and high, or the nearest end; to one part in _STEPS."""
    y_low, y_high = function(low), function(high)
    if y_low >= 0.0 or low >= high:
        return low
    if y_high <= 0.0:
        return high
    enough = (high - low) / _STEPS
    while True:
        # A straight line between the ends, but not so near to one of them that the other never moves.
        share = min(max(-y_low / (y_high - y_low), 0.1), 0.9)
        middle = low + share * (high - low)
        if not low < middle < high:
            # The ends are neighbours among the numbers there are: between them nothing is left to look at.
            return low
        y = function(middle)
        if y < 0.0:
            low, y_low = middle, y
        else:
            high, y_high = middle, y
        if high - low <= enough:
            return low - y_low / (y_high - y_low) * (high - low)


def check_limits(limits: JointLimits) -> None:
    """Checks that a joint can obey the limits.

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
