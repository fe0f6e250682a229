"""The safety envelope: for any requested targets, the emitted ones obey four limits and can always stop in time.

Position, velocity, acceleration and jerk are those of the emitted targets themselves, by differences from tick to tick.
Three rules hold in each tick:

1. A target within the limits, from which the joint can still stop, passes unchanged: playback is not filtered.
2. A target out of reach is caught up with: the acceleration is chosen whose stop, seen from the moving target, would
   end exactly on it.
3. Both give way to the law of stopping as far as the joint needs it to come to rest inside its position limits.

Rule 3 holds by induction: a joint at rest can stop, and afterwards only steps are taken from which it still can.

One joint at a time, in plain numbers: in a loop that sleeps between its ticks, fifty of numpy's calls on twenty numbers
each take three times as long. `envelope.c` does the same in C, bit for bit: change both (see `compiled_envelope`).
"""

from array import array

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.safety.braking import braked, held_back, longest_run, stopping_run
from controller.motion.rotations import Array, Flags
from motiondeck_base.errors import MotiondeckError

CHANGED = 1e-9  # a target that is changed by more than this (rad) is counted as changed

Moving = tuple[float, float, float]
"""Position, velocity and acceleration of a joint or of its target; the unit of time is one tick."""

Bounds = tuple[float, float, float, float, float, float]
"""Limits of velocity, acceleration and jerk, lower and upper ends, and the longest way to rest that a joint may ever
need: farther from its ends nothing is looked at."""

_FINITE = 1e300  # rad
_ROUNDING = 1e-12  # rad; the rounding error of a sum of many positions
_STEPS = 16  # bisection steps for an acceleration between two extremes


class LimitError(MotiondeckError):
    """Limits or a start that a joint cannot obey; the message names the joint."""


class SafetyEnvelope:
    """Turns targets into safe targets for J joints, one call a tick."""

    def __init__(self, limits: JointLimits, dt: float) -> None:
        """For ticks of dt seconds; joints rest mid-range until `start`. LimitError as of `check_limits`."""
        check_limits(limits)
        self.limits = limits
        inset = np.minimum(1e-10, 0.5 * (limits.upper - limits.lower))  # insets keep rounding inside the limits
        inside = 1.0 - 1e-9
        lower, upper = limits.lower + inset, limits.upper - inset
        most = (limits.velocity * (inside * dt), limits.acceleration * (inside * dt**2), limits.jerk * (inside * dt**3))
        self._bounds: list[Bounds] = [
            (v_max, a_max, j_max, low, high, longest_run(v_max, a_max, a_max, j_max))
            for v_max, a_max, j_max, low, high in np.transpose([*most, lower, upper]).tolist()
        ]
        joints = len(self._bounds)
        # Of each joint position, velocity, acceleration, the goal before, its velocity, and whether it moves like that.
        self._states: list[list[float]] | Array = [[0.0] * 6 for _ in range(joints)]
        self.changed = array("q", [0] * joints)  # how many targets of each joint were changed since the start
        self._safe = np.empty(joints)
        self._shown = self._safe.view()
        self._shown.flags.writeable = False  # no output can change what the next one is given
        self.start(0.5 * (lower + upper))

    def start(self, position: Array) -> None:
        """Begins anew with the joints at rest at `position` (J,), rad.

        A joint found outside its position limits may stay there, and moves inside only. LimitError if a position is not
        finite; it names the joint.
        """
        for joint in np.flatnonzero(~np.isfinite(position)):
            raise LimitError(f"joint {joint}: the position to start from is {position[joint]}, not a number")
        for state, p in zip(self._states, position.tolist(), strict=True):
            state[:] = p, 0.0, 0.0, p, 0.0, True
        self.changed[:] = array("q", [0] * len(self.changed))

    def restart(self, joints: Flags, position: Array) -> None:
        """Begins anew with these joints, shape (J,), at rest at `position` (J,), rad; the others go on."""
        for joint in np.flatnonzero(joints).tolist():
            self._states[joint][:] = float(position[joint]), 0.0, 0.0, float(position[joint]), 0.0, True

    @property
    def position(self) -> Array:
        """The targets emitted last, or the start, shape (J,), rad."""
        return np.array([state[0] for state in self._states])

    @property
    def at_rest(self) -> bool:
        """Whether all joints have come to rest."""
        return not any(v or a for _, v, a, *_ in self._states)

    def __call__(self, targets: Array, near: bool = False) -> Array:
        """The safe targets of this tick, shape (J,), rad, for any targets (J,).

        Where a target is not finite, the joint holds the last one that was. The array returned is read-only, and
        overwritten by the next tick.

        Args:
            near: targets are out of reach by little, and come back by themselves: each joint goes as near as it may,
                instead of catching up.
        """
        safe, changed = [], self.changed
        for joint, (target, state, bounds) in enumerate(zip(targets.tolist(), self._states, self._bounds, strict=True)):
            p, v, a, last_goal, last_goal_v, matched = state
            v_max, a_max, j_max, lower, upper, way = bounds
            fastest = target - p
            direct = fastest - v

            # Rule 1 covers most joints most of the time, by tests that are cheap and a little too strict. A target that
            # is not finite or outside the range passes none of them.
            if (matched or near) and -j_max <= direct - a <= j_max and -a_max <= direct <= a_max:
                size, fast = abs(direct), abs(fastest)
                room = upper - target if upper - target < target - lower else target - lower
                spare = size - 0.5 * j_max
                passes = fast + 0.5 * (spare * spare) / j_max <= v_max
                if passes and (way <= room or longest_run(fast, size, a_max, j_max) <= room):
                    state[:] = target, v + direct, direct, target, target - last_goal, True
                    safe.append(target)
                    continue
            goal = target if -_FINITE < target < _FINITE else last_goal
            goal = lower if goal < lower else upper if goal > upper else goal
            goal_v = goal - last_goal
            aim = goal, goal_v, goal_v - last_goal_v
            position, direct = _limited(near, near or matched > 0.0, (p, v, a), aim, bounds)
            # The velocity is summed, not differenced from positions: their rounding would grow with each difference.
            v += direct
            lag = position - goal
            # Whether the next acceleration would leave the joint moving as its target does: how far they part is, for
            # any target, what they differ in now.
            matched = -j_max <= lag <= j_max and -j_max <= goal_v - v - 2.0 * lag <= j_max
            state[:] = position, v, direct, goal, goal_v, matched
            safe.append(position)
            if not -CHANGED <= position - target <= CHANGED:  # so that a NaN counts
                changed[joint] += 1
        self._safe[:] = safe
        return self._shown

    def brake(self) -> Array:
        """The targets of one tick of braking, as __call__ returns them; once at rest the joints are held."""
        for state, (_, a_max, j_max, *_) in zip(self._states, self._bounds, strict=True):
            p, v, a, *_ = state
            a = braked(v, a, a_max, j_max)
            v += a
            state[:] = p + v, v, a, p + v, v, True
        self._safe[:] = self.position
        return self._shown


