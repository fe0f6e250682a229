"""Live values: joints that follow values from outside over what the deck plays, and fall back when these cease.

From where it is, and as fast as it moves then, a joint follows its goal g critically damped,

    x'' = w^2 (g - x) - 2 w x',    w = FOLLOW,

stepped exactly and no faster than its limit; it lags 2 / w behind a goal that moves evenly. When no value has come for
some time, the share of x in the joint's target goes to 0 as that of a layer does. In a pause joints stay where they
are. The safety envelope sees the result like all targets.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, copysign, exp, hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits
from controller.deck.joins.deck_motions import SUMMED
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

FASTER, TURNS, HARDER = 0.4, 8.0, 0.45  # as above
QUICKEST, SHARPEST = 3.0, 20.0  # of the pace of a share, 1/s, and its change, 1/s^2


@dataclass(eq=False, kw_only=True)
class Share:
    """The share that joint targets p have in those beneath, q: q + s (p - q).

    While s changes, the speed of a joint is a mean of both plus s' (p - q), and its acceleration one of theirs plus
    2 s' (p - q)' + s'' (p - q). The pace s' is kept so low that these stay within the limits of a join: with V and A,
    the largest speed and acceleration of joints in both motions,

        |s'| <= 0.4 V / d,    |s'| <= A / 8 V,    |s''| <= 0.45 A / d,

    where d is the largest |p - q| so far.
    """

    goal: float
    speed: float  # the largest of a joint in what it joins, rad/s
    acceleration: float  # likewise, rad/s^2
    farthest: float = 1e-6  # that it has been from what is beneath, rad
    share: float = 0.0
    pace: float = 0.0  # of the share, 1/s

    @property
    def arrived(self) -> bool:
        """Whether its share is at its goal."""
        return self.share == self.goal

    def approach(self, apart: float, dt: float, *, may_change: bool) -> None:
        """Advances by dt seconds, with the targets `apart`, rad, from those beneath; else it brakes."""
        # By the largest distance so far: a pace that the present one allows could not end in time when it grows.
        left, self.farthest = self.goal - self.share, max(apart, self.farthest)
        slew = min(SHARPEST, HARDER * self.acceleration / self.farthest)
        most = min(QUICKEST, FASTER * self.speed / self.farthest, self.acceleration / (TURNS * self.speed))
        wanted = copysign(min(most, sqrt(slew * abs(left))), left) if may_change else 0.0
        pace = min(max(wanted, self.pace - slew * dt), self.pace + slew * dt)
        self.pace = min(max(pace, -most), most) if abs(pace) > 2e-5 else 0.0  # what rounding leaves of a sum of steps
        step = self.pace * dt
        if abs(left) <= max(abs(step), 1e-9) and step * left >= 0.0 and may_change:
            self.share, self.pace = self.goal, 0.0
        else:
            self.share = min(max(self.share + step, 0.0), 1.0)


# The angle of each joint that takes part in a gaze, per angle of the gaze to the left and up.
Gains = Mapping[str, tuple[float, float]]
FOLLOW = 80.0  # 1/s
LIVE = "live"  # in place of the motion of a layer


class LiveJoint(Share):
    """A joint that follows values, with its limits of speed, rad/s, and acceleration, rad/s^2."""

    def __init__(self, speed: float, acceleration: float) -> None:
        super().__init__(goal=1.0, speed=speed, acceleration=acceleration, share=1.0)
        self.left = 0.0  # s until it falls back
        self._value = self._at = self._moving = 0.0  # g and x, rad, and x', rad/s
        self._shown: float | None = None  # its target of the last tick, rad
        self._shown_moving: float | None = None  # the speed of that, rad/s

    def follow(self, value: float, seconds: float) -> None:
        """Goes to a value, rad, and keeps to it for some seconds."""
        self._value, self.left = value, seconds
        if not self.goal:
            self._at, self._moving = self._shown or 0.0, self._shown_moving or 0.0
            self.goal = self.share = 1.0
            self.pace, self.farthest = 0.0, 1e-6

    def step(self, beneath: float, dt: float, *, still: bool) -> float:
        """Its target, rad, dt seconds later, over that beneath."""
        if self._shown is None:
            self._shown = beneath
            return beneath
        if self._shown_moving is None:
            self._at, self._moving = self._shown, (beneath - self._shown) / dt
        goal = self._at if still else self._value
        off, decay = self._at - goal, exp(-FOLLOW * dt)
        pull, way = self._moving + FOLLOW * off, self.speed * dt
        self._at += min(max(decay * (off + pull * dt) - off, -way), way)
        self._moving = min(max(decay * (self._moving - FOLLOW * pull * dt), -self.speed), self.speed)
        if not still:
            self.left -= dt
            if self.left <= SUMMED:
                self.goal = 0.0
        if not self.goal:
            self.approach(abs(self._at - beneath), dt, may_change=not still)
        shown = beneath + self.share * (self._at - beneath)
        self._shown, self._shown_moving = shown, (shown - self._shown) / dt
        return shown


class LiveValues:
    """The live values of joints; arguments as of `Layers`, with the indices of the joints of each group."""

    def __init__(
        self,
        names: Sequence[str],
        limits: JointLimits,
        groups: Mapping[str, NDArray[np.int64]],
        gaze: Gains,
        refused: Mapping[str, str],
    ) -> None:
        self._names, self._limits, self._groups, self._refused = names, limits, groups, refused
        self._gaze = {names.index(joint): gains for joint, gains in gaze.items()}
        self.joints: dict[int, LiveJoint] = {}  # those that follow values or fall back, by their index

    @property
    def following(self) -> dict[str, str]:
        """LIVE for each joint that follows values."""
        return {self._names[index]: LIVE for index, joint in self.joints.items() if joint.goal}

    def set(self, group: str, value: float, seconds: float) -> bool:
        """Gives the joints of a group a value: 0 for the angle 0, 1 for the upper and -1 for the lower limit.

        Whether one begins to follow. MotiondeckError for another value, or a robot that can have none.
        """
        if not -1.0 <= value <= 1.0:
            raise MotiondeckError(f"{group} goes from -1 (its lower limit) over 0 (its zero) to 1 (its upper limit)")
        indices, limits = self._groups[group], self._limits
        zero, end = np.clip(0.0, limits.lower, limits.upper), limits.upper if value > 0.0 else limits.lower
        values = (zero + abs(value) * (end - zero))[indices].tolist()
        return self._follow(dict(zip(indices.tolist(), values, strict=True)), seconds)

    def gaze(self, left: float, up: float, ahead: float, seconds: float) -> bool:
        """Looks at a point to the left, up and ahead of the eyes, m; returns and raises as `set`."""
        if not self._gaze:
            raise MotiondeckError("no joints are known to look with: name them in the rig file, under [gaze]")
        pan, tilt = atan2(left, ahead), atan2(up, hypot(left, ahead))
        return self._follow({index: one[0] * pan + one[1] * tilt for index, one in self._gaze.items()}, seconds)

    def check(self, indices: Iterable[int]) -> None:
        """MotiondeckError if nothing may be played over one of these joints."""
        for name in (self._names[index] for index in indices):
            if name in self._refused:
                raise MotiondeckError(self._refused[name])

    def end(self) -> None:
        """Has all joints fall back."""
        for joint in self.joints.values():
            joint.left = 0.0

    def _follow(self, values: Mapping[int, float], seconds: float) -> bool:
        self.check(values)
        limits, before = self._limits, len(self.following)
        for index, value in values.items():
            if index not in self.joints:
                self.joints[index] = LiveJoint(float(limits.velocity[index]), float(limits.acceleration[index]))
            self.joints[index].follow(float(min(max(value, limits.lower[index]), limits.upper[index])), seconds)
        return len(self.following) > before

    def __call__(self, targets: Array, dt: float, *, still: bool) -> Array:
        """Targets (J,), rad, dt seconds later, with the live values over these; held if the deck is to stand still."""
        mixed = targets.copy()
        for index, joint in [*self.joints.items()]:
            mixed[index] = joint.step(float(targets[index]), dt, still=still)
            if not joint.goal and joint.arrived:
                del self.joints[index]
        return mixed
