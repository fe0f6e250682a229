"""Footing: where the root of a robot goes so that its feet stand where they stand, neither in the floor nor above it.

A robot with other proportions than the human's slides and floats if its root just takes the human's path. Here

- the lowest point of its soles is as high above the floor as that of the human's soles, to scale, and nothing of it is
  ever below the floor: no fixed offset;
- what touches the floor stays where it is: the root goes back by as much as the touching points of the robot's skin
  would have gone on. Where nothing touches, the root takes the human's way, to scale.

The floor of the human is where its feet have been lowest of late, because recordings stand a few centimetres off.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np

from controller.mocap.anatomy import anatomy
from controller.mocap.posture import Pose
from controller.mocap.rest_pose import FOOT_SLOPE
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array, multiply, rotate
from sim.surface import Surface

# In lengths of the leg: how far a sole may seem to be off the floor and still stand on it, and how close to the floor a
# point of the skin touches it.
STANDS = 0.02
TOUCHES = 0.006
# The floor rises by this share a tick towards feet that stand a little above it, and sinks at once.
RISING, STEP = 0.002, 0.1
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

    def lowest(self, pose: Pose) -> float:
        """The height of the lowest point, m."""
        if not len(self._feet):
            return float(self._skeleton.joints(pose.root_position, pose.rotation)[:, 2].min())
        bones = rotate(pose.rotation[self._bones + 1], self._offset)
        ball = pose.root_position + self._chain @ bones
        foot = bones[self._at]
        # A foot that slopes down by FOOT_SLOPE is flat: then heel and ball are level.
        slope = np.arctan2(-foot[:, 2], np.sqrt(foot[:, 0] ** 2 + foot[:, 1] ** 2)) - FOOT_SLOPE
        flat = np.cos(FOOT_SLOPE) * self._length
        heel = ball[:, 2] + 1.25 * flat * np.sin(slope)
        return float(min(ball[:, 2].min(), heel.min()))


class Footing:
    """Places the root of one robot, tick by tick."""

    def __init__(
        self, skeleton: Skeleton, model: mujoco.MjModel, feet: list[int], root_rotation: Array, scale: float
    ) -> None:
        """Looks at the robot's skin.

        Args:
            skeleton: whose poses will come.
            model: the robot.
            feet: the bodies whose lowest point is that of the soles.
            root_rotation: of the root body while the robot stands upright and faces x, shape (4,).
            scale: the robot's size over the human's.
        """
        self._soles, self._leg = Soles(skeleton), max(skeleton.leg_length * scale, 1e-3)
        self._model, self._data = model, mujoco.MjData(model)
        self._turned, self._scale = root_rotation, scale
        self._surface = Surface.of(model)
        soles = np.isin(self._surface.body, feet)
        self._sole = soles if soles.any() else np.ones(len(soles), dtype=bool)
        self.reset()

    def reset(self) -> None:
        """Forgets where it was: the next pose stands where the human stands."""
        self._floor: float | None = None
        self._human = np.zeros(2)
        self._points = np.zeros((0, 3))
        self._root = np.zeros(2)

    def place(self, pose: Pose, qpos: Array) -> None:
        """Writes the root's position and rotation into qpos (nq,), whose joints are in place already."""
        qpos[3:7] = multiply(pose.rotation[0], self._turned)
        data = self._data
        data.qpos[:] = qpos
        data.qpos[:3] = 0.0
        mujoco.mj_kinematics(self._model, data)
        points = self._surface.positions(data)
        heights = points[:, 2] - self._surface.radius
        human = self._scale * pose.root_position[:2]

        low = self._scale * self._soles.lowest(pose)
        going = human - self._human
        if self._floor is None or going @ going > (TELEPORT * self._leg) ** 2:
            self._floor, self._root, self._human, self._points = low, human.copy(), human, points
            going = human - self._human
        above = low - self._floor
        if above < STEP * self._leg:
            self._floor += min(above, RISING * above)
        height = max(low - self._floor - STANDS * self._leg, 0.0) - float(heights[self._sole].min())
        height = max(height, -float(heights.min()))
        # What is nearest to the floor decides, whatever it is: soles, knees, hands.
        heights = heights + height
        weight = np.exp(-heights / (TOUCHES * self._leg))
        weight[heights > 6.0 * TOUCHES * self._leg] = 0.0
        touching = min(float(weight.max()), 1.0)
        if touching > 0.0:
            gone = weight @ (points - self._points)[:, :2] / weight.sum()
            going = (1.0 - touching) * going - touching * gone
        self._root = self._root + going
        self._human, self._points = human, points
        qpos[:2] = self._root
        qpos[2] = height