def _limited(near: bool, matched: bool, now: Moving, aim: Moving, bounds: Bounds) -> tuple[float, float]:
    """The next position and acceleration of one joint, by the three rules with exact tests.

    `matched` says whether the joint, once at its target, would soon move as that does.
    """
    (p, v, a), (goal, _, _) = now, aim
    v_max, a_max, j_max, lower, upper, _ = bounds
    direct = goal - p - v  # the acceleration that reaches the target in this tick

    # The accelerations within the limits; letting one go must not drive the velocity over its limit either.
    stop = braked(v, a, a_max, j_max)
    low, high = max(a - j_max, -a_max), min(a + j_max, a_max)
    # Letting h go adds less than (h + j/2)^2 / 2j to the velocity: mostly far less than there is room for.
    down, up = 0.5 * j_max - low, 0.5 * j_max + high
    if down * down > 2.0 * j_max * (v_max + v):
        low = max(low, -held_back(v_max + v, j_max))
    if up * up > 2.0 * j_max * (v_max - v):
        high = min(high, held_back(v_max - v, j_max))
    low, high = min(low, stop), max(high, stop)

    passes = matched and low <= direct <= high
    chosen = min(max(direct, low), high)
    if not (passes or near):
        chosen = _catching_up(p, v, aim, bounds, low, high)

    bottom, top = min(lower, p) - _ROUNDING, max(upper, p) + _ROUNDING
    rise, fall, _ = stopping_run(v + chosen, chosen, a_max, j_max)
    if p + v + chosen + rise <= top and p + v + chosen + fall >= bottom:
        return goal if passes else p + (v + chosen), chosen
    # Rule 3: stopping was found safe in the tick before; from there towards the choice as far as it stays safe.
    way, safe = chosen - stop, stop
    for step in range(1, _STEPS):
        c = stop + step / _STEPS * way
        rise, fall, _ = stopping_run(v + c, c, a_max, j_max)
        if not (p + v + c + rise <= top and p + v + c + fall >= bottom):
            break
        safe = c
    return p + (v + safe), safe


def _catching_up(p: float, v: float, aim: Moving, bounds: Bounds, low: float, high: float) -> float:
    """The acceleration between low and high whose stop, seen from the moving target, ends on it, or the nearest end."""
    (goal, goal_v, goal_a), (v_max, a_max, j_max, _, _, _) = aim, bounds
    # By how far it would end beyond rises with the acceleration; its zero is found to one part in _STEPS.
    steady = abs(goal_a) <= a_max and abs(goal_v) <= v_max  # else it jumps: nothing to predict
    goal_v, goal_a = min(max(goal_v, -v_max), v_max), goal_a if steady else 0.0
    off, fast = p + v - goal, v - goal_v
    y_low = off + low + stopping_run(fast + low, low - goal_a, a_max, j_max)[2]
    if y_low >= 0.0 or low >= high:
        return low
    y_high = off + high + stopping_run(fast + high, high - goal_a, a_max, j_max)[2]
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
        y = off + middle + stopping_run(fast + middle, middle - goal_a, a_max, j_max)[2]
        if y < 0.0:
            low, y_low = middle, y
        else:
            high, y_high = middle, y
        if high - low <= enough:
            return low - y_low / (y_high - y_low) * (high - low)


def check_limits(limits: JointLimits) -> None:
    """Refuses limits that no joint can obey (LimitError): of other lengths, not finite, an empty range, a rate of 0."""
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
