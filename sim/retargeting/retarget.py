"""Retargeting: carries the pose of a human skeleton to the joints of a robot, one call a tick.

Both retargeters remember their last answer, so that where several answers are right they give the one next to it;
`reset()` forgets it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from controller.mocap.posture import Pose
from controller.mocap.rest_pose import FOOT_SLOPE
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array, dot, to_rotation_vector
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.joint_layout import nearest_turn
from sim.models.robot_file import Angle
from sim.retargeting.flat_feet import FlatFeet
from sim.retargeting.human_limbs import ENTRY, SIGN, LimbView, up_of

Vector = Sequence[float]

_ARM = ("shoulder_pitch", "shoulder_roll", "elbow")
_LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
SERVO_HUMANOID_JOINTS = (
    "head_pan",
    "head_tilt",
    *(f"{side}_{joint}" for joints in (_ARM, _LEG) for side in ("r", "l") for joint in joints),
)

# How much the forearm counts beside the upper arm, and in how many rounds the angles of an arm are found, in a tick and
# for the first pose.
FOREARM = 0.7
ROUNDS, FIRST_ROUNDS = 3, 40
# An angle may move this many times as far as the bones that lead it ...
GAIN = 4.0
# ... and settle by this much a tick besides, rad.
SETTLE = 0.02
# So far a ball joint is followed past a half turn, rad, before it is brought back by a whole one.
FURTHEST = 1.3 * pi
ROUNDING = 1e-9  # rad
# So far past the end of its range, rad, a joint waits for its goal to come back before it goes the other way round.
WAIT = 0.6


class MannequinRetargeter:
    """A pose as the rotation vectors of the mannequin's ball joints, each bone seen from its parent."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._parent = skeleton.parent + 1
        self._last = np.zeros((len(skeleton), 3))

    def reset(self) -> None:
        """Forgets the last pose."""
        self._last[:] = 0.0

    def __call__(self, pose: Pose) -> Array:
        """Targets (3 B,), rad; they follow a joint past a half turn without a jump, up to FURTHEST."""
        from_parent = pose.rotation[self._parent][:, ENTRY] * SIGN
        relative = np.matmul(from_parent, pose.rotation[1:, :, None])[:, :, 0]
        shortest = to_rotation_vector(relative)
        wound = nearest_turn(shortest, self._last)
        # Wound up so far, a joint is stopped by its limits; once it has got there it would stay there for good.
        far = dot(wound, wound) > FURTHEST**2
        self._last = np.where(far[:, None], shortest, wound)
        return self._last.reshape(-1)


