"""The pelvis: a robot is held and seen by it, though its file may have the free root at the trunk, above a waist."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array, conjugate, multiply
from sim.models.kinematic_tree import hinges_between

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


class UprightPelvis:
    """Turns the root of a robot so that its pelvis is turned as it should be.

    Attributes:
        below_a_waist: whether hinges turn the pelvis against the root.
        above_root: how much higher than the root the pelvis is while the robot stands, m; 0 if it is not below a waist.
    """

    def __init__(self, model: mujoco.MjModel, pelvis: int, root_rotation: Array) -> None:
        """Looks at what lies between.

        Args:
            model: the robot.
            pelvis: the body that is its pelvis.
            root_rotation: of the root body while the robot stands upright and faces x, shape (4,).
        """
        self._model, self._pelvis, self._root = model, pelvis, root_rotation
        root = int(model.jnt_bodyid[0])
        # Where nothing turns one against the other, the root is turned as well as the pelvis.
        self.below_a_waist = pelvis != root and bool(hinges_between(model, root, pelvis))
        data = mujoco.MjData(model)
        data.qpos[3:7] = root_rotation
        mujoco.mj_kinematics(model, data)
        self._standing = data.xquat[pelvis].copy()
        self.above_root = float(data.xpos[pelvis, 2] - data.xpos[root, 2]) if self.below_a_waist else 0.0

    def place(self, data: mujoco.MjData, turned: Array = UPRIGHT) -> None:
        """Works out the kinematics of a robot whose pelvis is turned (4,) from where it stands upright; joints stay."""
        data.qpos[3:7] = multiply(turned, self._root)
        mujoco.mj_kinematics(self._model, data)
        if self.below_a_waist:
            now = data.xquat[self._pelvis]
            data.qpos[3:7] = multiply(multiply(multiply(turned, self._standing), conjugate(now)), data.qpos[3:7])
            mujoco.mj_kinematics(self._model, data)
