"""The trunk of a robot beside a human's: how its pelvis is turned, and what its waist can make of the human's bend.

The line from the middle of the robot's hips to that of its shoulders points as the human's. Of the human's bend
between pelvis and chest the waist takes what its hinges can, by axis and range; the pelvis takes the rest, and the legs
with it: a robot whose waist cannot pitch bends in its hips. Where these are at the end of their range, trunk and thighs
share what is missing.
"""

from dataclasses import dataclass
from math import atan2, cos, inf, sin, sqrt

import mujoco
import numpy as np

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton
from sim.retargeting.human_limbs import LIMBS, LimbView

TRUNK_SHARE = 0.5  # of what hips cannot bend, the share that the trunk is off; the thighs are off by the rest
_CHEST, _PELVIS = LIMBS.index("chest_ahead"), LIMBS.index("pelvis_ahead")
_RIGHT, _LEFT = LIMBS.index("r_thigh"), LIMBS.index("l_thigh")
STRAIGHT, UP = np.eye(3), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Waist:
    """The n hinges between pelvis and chest of a robot that stands straight and faces x."""

    axes: Array  # shape (n, 3)
    lower: Array  # from standing, shape (n,), rad
    upper: Array
    below: Array  # from the middle of the hips to the waist, shape (3,), m
    above: Array  # from there to the middle of the shoulders, shape (3,), m
    hips: float = inf  # how far the thighs can be raised ahead, from straight down, rad


STIFF = Waist(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(3), UP)


class RobotTrunk:
    """Limbs of one skeleton as one robot's pelvis sees them, shared by its retargeter and its footing."""

    def __init__(self, skeleton: Skeleton, waist: Waist = STIFF) -> None:
        self.view, self._waist = LimbView(skeleton), waist
        self._angles = np.linalg.pinv(waist.axes.T) if len(waist.axes) else np.zeros((0, 3))
        # The pelvis seen from the human's chest, where a trunk is rigid.
        self._upright = _swing((waist.below + waist.above).tolist(), UP.tolist())
        self._pose: Pose | None = None
        self.pelvis = np.eye(3)  # its rotation at the last call, shape (3, 3)

    def __call__(self, pose: Pose) -> Array:
        """The directions of LIMBS seen from the robot's pelvis, shape (18, 3); the chest as the waist can turn it."""
        self._pose, waist = pose, self._waist
        world = self.view(pose)
        chest, bend = _frame(world[_CHEST : _CHEST + 2]), STRAIGHT
        if len(waist.axes):
            bend = self._bend(_frame(world[_PELVIS : _PELVIS + 2]).T @ chest)
            pelvis = chest @ bend.T
            line = pelvis @ (waist.below + bend @ waist.above)
            self.pelvis = _swing(line.tolist(), chest[:, 2].tolist()) @ pelvis
        else:
            self.pelvis = chest @ self._upright
        seen = world @ self.pelvis
        # How far a thigh is raised ahead beyond its reach, rad, at most; less, the more it is raised sideways.
        (rx, _, rz), (lx, _, lz) = seen[_RIGHT].tolist(), seen[_LEFT].tolist()
        right, left = atan2(rx, -rz) - waist.hips, atan2(lx, -lz) - waist.hips
        missing = max((rx * rx + rz * rz) * right, (lx * lx + lz * lz) * left)
        if missing > 0.0:
            self.pelvis = self.pelvis @ turned_by([0.0, -TRUNK_SHARE * missing, 0.0])
            seen = world @ self.pelvis
        seen[_CHEST], seen[_CHEST + 1] = bend[:, 0], bend[:, 1]
        return seen

    def _bend(self, chest: Array) -> Array:
        """What the waist's hinges, within their ranges, make of a chest's rotation over the pelvis, shape (3, 3)."""
        angles = self._angles @ vector_of(chest.tolist())
        angles = np.minimum(np.maximum(angles, self._waist.lower), self._waist.upper)
        return turned_by((angles @ self._waist.axes).tolist())

    def rotation(self, pose: Pose) -> Array:
        """The rotation of the robot's pelvis in a pose, shape (4,); of a pose just retargeted as it was then."""
        if pose is not self._pose:
            self(pose)
        self._pose = None
        turned = np.empty(4)
        mujoco.mju_mat2Quat(turned, self.pelvis.ravel())
        return -turned if turned @ pose.rotation[0] < 0.0 else turned


class UprightTrunk(RobotTrunk):
    """The same of a robot without legs: its pelvis stays upright, and of the human's lean it has what its waist can."""

    def __call__(self, pose: Pose) -> Array:
        """The directions of LIMBS seen from a pelvis that faces as the human does, shape (18, 3)."""
        self._pose, bend = pose, STRAIGHT
        world = self.view(pose)
        self.pelvis = turned_by([0.0, 0.0, facing(world)])
        seen = world @ self.pelvis
        if len(self._waist.axes):
            bend = self._bend(_frame(seen[_CHEST : _CHEST + 2]))
        seen[_CHEST], seen[_CHEST + 1] = bend[:, 0], bend[:, 1]
        return seen


def facing(lines: Array) -> float:
    """Where a human with these LIMBS in the world (18, 3) faces, about z from x, rad: between pelvis and chest."""
    x, y, _ = (lines[_CHEST + 1] + lines[_PELVIS + 1]).tolist()
    return atan2(-x, y)


# By components, for speed.


def _frame(rows: Array) -> Array:
    """The matrix whose columns are ahead, left and up, for the first two as rows (2, 3)."""
    (ax, ay, az), (lx, ly, lz) = rows.tolist()
    return np.array([[ax, lx, ay * lz - az * ly], [ay, ly, az * lx - ax * lz], [az, lz, ax * ly - ay * lx]])


def vector_of(m: list[list[float]]) -> Array:
    """The rotation vector (3,) of a matrix that turns by less than half a turn."""
    x, y, z = 0.5 * (m[2][1] - m[1][2]), 0.5 * (m[0][2] - m[2][0]), 0.5 * (m[1][0] - m[0][1])
    sine = sqrt(x * x + y * y + z * z)
    angle = atan2(sine, 0.5 * (m[0][0] + m[1][1] + m[2][2] - 1.0))
    share = angle / sine if sine > 1e-9 else 1.0
    return np.array([share * x, share * y, share * z])


def turned_by(v: list[float]) -> Array:
    """The matrix of a rotation vector."""
    angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if angle < 1e-9:
        return STRAIGHT
    x, y, z = v[0] / angle, v[1] / angle, v[2] / angle
    c, s = cos(angle), sin(angle)
    k = 1.0 - c
    first = c + k * x * x, k * x * y - s * z, k * x * z + s * y
    second = k * x * y + s * z, c + k * y * y, k * y * z - s * x
    return np.array([first, second, (k * x * z - s * y, k * y * z + s * x, c + k * z * z)])


def _swing(line: list[float], goal: list[float]) -> Array:
    """The least rotation, as a matrix, of a line's direction onto a unit vector."""
    (a, b, c), (u, v, w) = line, goal
    x, y, z = b * w - c * v, c * u - a * w, a * v - b * u
    sine = sqrt(x * x + y * y + z * z)
    if sine < 1e-12:
        return STRAIGHT
    angle = atan2(sine, a * u + b * v + c * w) / sine
    return turned_by([angle * x, angle * y, angle * z])
