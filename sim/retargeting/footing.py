"""Footing: where the root of a robot goes so that its feet stand where they stand, neither in the floor nor above it.

A robot with other proportions than the human's slides and floats if its root just takes the human's path. Here

- the lowest point of its soles is as high above the floor as that of the human's soles, to scale, and nothing of it is
  ever below the floor: no fixed offset;
- what stands stays where it is: the root goes back by as much as the touching points of the robot's skin would have
  gone on, those of a foot counting as far as the human's foot is still. Where nothing touches, or slides on purpose,
  the root takes the human's way, to scale.

The floor of the human is where its still foot is, because recordings stand a few centimetres off and even drift.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.mocap.anatomy import anatomy
from controller.mocap.posture import Pose
from controller.mocap.rest_pose import FOOT_SLOPE
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array, multiply, rotate
from sim.models.kinematic_tree import below
from sim.models.surface import LowestPoint, Surface

# In lengths of the leg: how far a sole may seem to be off the floor and still stand on it, and how close to the floor a
# point of the skin touches it.
STANDS = 0.02
TOUCHES = 0.006
# A foot is still if its ball is slower than this, in lengths of the leg a second. Hands and knees, whose stillness is
# not looked at, count as much as a foot of such a share.
STILL = 0.2
OTHERS = 0.2
# So fast the floor follows a still foot upwards, 1/s; down it follows any foot at once.
FOLLOWS = 15.0
TELEPORT = 0.3  # lengths of the leg in one tick: nobody walked there


class Soles:
    """The lowest points of a human's feet: heel and ball of each.

    A skeleton without feet stands on the lowest of its joints.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        parts = anatomy(skeleton)
        self._feet = np.array(
            [foot for side in ("right", "left") if (foot := parts.first("foot", side)) is not None], dtype=np.int64
        )
        on_way = np.flatnonzero(skeleton.chain[self._feet].any(axis=0)) if len(self._feet) else np.arange(0)
        self._bones = on_way
        self._offset = (skeleton.rest_direction * skeleton.length[:, None])[on_way]
        self._chain = skeleton.chain[np.ix_(self._feet, on_way)]
        self._at = np.searchsorted(on_way, self._feet)
        self._length = skeleton.length[self._feet]

    def __call__(self, pose: Pose) -> tuple[Array, Array]:
        """Where the balls of the F feet are, shape (F, 3), and how high each foot's lowest point is, shape (F,), m."""
        if not len(self._feet):
            joints = self._skeleton.joints(pose.root_position, pose.rotation)
            lowest = joints[[np.argmin(joints[:, 2])]]
            return lowest, lowest[:, 2]
        bones = rotate(pose.rotation[self._bones + 1], self._offset)
        ball = pose.root_position + self._chain @ bones
        foot = bones[self._at]
        # A foot that slopes down by FOOT_SLOPE is flat: then heel and ball are level.
        slope = np.arctan2(-foot[:, 2], np.sqrt(foot[:, 0] ** 2 + foot[:, 1] ** 2)) - FOOT_SLOPE
        heel = ball[:, 2] + 1.25 * np.cos(FOOT_SLOPE) * self._length * np.sin(slope)
        return ball, np.minimum(ball[:, 2], heel)


class Footing:
    """Places the root of one robot, tick by tick."""

    def __init__(
        self,
        skeleton: Skeleton,
        model: mujoco.MjModel,
        feet: Sequence[int],
        root_rotation: Array,
        scale: float,
        dt: float,
    ) -> None:
        """Looks at the robot's skin.

        Args:
            skeleton: whose poses will come.
            model: the robot.
            feet: the bodies that are its right and left foot; none for a robot without feet.
            root_rotation: of the root body while the robot stands upright and faces x, shape (4,).
            scale: the robot's size over the human's.
            dt: seconds from one pose to the next.
        """
        self._soles, self._leg = Soles(skeleton), max(skeleton.leg_length * scale, 1e-3)
        self._model, self._data = model, mujoco.MjData(model)
        self._turned, self._scale, self._dt = root_rotation, scale, dt
        self._surface, self._lowest = Surface.of(model), LowestPoint(model)
        self._foot_of = np.full(len(self._surface.body), -1)
        for side, foot in enumerate(feet):
            self._foot_of[np.isin(self._surface.body, below(model, foot))] = side
        self._sole = self._foot_of >= 0
        if not self._sole.any():  # no feet, or none that has solids
            self._sole[:] = True
        self.reset()

    def reset(self, dt: float | None = None) -> None:
        """Forgets where it was: the next pose stands where the human stands.

        Args:
            dt: seconds from one pose to the next from now on; as before by itself.
        """
        self._dt = dt or self._dt
        self._floor: float | None = None
        self._human = self._root = np.zeros(2)
        self._balls = self._points = np.zeros((0, 3))

    def place(self, pose: Pose, qpos: Array) -> None:
        """Writes the root's position and rotation into qpos (nq,), whose joints are in place already."""
        qpos[3:7] = multiply(pose.rotation[0], self._turned)
        if len(pose.rotation) == 1:
            # Of a run recorded by version 1 only the human's root is known: the robot goes along its path.
            qpos[:3] = self._scale * pose.root_position
            return
        data = self._data
        data.qpos[:] = qpos
        data.qpos[:3] = 0.0
        mujoco.mj_kinematics(self._model, data)
        points = self._surface.positions(data)
        heights = points[:, 2] - self._surface.radius
        human = self._scale * pose.root_position[:2]
        balls, lows = self._soles(pose)
        balls, low = self._scale * balls, self._scale * float(lows.min())

        going = human - self._human
        if self._floor is None or going @ going > (TELEPORT * self._leg) ** 2:
            self._floor, self._root, self._human = low, human.copy(), human
            self._points, self._balls = points, balls
            going = np.zeros(2)
        speed = np.sqrt(np.einsum("ij,ij->i", balls - self._balls, balls - self._balls)) / (self._dt * self._leg)
        still = 1.0 / (1.0 + (speed / STILL) ** 4)
        rise = low - self._floor
        self._floor += rise if rise < 0.0 else rise * float(still[np.argmin(lows)]) * min(FOLLOWS * self._dt, 1.0)

        height = max(low - self._floor - STANDS * self._leg, 0.0) - float(heights[self._sole].min())
        height = max(height, -self._lowest(data))
        # What is nearest to the floor decides, whatever it is: soles, knees, hands.
        weight = np.exp(-(heights + height) / (TOUCHES * self._leg))
        weight *= np.append(still, OTHERS)[self._foot_of] if len(still) == 2 else OTHERS
        touching = float(weight.max())
        weight = weight**2
        if touching > 1e-6:
            gone = weight @ (points - self._points)[:, :2] / weight.sum()
            going = (1.0 - touching) * going - touching * gone
        self._root = self._root + going
        self._human, self._points, self._balls = human, points, balls
        qpos[:2] = self._root
        qpos[2] = height
