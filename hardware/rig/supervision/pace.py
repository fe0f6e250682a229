"""The pace of a rig's joints: how far each goal may go now, eased while a joint is hot, strained or catching up."""

import math

import numpy as np
from numpy.typing import NDArray

from hardware.families.models import TRAITS
from hardware.rig.driving.readings import Measurements
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import Array, RigScale
from hardware.rig.supervision.health import EASED_FROM

SLOWER = 0.25  # the part of its speed limit at which a joint catches up
_LONGEST_STEP = 2.0  # ticks of motion for an eased joint after a stall: the servo would take it at full speed
_ARRIVED = 0.02  # rad between goal and target
_TOGETHER = 0.8
_LAG, _PLAY, _PATIENCE = 0.15, 0.05, 2.0  # s, rad, s
_EASED_TO = 2.0  # degC below the servo's limit
_LEAST = 0.25
_SAGS_FROM = 0.9  # of the highest voltage seen, because every load takes some
_SMOOTHED_OVER = 0.25  # s
_STRAINED, _RELIEVED = 0.75, 0.6
_GENTLE = 0.5  # of the allowed current
_STEADY = 0.1  # part by which a current that does not change may differ from the smoothed one
_NEAREST = 0.3  # of how far the maker's figures have the goal of a yielding joint
_MOST = 0.8  # of the stall current, where the rig file has no limit: about where servos report an overload


class JointPace:
    """Bounds the goals of J joints while a loop drives them."""

    def __init__(self, config: RigConfig, scale: RigScale, own: Measurements, now: float, spare: float = 0.0) -> None:
        """Bounds goals from the time `now`, s; joints keep up to `spare` ticks of time that they did not use.

        With spare time a write that comes a little early takes nothing from a joint at full speed. Heat and slack that
        each servo bears are taken from its own settings in `own`, whenever they are read anew.
        """
        self.ease, self.strain, self.catching_up = Easing(own.hottest), Strain(config, own.slack), CatchingUp(config)
        self._scale = scale
        self._speed = np.array([joint.velocity for joint in config.joints])
        self._longest = _LONGEST_STEP / config.rate_hz
        self._last, self._passed = now, 0.0
        # Time that has passed and was not used for motion, of each joint, s.
        self._spare = spare / config.rate_hz
        self._time = np.full(len(config.joints), self._spare)

    @property
    def part(self) -> Array:
        """The part of its speed limit that each joint may use now, shape (J,)."""
        return np.minimum(self.ease.part, self.catching_up.pace_of_goals)

    @property
    def of_servos(self) -> Array:
        """The part that the servos themselves keep, shape (J,): a servo would hurry after a goal that turns back."""
        # A yielding joint gets full speed, because it must let go at once.
        return np.where(self.strain.yielding, 1.0, self.catching_up.pace)

    def bound(self, targets: Array, goals: Array, positions: Array, now: float) -> tuple[Array, NDArray[np.bool_]]:
        """The next goals (J,), within the limits of position and of speed in real time; and the targets beyond a limit.

        For targets (J,), rad, finite, the goals that were sent last, within the limits, and measured positions.
        """
        passed = self._passed = max(0.0, now - self._last)
        self._last = now
        self._time += passed
        yielding = self.strain.yielding
        if np.logical_or.reduce(yielding):
            reach = self.strain.reach
            near = np.clip(targets, positions - reach, positions + reach)
            targets = np.where(yielding, near, targets)
            self.catching_up.joints |= yielding
        part = np.where(yielding, 1.0, self.part)
        within = self._scale.within(targets)
        speed = self._speed * part
        reach = speed * np.where(part < 1.0, min(self._longest, passed), self._time)
        bounded = np.minimum(np.maximum(within, goals - reach), goals + reach)
        self._time = np.minimum(self._time - np.abs(bounded - goals) / speed, self._spare)
        return bounded, targets != within

    def sent(self, targets: Array, goals: Array, positions: Array, held: NDArray[np.bool_]) -> None:
        """Ends the catching up of joints that have: from the targets, the goals sent and the positions, rad."""
        # It goes on in joints that are `held`, whose targets are not where they shall go.
        # A joint that stands at a limit has caught up with a target beyond it.
        within = self._scale.within(targets)
        kept = self.strain.yielding | held
        self.catching_up.note(within, goals, positions, kept, self._passed, self._last)

    def start_again(self, joints: NDArray[np.int64] | slice, now: float) -> None:
        """Makes these joints catch up, from at most one tick ago on."""
        self._last = max(self._last, now - 0.5 * self._longest)
        self.catching_up.joints[joints] = True
        self.strain.forget(joints)


