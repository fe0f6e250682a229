"""Kinematic playback: an output that shows joint targets on a MuJoCo robot exactly."""

from collections.abc import Mapping

import mujoco

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from sim.robots.robot import Robot


class KinematicPlayback:
    """Puts the robot exactly at its targets."""

    name = "kinematics"
    behind_s = 0.0  # delay of the body, s

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.data = mujoco.MjData(robot.model)
        self.qpos = self.data.qpos  # shape (nq,), which the next write overwrites
        robot.layout.place(robot.rest, self.qpos)
        mujoco.mj_kinematics(robot.model, self.data)
        self._measured = robot.rest.copy()
        self._writes = 0
        self.placed = self.qpos[:7].copy()  # the commanded root of the last write, position (m) and quaternion

    def write(self, targets: Array, pose: Pose) -> None:
        """Places the joints at targets (J,), rad, and the root where the pose has it."""
        self._robot.place(targets, pose, self.qpos)
        mujoco.mj_kinematics(self._robot.model, self.data)
        self.placed[:] = self.qpos[:7]
        self._measured[:] = targets
        self._writes += 1

    def measured(self) -> Array:
        """The joint positions (J,), rad: what was written last."""
        return self._measured

    def report(self) -> Mapping[str, object]:
        """Its kind and the number of writes."""
        return {"kind": "kinematics", "robot": self._robot.name, "joints": len(self._measured), "writes": self._writes}

    def close(self) -> None:
        """Does nothing."""
