"""Retargeting: from the pose of a human skeleton to the joints of a robot, one call a tick.

Both retargeters continue from their last answer where several are right; `reset()` clears it.
"""

from collections.abc import Mapping, Sequence
from math import atan2, cos, hypot, pi, remainder, sin, sqrt

import numpy as np

from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array, dot, to_rotation_vector
from controller.motion.skeleton import Pose, Skeleton
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.joint_layout import nearest_turn
from sim.models.robot_file import Angle
from sim.retargeting.arm_angles import UNCERTAIN, ThreeServoArm, Vector
from sim.retargeting.human_stance import FlatFeet
from sim.retargeting.robot_trunk import RobotTrunk

_ARM = ("shoulder_pitch", "shoulder_roll", "elbow")
_LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")
SERVO_HUMANOID_JOINTS = (
    "head_pan",
    "head_tilt",
    *(f"{side}_{joint}" for joints in (_ARM, _LEG) for side in ("r", "l") for joint in joints),
)
ARMS, LEGS = (2, 5), (8, 14)  # where the angles of the right and the left one begin

GAIN, SETTLE = 4.0, 4.0  # largest motion of an angle over that of its bones, and its largest additional rate, rad/s
FURTHEST = 1.3 * pi  # largest angle of a ball joint past a half turn, rad, before it is unwound
ROUNDING = 1e-9  # rad
CLOSE = 0.05  # rad from another pitch at which an arm has arrived there
PAUSE = 0.04  # s between trials of other pitches
WAIT = 0.6  # distance of a goal past the end of a range, rad, at which the joint goes the other way round


# conj(p) q = (left multiplication by conj(p)) q: where each entry of that 4 x 4 matrix sits in p, and its sign.
_ENTRY = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGN = np.array([[1.0, 1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, -1.0, 1.0]])


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
        from_parent = pose.rotation[self._parent][:, _ENTRY] * _SIGN
        relative = np.matmul(from_parent, pose.rotation[1:, :, None])[:, :, 0]
        shortest = to_rotation_vector(relative)
        wound = nearest_turn(shortest, self._last)
        # Wound up this far, a joint would stay at its limits for good.
        far = dot(wound, wound) > FURTHEST**2
        self._last = np.where(far[:, None], shortest, wound)
        return self._last.reshape(-1)


class ServoHumanoidRetargeter:
    """A pose as the angles of a humanoid with two servos at each shoulder, one at each elbow and six in each leg.

    The trunk is rigid; all angles are closed forms of bone directions. Near a
    singularity (the pitch of an arm held out sideways) an angle moves at most GAIN times as far as the bones of its
    limb, so that it never jumps.
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
        dt: float = 0.005,
        trunk: RobotTrunk | None = None,
    ) -> None:
        """Finds the limbs of a skeleton, and the joints of the angles among a robot's J joints with their ranges, rad.

        The angles map SERVO_HUMANOID_JOINTS to joints, by default of the same names; other joints stay at rest (J,),
        rad, by default zero; `flat` has the slopes of the human's feet; poses are dt seconds apart. FileFormatError if
        the skeleton lacks a limb, or no angles are given and the robot has other joints. UnknownNameError if there is
        no such angle or joint.
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
            UnknownNameError.check("angle", name, SERVO_HUMANOID_JOINTS, "angles: ")
            UnknownNameError.check("joint", angle.joint, joints, f"angles.{name}: ")
        self._trunk, self._flat = trunk or RobotTrunk(skeleton), flat
        self._angle = np.array([SERVO_HUMANOID_JOINTS.index(name) for name in angles], np.int64)
        self._joint = np.array([list(joints).index(angle.joint) for angle in angles.values()], np.int64)
        self._sign = np.array([float(angle.sign) for angle in angles.values()])
        self._zero = np.array([angle.zero for angle in angles.values()])
        ends = self._sign * (np.stack([lower, upper])[:, self._joint] - self._zero)
        low, high = np.zeros(len(SERVO_HUMANOID_JOINTS)), np.zeros(len(SERVO_HUMANOID_JOINTS))
        low[self._angle], high[self._angle] = ends.min(axis=0), ends.max(axis=0)
        self._limbs = LimbAngles(low, high, dt)
        self._same = len(joints) == len(low) == len(angles) and all(
            angles.get(name) == Angle(joint) for name, joint in zip(SERVO_HUMANOID_JOINTS, joints, strict=True)
        )
        self._targets = np.zeros(len(joints)) if rest is None else rest.copy()

    def reset(self) -> None:
        """Resets: the next pose is taken without a bound."""
        self._limbs.reset()

    @property
    def beyond(self) -> int:
        """Number of goals outside their joint's range since the last reset."""
        return self._limbs.beyond

    def __call__(self, pose: Pose) -> Array:
        """Targets (J,), rad, within the robot's range; overwritten by the next call."""
        directions = self._trunk(pose)
        if self._flat is not None:
            directions = self._flat(directions)
        angles = np.array(self._limbs(directions, self._trunk.pelvis[2].tolist()))
        if self._same:
            return angles
        self._targets[self._joint] = self._zero + self._sign * angles[self._angle]
        return self._targets