class CatchingUp:
    """After a recovery a joint goes to its target at a quarter of its speed limit, until it is there.

    Its goal may reach the target while the joint is still far off, or turns away. It has caught up when it is at most
    `_LAG` seconds at the speed of its target and `_PLAY` rad behind or, held by a load or a hand, after `_PATIENCE`.
    """

    def __init__(self, config: RigConfig) -> None:
        count = len(config.joints)
        self.joints = np.zeros(count, dtype=np.bool_)
        self._slower = np.array([1.0 if joint.second is None else _TOGETHER for joint in config.joints])
        self._speed = SLOWER * np.array([joint.velocity for joint in config.joints])
        self._since = np.full(count, np.inf)  # when the goal of a joint has arrived at its target, s
        self._targets = np.full(count, np.nan)  # the last ones, within the limits, rad

    @property
    def pace(self) -> Array:
        """The part of its speed limit that each joint may use, shape (J,)."""
        return np.where(self.joints, SLOWER, 1.0)

    @property
    def pace_of_goals(self) -> Array:
        """The same of goals: slower of a joint with two servos, whose paths come together meanwhile, shape (J,)."""
        return np.where(self.joints, self.pace * self._slower, 1.0)

    def note(
        self, targets: Array, goals: Array, positions: Array, kept: NDArray[np.bool_], passed: float, now: float
    ) -> None:
        """Ends it for the joints that have caught up, by their targets (within the limits), goals and positions, rad.

        Joints that are `kept` go on catching up; `passed` is the time since the last call, s.
        """
        arrived = np.abs(targets - goals) < _ARRIVED
        self._since = np.where(arrived & self.joints, np.minimum(self._since, now), np.inf)
        speed = np.fmin(np.abs(targets - self._targets) / max(passed, 1e-3), self._speed)
        self._targets = targets
        there = np.abs(goals - positions) < _PLAY + _LAG * speed
        self.joints &= kept | ~(arrived & (there | (now - self._since > _PATIENCE)))


class Easing:
    """The part of its speed limit that a joint may use while it is hot, or while its supply has fallen.

    Heat: full speed up to 12 degC below the servo's limit, a quarter from 2 degC below it on.

    Supply: speed and loop gain of a servo are proportional to its voltage. At V of its V0, a shaft that turns as fast
    as before is V0 / V times as far behind its path, and when the voltage is back it hurries after it that much too
    fast. At V / V0 of the speed it is no farther behind than before.
    """

    def __init__(self, hottest: Array) -> None:
        """Eases below these temperatures (J,), degC."""
        self.part = np.ones(len(hottest))  # of its speed limit that each joint may use now, shape (J,)
        self._hottest = hottest
        self._strongest = np.full(len(hottest), np.nan)

    def note(self, temperatures: Array, voltages: Array) -> None:
        """Takes in the temperatures, degC, and supply voltages, V, both (J,) and NaN where not measured yet."""
        self._strongest = np.fmax(self._strongest, voltages)
        heat = (self._hottest - temperatures - _EASED_TO) / (EASED_FROM - _EASED_TO)
        supply = voltages / (_SAGS_FROM * self._strongest)
        self.part = np.maximum(np.fmin(np.fmin(heat, supply), 1.0), _LEAST)


class Strain:
    """A joint that pushes against something yields before its servo shuts down for overload.

    The current of each joint, as a part of the allowed one, is smoothed over a quarter of a second. Above 75 % the
    joint yields: its goal stays so near its position that it keeps pushing with half the current. Below 60 % it
    follows its target again. A motor that draws more than its maker says, or has a higher voltage, would push harder
    from there: its goal comes nearer until half is what is measured. While one of two servos is out of reach, it may
    pull at the joint: the current is not smoothed then, so that the other yields before it could leap back.
    """

    def __init__(self, config: RigConfig, slack: Array) -> None:
        """Knows each servo's slack (J,), rad, as in `OwnSettings`."""
        # A gripper is not strained by what it holds.
        self._allowed = np.array([math.inf if joint.grip else allowed_current(joint) for joint in config.joints])
        self._slack = slack
        stall = np.array([TRAITS[joint.model].stall_current for joint in config.joints])
        self._gentle = _GENTLE * self._allowed / stall
        self._nearer = np.ones(len(config.joints))  # than by the maker's figures
        self.yielding = np.zeros(len(config.joints), dtype=np.bool_)  # joints that yield now, shape (J,)
        self._smoothed = np.zeros(len(config.joints))
        self._noted = -math.inf

    @property
    def reach(self) -> Array:
        """How far from its position the goal of a yielding joint may be, shape (J,), rad."""
        return self._nearer * self._gentle * self._slack

    def note(self, currents: Array, now: float, alone: NDArray[np.bool_] | bool = False) -> None:
        """Takes in the currents (J,), A, measured at the time `now`, s, and which joints one servo holds `alone`."""
        share = np.where(alone, 1.0, -math.expm1(-min(1.0, max(0.0, now - self._noted)) / _SMOOTHED_OVER))
        self._noted = now
        taken = np.abs(currents) / self._allowed
        self._smoothed += (taken - self._smoothed) * share
        yielded, self.yielding = self.yielding, self._smoothed > np.where(self.yielding, _RELIEVED, _STRAINED)
        if np.logical_or.reduce(yielded):
            # A current that changes is that of a goal on its way back.
            steady = np.abs(taken - self._smoothed) < _STEADY * self._smoothed
            nearer = np.clip(self._nearer * (1.0 - share * (taken / _GENTLE - 1.0)), _NEAREST, 1.0)
            self._nearer = np.where(self.yielding, np.where(steady, nearer, self._nearer), 1.0)

    def forget(self, joints: NDArray[np.int64] | slice) -> None:
        """Forgets the currents of joints that hold anew; while they yielded they were not to be slow."""
        self._smoothed[joints], self.yielding[joints] = 0.0, False


def allowed_current(joint: RigJoint) -> float:
    """The current that a joint may draw, A."""
    return min(joint.current or math.inf, _MOST * TRAITS[joint.model].stall_current)