class ServoHumanoidRetargeter:
    """A pose as the angles of a humanoid with two servos at each shoulder, one at each elbow and six in each leg.

    Arms are seen from the chest, legs from the pelvis; all angles are closed forms of bone directions. Where a
    direction says little about an angle (the pitch of an arm held out sideways, say), the angle may move at most GAIN
    times as far as the bones of its limb did, so that it never jumps; elsewhere the bound is out of its way.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        joints: Sequence[str],
        lower: Array,
        upper: Array,
        angles: Mapping[str, Angle] | None = None,
        rest: Array | None = None,
        flat: FlatFeet | None = None,
    ) -> None:
        """Finds the limbs, and the joints that turn as these angles do.

        Args:
            skeleton: whose poses will come.
            joints: the robot's J joints.
            lower, upper: their ranges, shape (J,), rad.
            angles: which of SERVO_HUMANOID_JOINTS is which joint; none where they have the same names.
            rest: where the joints stay that none of the angles is, shape (J,), rad; by default zero.
            flat: the slopes of the human's feet; none for feet that slope by FOOT_SLOPE when they are flat.

        Raises:
            FileFormatError: if the skeleton lacks a limb, or no angles are given and the robot has other joints.
            UnknownNameError: if there is no such angle or joint.
        """
        if not angles:
            missing = [name for name in SERVO_HUMANOID_JOINTS if name not in joints]
            if missing:
                raise FileFormatError(
                    f"the angle solver needs a joint '{missing[0]}' (of {', '.join(SERVO_HUMANOID_JOINTS)}), or a "
                    "table [angles] that says which joint turns like it. Otherwise use the other solver, 'ik'."
                )
            angles = {name: Angle(name) for name in SERVO_HUMANOID_JOINTS}
        for name, angle in angles.items():
            if name not in SERVO_HUMANOID_JOINTS:
                raise UnknownNameError(f"angles: {UnknownNameError.among('angle', name, SERVO_HUMANOID_JOINTS)}")
            if angle.joint not in joints:
                raise UnknownNameError(f"angles.{name}: {UnknownNameError.among('joint', angle.joint, joints)}")
        self._view, self._flat = LimbView(skeleton), flat
        self._angle = np.array([SERVO_HUMANOID_JOINTS.index(name) for name in angles], np.int64)
        self._joint = np.array([list(joints).index(angle.joint) for angle in angles.values()], np.int64)
        self._sign = np.array([float(angle.sign) for angle in angles.values()])
        self._zero = np.array([angle.zero for angle in angles.values()])
        ends = self._sign * (np.stack([lower, upper])[:, self._joint] - self._zero)
        low, high = np.zeros(len(SERVO_HUMANOID_JOINTS)), np.zeros(len(SERVO_HUMANOID_JOINTS))
        low[self._angle], high[self._angle] = ends.min(axis=0), ends.max(axis=0)
        self._limbs = LimbAngles(low, high)
        # A robot whose joints are these angles, one by one, gets them as they are.
        self._same = len(joints) == len(low) == len(angles) and all(
            angles.get(name) == Angle(joint) for name, joint in zip(SERVO_HUMANOID_JOINTS, joints, strict=True)
        )
        self._targets = np.zeros(len(joints)) if rest is None else rest.copy()

    def reset(self) -> None:
        """Forgets the last pose: the next one is taken as it comes."""
        self._limbs.reset()

    @property
    def beyond(self) -> int:
        """How many goals lay outside their joint's range since the last reset, one a joint and pose."""
        return self._limbs.beyond

    def __call__(self, pose: Pose) -> Array:
        """Targets (J,), rad, within the robot's range; overwritten by the next call."""
        directions = self._view(pose)
        if self._flat is not None:
            directions = self._flat(directions)
        angles = np.array(self._limbs(directions, up_of(pose)))
        if self._same:
            return angles
        self._targets[self._joint] = self._zero + self._sign * angles[self._angle]
        return self._targets


