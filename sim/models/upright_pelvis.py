"""The pelvis as the frame of a robot whose file may have the free root at the trunk, above a waist."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array, conjugate, multiply
from sim.models.kinematic_tree import hinges_between

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class UprightPelvis:
    """Turns the root of a robot so that its pelvis has a rotation.

    Attributes:
        below_a_waist: whether hinges turn the pelvis against the root.
        above_root: height of the standing pelvis above the root, m; 0 if it is not below a waist.
    """

    def __init__(self, model: mujoco.MjModel, pelvis: int, root_rotation: Array) -> None:
        """Args: the robot; its pelvis; the rotation (4,) of the root body that stands upright and faces x."""
        self._model, self._pelvis, self._root = model, pelvis, root_rotation
        root = int(model.jnt_bodyid[0])
        self.below_a_waist = pelvis != root and bool(hinges_between(model, root, pelvis))
        data = mujoco.MjData(model)
        data.qpos[3:7] = root_rotation
        mujoco.mj_kinematics(model, data)
        self._standing = data.xquat[pelvis].copy()
        self.above_root = float(data.xpos[pelvis, 2] - data.xpos[root, 2]) if self.below_a_waist else 0.0

    def place(self, data: mujoco.MjData, turned: Array = UPRIGHT) -> None:
        """Computes the kinematics with the pelvis turned (4,) from upright; joints stay."""
        data.qpos[3:7] = multiply(turned, self._root)
        mujoco.mj_kinematics(self._model, data)
        if self.below_a_waist:
            now = data.xquat[self._pelvis]
            data.qpos[3:7] = multiply(multiply(multiply(turned, self._standing), conjugate(now)), data.qpos[3:7])
            mujoco.mj_kinematics(self._model, data)
