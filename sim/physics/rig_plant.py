"""A robot's body as the load of an emulated rig: emulated servos give torques, MuJoCo moves the joints.

Load, stall and fall show in the servos as current, heat and missed goals. Fits `hardware.emulator.bus.JointPlant`.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from sim.physics.physics_model import physics_model
from sim.robots.robot import Robot

_LONGEST_STEP = 0.002  # s


class RigPlant:
    """A robot driven by torques at some of its hinges, which start at 0; `model` and `data` are MuJoCo's."""

    def __init__(self, robot: Robot, joints: Sequence[str], root: str = "fixed") -> None:
        """Args: the robot; the hinges that the rig drives, in its order (others swing freely); a root of ROOTS.

        UnknownNameError if the robot lacks a joint. MotiondeckError if one is no hinge, or for another root.
        """
        self.model = model = physics_model(robot, root)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.data = mujoco.MjData(model)
        layout = robot.layout
        hinges = dict(zip(layout.hinge.tolist(), layout.hinge_qpos.tolist(), strict=True))
        places, velocities = [], []
        for index in UnknownNameError.indices("joint of this robot", joints, layout.joints):
            if index not in hinges:
                raise MotiondeckError(
                    f"joint {layout.joints[index]} of {robot.name} is no hinge, so no servo can drive it"
                )
            places.append(hinges[index])
            velocities.append(layout.dof[index])
        self._places, self._velocities = np.array(places), np.array(velocities)
        self.data.qpos[self._places] = 0.0
        mujoco.mj_forward(model, self.data)

    def advance(self, torques: Array, seconds: float) -> tuple[Array, Array]:
        """Advances time under torques (J,), N·m; returns angles (J,), rad, and velocities (J,), rad/s."""
        self.data.qfrc_applied[self._velocities] = torques
        steps = int(np.ceil(seconds / _LONGEST_STEP - 1e-9))
        if steps:
            self.model.opt.timestep = seconds / steps
            mujoco.mj_step(self.model, self.data, steps)
        return self.data.qpos[self._places], self.data.qvel[self._velocities]