class LimbAngles:
    """The angles of SERVO_HUMANOID_JOINTS in closed form; `beyond` as of `ServoHumanoidRetargeter`."""

    def __init__(self, lower: Array, upper: Array, dt: float) -> None:
        """Args: their ranges, shape (20,), rad; seconds from pose to pose."""
        self._lower, self._upper = lower.tolist(), upper.tolist()
        self._dt, self._settle = dt, SETTLE * dt
        self._arms = {at: ThreeServoArm(self._lower[at : at + 3], self._upper[at : at + 3]) for at in ARMS}
        self.reset()

    def reset(self) -> None:
        """Resets: the next pose is taken without a bound."""
        self.beyond = 0
        self._direction: Array | None = None
        self._last = [0.0] * len(SERVO_HUMANOID_JOINTS)
        self._across: list[Vector] = [(0.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
        self._aims: dict[int, float] = {}  # of arms that go over to another solution: their pitch
        self._since_look: dict[int, float] = dict.fromkeys(ARMS, 0.0)  # s

    def __call__(self, direction: Array, up: Vector) -> list[float]:
        """The angles of SERVO_HUMANOID_JOINTS for limbs that point in the directions (18, 3), seen from the root."""
        self._started = self._direction is not None
        if self._direction is None:
            moved = [10.0] * len(direction)
        else:
            step = direction - self._direction
            moved = np.sqrt(np.add.reduce(step * step, axis=1)).tolist()
        self._direction = direction
        d = direction.tolist()
        angles = self._last.copy()
        x, y, z = d[10]  # the head pans and tilts towards the human's direction of view
        level = hypot(x, y)
        self._follow(angles, 0, (atan2(y, x), atan2(-z, level)), (moved[10], moved[10]), (level, 1.0))
        self._arm(angles, ARMS[0], d[0], d[1], moved[0], moved[1])
        self._arm(angles, ARMS[1], d[2], d[3], moved[2], moved[3])
        self._leg(angles, 0, d[4:7], up, max(moved[4:7]))
        self._leg(angles, 1, d[7:10], up, max(moved[7:10]))
        self._last = angles
        return angles

    def _arm(
        self, angles: list[float], joint: int, upper: Vector, fore: Vector, upper_moved: float, moved: float
    ) -> None:
        """Pitch, roll and elbow; the arm goes over to a much better pitch."""
        arm, most, aim = self._arms[joint], max(upper_moved, moved), self._aims.get(joint)
        if self._started:
            pitch = self._last[joint] if aim is None else aim
            goal, certain, elbow = arm.fit(upper, fore, pitch, self._last[joint + 2])
        else:
            goal, certain, elbow = arm.first(upper, fore)
        if aim is not None:
            self._follow(angles, joint, (goal,), (most,), (1.0,))
            self._aims[joint] = goal
            if abs(remainder(angles[joint] - goal, 2.0 * pi)) < CLOSE or angles[joint] == self._last[joint]:
                del self._aims[joint]
        elif certain >= UNCERTAIN:
            # The less pitch an arm has, the slower the pitch goes where it should.
            self._follow(angles, joint, (goal,), (min(2.0 * certain, 1.0) * most,), (certain,))
        roll, elbow = arm.at_pitch(upper, fore, angles[joint], elbow)
        self._follow(angles, joint + 1, (roll, elbow), (most, upper_moved + moved), (1.0, 1.0))
        self._since_look[joint] += self._dt
        if aim is None and self._since_look[joint] > PAUSE:
            self._since_look[joint] = 0.0
            other = arm.elsewhere(upper, fore, angles[joint], elbow)
            if other is not None:
                self._aims[joint] = other

    def _leg(self, angles: list[float], leg: int, limbs: Sequence[Vector], up: Vector, moved: float) -> None:
        """Thigh frame (x, y, z) = Rz(yaw) Rx(roll) Ry(pitch), with z up the thigh and y across the leg."""
        # A leg faces across the plane of its bent knee and that of its foot; both contain the shank.
        # By components, for speed.
        joint = LEGS[leg]
        (tx, ty, tz), (sx, sy, sz), (fx, fy, fz), (ux, uy, uz) = *limbs, up
        bx, by, bz = ty * sz - tz * sy, tz * sx - tx * sz, tx * sy - ty * sx
        x = 2.0 * bx + fy * sz - fz * sy
        y = 2.0 * by + fz * sx - fx * sz
        z = 2.0 * bz + fx * sy - fy * sx
        # A straight leg with pointed toes has no such plane, and keeps its last direction.
        ax, ay, az = self._across[leg]
        faint = max(0.5 - sqrt(x * x + y * y + z * z), 0.0)
        x, y, z = x + faint * ax, y + faint * ay, z + faint * az
        along = x * tx + y * ty + z * tz
        x, y, z = x - along * tx, y - along * ty, z - along * tz
        length = sqrt(x * x + y * y + z * z)
        if length > 1e-3:
            ax, ay, az = self._across[leg] = x / length, y / length, z / length
        # Ahead: z is -thigh, so y × z = thigh × y.
        x, y, z = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax

        level = hypot(ax, ay)
        knee = atan2(sqrt(bx * bx + by * by + bz * bz), tx * sx + ty * sy + tz * sz)
        goals = atan2(-ax, ay), atan2(az, level), atan2(-z, -tz), knee
        self._follow(angles, joint, goals, (moved,) * 4, (level, 1.0, level, 1.0))

        # In the plane of the leg the foot is pitched by knee and ankle together.
        pitch = atan2(fx * tx + fy * ty + fz * tz, fx * x + fy * y + fz * z)
        self._follow(angles, joint + 4, (pitch - angles[joint + 3] - FOOT_SLOPE,), (moved,), (1.0,))
        # The less the leg lies, the more the sole is kept level sideways.
        total = angles[joint + 3] + angles[joint + 4]
        # How far the sole's normal points up.
        sole_up = sin(total) * (x * ux + y * uy + z * uz) - cos(total) * (tx * ux + ty * uy + tz * uz)
        upright = max(-(sx * ux + sy * uy + sz * uz), 0.0) ** 2
        roll = atan2(-(ax * ux + ay * uy + az * uz), max(sole_up, 0.3))
        self._follow(angles, joint + 5, (upright * roll,), (moved,), (1.0,))

    def _follow(self, angles: list[float], joint: int, goals: Vector, moved: Vector, certain: Vector) -> None:
        """Moves angles from `joint` on towards their goals, the short way round, within range and pace."""
        for goal, fast, sure in zip(goals, moved, certain, strict=True):
            last, lower, upper = self._last[joint], self._lower[joint], self._upper[joint]
            if not -pi <= last - goal <= pi:
                goal += 2.0 * pi * round((last - goal) / (2.0 * pi))
            if not lower <= goal <= upper:
                # Past the end of its range a joint waits, unless its goal is in reach the other way round.
                other = goal - 2.0 * pi if goal > upper else goal + 2.0 * pi
                if (goal > upper + WAIT or goal < lower - WAIT) and lower <= other <= upper:
                    goal = other
                reached = min(max(goal, lower), upper)
                if abs(goal - reached) > ROUNDING and lower < upper:  # without a range no joint is there
                    self.beyond += 1
                goal = reached
            most = GAIN * fast + self._settle * sure
            angles[joint] = min(max(goal, last - most), last + most)  # a goal in reach is met to the last digit
            joint += 1