class LimbAngles:
    """The angles of SERVO_HUMANOID_JOINTS in closed form.

    Attributes:
        beyond: how many goals lay outside their joint's range since the last reset.
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        """Args: their ranges, shape (20,), rad."""
        self._lower, self._upper = lower.tolist(), upper.tolist()
        self.reset()

    def reset(self) -> None:
        """Forgets the last pose: the next one is taken as it comes."""
        self.beyond = 0
        self._direction: Array | None = None
        self._last = [0.0] * len(SERVO_HUMANOID_JOINTS)
        self._across: list[Vector] = [(0.0, 1.0, 0.0), (0.0, 1.0, 0.0)]

    def __call__(self, direction: Array, up: Vector) -> list[float]:
        """The angles of SERVO_HUMANOID_JOINTS for limbs that point in the directions (14, 3), seen from the root."""
        self._started = self._direction is not None
        if self._direction is None:
            moved = [10.0] * len(direction)
        else:
            step = direction - self._direction
            moved = np.sqrt(np.add.reduce(step * step, axis=1)).tolist()
        self._direction = direction
        d = direction.tolist()
        angles = self._last.copy()
        self._head(angles, d[10], moved[10])
        self._arm(angles, 2, d[0], d[1], moved[0], moved[1])
        self._arm(angles, 5, d[2], d[3], moved[2], moved[3])
        self._leg(angles, 8, 0, d[4], d[5], d[6], up, max(moved[4:7]))
        self._leg(angles, 14, 1, d[7], d[8], d[9], up, max(moved[7:10]))
        self._last = angles
        return angles

    def _head(self, angles: list[float], ahead: Vector, moved: float) -> None:
        """Pan and tilt so that the face looks ahead as the human's does."""
        level = hypot(ahead[0], ahead[1])
        self._follow(angles, 0, atan2(ahead[1], ahead[0]), moved, level)
        self._follow(angles, 1, atan2(-ahead[2], level), moved, 1.0)

    def _arm(
        self, angles: list[float], joint: int, upper: Vector, fore: Vector, upper_moved: float, moved: float
    ) -> None:
        """Upper arm = Ry(pitch) Rx(roll) (0, 0, -1), forearm = Ry(pitch) Rx(roll) (sin elbow, 0, -cos elbow).

        Three servos cannot give four angles of directions: without a turn about the upper arm, the forearm bends ahead
        only. So the angles are those that bring both as close as can be: the greatest of

            upper . Ry(pitch) Rx(roll) (0, 0, -1) + FOREARM fore . Ry(pitch) Rx(roll) (sin elbow, 0, -cos elbow)

        found from the last ones on, each angle in turn by its closed form.
        """
        x, _, z = upper
        fx, _, fz = fore
        pitch, elbow = self._last[joint], self._last[joint + 2]
        low, high = self._lower[joint + 1], self._upper[joint + 1]
        if not self._started:
            # An elbow bends in the plane that faces ahead along Ry(pitch) (1, 0, 0).
            along = _dot(upper, fore)
            pitch = atan2(-x - FOREARM * (fz - along * z), -z + FOREARM * (fx - along * x))
            elbow = _angle_between(upper, fore)
        certain = 0.0
        for _ in range(ROUNDS if self._started else FIRST_ROUNDS):
            roll, elbow = self._roll_and_elbow(pitch, elbow, upper, fore, low, high)
            upper_down = -cos(roll)
            ahead, down = sin(elbow), cos(elbow) * upper_down
            sine = upper_down * x + FOREARM * (down * fx - ahead * fz)
            cosine = upper_down * z + FOREARM * (down * fz + ahead * fx)
            certain = min(hypot(sine, cosine), 1.0)
            if certain < 1e-3:
                break
            pitch = atan2(sine, cosine)
        # An arm stretched out sideways has no pitch: the less it has, the slower the pitch goes where it should.
        most = max(upper_moved, moved)
        if certain > 1e-3:
            self._follow(angles, joint, pitch, min(2.0 * certain, 1.0) * most, certain)
        roll, elbow = self._roll_and_elbow(angles[joint], elbow, upper, fore, low, high)
        self._follow(angles, joint + 1, roll, most, 1.0)
        self._follow(angles, joint + 2, elbow, upper_moved + moved, 1.0)

    def _roll_and_elbow(
        self, pitch: float, elbow: float, upper: Vector, fore: Vector, low: float, high: float
    ) -> tuple[float, float]:
        """The roll, within its range, then the elbow that bring an arm closest at a pitch, from an elbow on."""
        c, s = cos(pitch), sin(pitch)
        (x, y, z), (fx, fy, fz) = upper, fore
        fore_ahead, fore_up = c * fx - s * fz, s * fx + c * fz
        share = FOREARM * cos(elbow)
        roll = atan2(y + share * fy, max(-(s * x + c * z) - share * fore_up, 0.5 * hypot(x, z)))
        roll = min(max(roll, low), high)
        return roll, atan2(fore_ahead, sin(roll) * fy - cos(roll) * fore_up)

    def _leg(
        self,
        angles: list[float],
        joint: int,
        leg: int,
        thigh: Vector,
        shank: Vector,
        foot: Vector,
        up: Vector,
        moved: float,
    ) -> None:
        """Thigh frame (x, y, z) = Rz(yaw) Rx(roll) Ry(pitch), with z up the thigh and y across the leg."""
        # Two planes tell which way a leg faces: that of the bent knee and that of the foot; both contain the shank.
        # Written out by components, as this is done for each leg in each tick.
        (bx, by, bz), (sx, sy, sz), (mx, my, mz) = _cross(thigh, shank), _cross(foot, shank), self._across[leg]
        tx, ty, tz = thigh
        x, y, z = 2.0 * bx + sx, 2.0 * by + sy, 2.0 * bz + sz
        # A straight leg with its toes pointed faces nowhere: then it keeps facing where it did.
        faint = max(0.5 - sqrt(x * x + y * y + z * z), 0.0)
        x, y, z = x + faint * mx, y + faint * my, z + faint * mz
        along = x * tx + y * ty + z * tz
        x, y, z = x - along * tx, y - along * ty, z - along * tz
        length = sqrt(x * x + y * y + z * z)
        if length > 1e-3:
            self._across[leg] = x / length, y / length, z / length
        across = self._across[leg]
        ahead = _cross(thigh, across)  # z is -thigh, so y × z = thigh × y

        level = hypot(across[0], across[1])
        self._follow(angles, joint, atan2(-across[0], across[1]), moved, level)
        self._follow(angles, joint + 1, atan2(across[2], level), moved, 1.0)
        self._follow(angles, joint + 2, atan2(-ahead[2], -thigh[2]), moved, level)
        self._follow(angles, joint + 3, _angle_between(thigh, shank), moved, 1.0)

        # In the plane of the leg the foot is pitched by knee and ankle together.
        pitch = atan2(_dot(foot, thigh), _dot(foot, ahead))
        self._follow(angles, joint + 4, pitch - angles[joint + 3] - FOOT_SLOPE, moved, 1.0)
        # The less the leg lies, the more the sole is kept level sideways.
        total = angles[joint + 3] + angles[joint + 4]
        sole_up = sin(total) * _dot(ahead, up) - cos(total) * _dot(thigh, up)  # how far the sole's normal points up
        upright = max(-_dot(shank, up), 0.0) ** 2
        roll = atan2(-_dot(across, up), max(sole_up, 0.3))
        self._follow(angles, joint + 5, upright * roll, moved, 1.0)

    def _follow(self, angles: list[float], joint: int, goal: float, moved: float, certain: float) -> None:
        """Moves one angle towards its goal, the near way round, within its range and its pace."""
        last, lower, upper = self._last[joint], self._lower[joint], self._upper[joint]
        if not -pi <= last - goal <= pi:
            goal += 2.0 * pi * round((last - goal) / (2.0 * pi))
        if not lower <= goal <= upper:
            # Past the end of its range a joint waits there, but not if the goal can be reached from the other side.
            other = goal - 2.0 * pi if goal > upper else goal + 2.0 * pi
            if (goal > upper + WAIT or goal < lower - WAIT) and lower <= other <= upper:
                goal = other
            reached = min(max(goal, lower), upper)
            if abs(goal - reached) > ROUNDING and lower < upper:  # without a range it is of a joint that is not there
                self.beyond += 1
            goal = reached
        most = GAIN * moved + SETTLE * certain
        angles[joint] = min(max(goal, last - most), last + most)  # a goal in reach is met to the last digit


def _dot(a: Vector, b: Vector) -> float:
    ax, ay, az = a
    bx, by, bz = b
    return ax * bx + ay * by + az * bz


def _cross(a: Vector, b: Vector) -> tuple[float, float, float]:
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def _angle_between(a: Vector, b: Vector) -> float:
    x, y, z = _cross(a, b)
    return atan2(sqrt(x * x + y * y + z * z), _dot(a, b))
