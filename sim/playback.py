"""Playback: outputs that show joint targets on a MuJoCo robot, either exactly or through its servos and its masses."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from controller.mocap.posture import Pose
from controller.rotations import Array, conjugate, multiply, to_rotation_vector
from sim.robot import Robot

# MuJoCo starts afresh by itself when its state breaks, and leaves a note.
_BROKEN = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class KinematicPlayback:
    """Puts the robot exactly where it is told to be.

    Attributes:
        name: "kinematics".
        data: MuJoCo's state, with the position of every body.
    """

    name = "kinematics"

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.data = mujoco.MjData(robot.model)
        robot.layout.place(robot.rest, self.data.qpos)
        mujoco.mj_kinematics(robot.model, self.data)
        self._measured = robot.rest.copy()
        self._writes = 0

    @property
    def qpos(self) -> Array:
        """Where the robot is, shape (nq,): MuJoCo's own array, so copy what you keep."""
        return self.data.qpos

    def write(self, targets: Array, pose: Pose) -> None:
        """Places the joints at targets (J,), rad, and the root where the pose has it."""
        self._robot.place(targets, pose, self.data.qpos)
        mujoco.mj_kinematics(self._robot.model, self.data)
        self._measured[:] = targets
        self._writes += 1

    def measured(self) -> Array:
        """The joint positions (J,), rad: what was written last."""
        return self._measured

    def report(self) -> Mapping[str, object]:
        """What it is and how often it was written to."""
        return {"kind": "kinematics", "robot": self._robot.name, "joints": len(self._measured), "writes": self._writes}

    def close(self) -> None:
        """Nothing to let go of."""


class PhysicsPlayback:
    """Drives the robot's servos towards the targets while a gantry carries its root along the pose's path.

    A servo pushes with  kp (target - position) + kv (rate of target - velocity): the rate is fed forward, or a motion
    would trail by kv / kp. On a ball joint "target - position" is the rotation from the one to the other.

    Attributes:
        name: "physics".
        data: MuJoCo's state.
    """

    name = "physics"

    def __init__(self, robot: Robot, dt: float) -> None:
        """Rests the robot.

        Args:
            robot: whom to drive.
            dt: how much time passes with each write, s; rounded to whole steps of the simulation.
        """
        self._robot, model = robot, robot.model
        self.data = mujoco.MjData(model)
        self._steps = max(1, round(dt / model.opt.timestep))
        self._dt = self._steps * model.opt.timestep
        # Position servos: force = gain * ctrl + bias . (1, length, velocity), with gain = kp and bias[2] = -kv.
        gain = model.actuator_gainprm[:, 0]
        self._lead = -model.actuator_biasprm[:, 2] / np.where(gain > 0.0, gain, 1.0)
        self._goal = np.empty(model.nq)
        self._goal_before = np.empty(model.nq)
        self._measured = robot.rest.copy()
        self._started = False
        self._writes = self._faults = 0
        self._square_sum, self._worst = 0.0, 0.0
        robot.layout.place(robot.rest, self.data.qpos)
        mujoco.mj_forward(model, self.data)
        # Left alone, MuJoCo writes each warning to a file in the working directory: not from inside a loop.
        mujoco.set_mju_user_warning(lambda _: None)

    @property
    def qpos(self) -> Array:
        """Where the robot is, shape (nq,): MuJoCo's own array, so copy what you keep."""
        return self.data.qpos

    def write(self, targets: Array, pose: Pose) -> None:
        """Advances the simulation by dt towards targets (J,), rad, and the root of the pose.

        The first write puts the robot in place. A state that is no longer finite is put in place anew and counted.
        """
        robot, data = self._robot, self.data
        self._goal, self._goal_before = self._goal_before, self._goal
        robot.place(targets, pose, self._goal)
        if not self._started:
            self._put_in_place(targets)
        data.mocap_pos[0] = self._goal[:3]
        data.mocap_quat[0] = self._goal[3:7]
        self._command(targets)
        mujoco.mj_step(robot.model, data, self._steps)
        if not np.isfinite(data.qpos).all() or any(data.warning[kind].number for kind in _BROKEN):
            self._faults += 1
            self._put_in_place(targets)
        robot.layout.read(data.qpos, near=targets, out=self._measured)
        self._count(targets)

    def measured(self) -> Array:
        """The joint positions (J,), rad, in the simulation."""
        return self._measured

    def report(self) -> Mapping[str, object]:
        """How closely the servos followed: root mean square over joints and time, and the worst joint at any time."""
        samples = max(self._writes, 1) * len(self._measured)
        return {
            "kind": "physics",
            "robot": self._robot.name,
            "joints": len(self._measured),
            "writes": self._writes,
            "timestep_s": self._robot.model.opt.timestep,
            "tracking_rmse_rad": float(np.sqrt(self._square_sum / samples)),
            "tracking_worst_rad": self._worst,
            "faults": self._faults,
        }

    def close(self) -> None:
        """Nothing to let go of."""

    def _command(self, targets: Array) -> None:
        layout, ctrl = self._robot.layout, self.data.ctrl
        if len(layout.hinge):
            goal, before = self._goal[layout.hinge_qpos], self._goal_before[layout.hinge_qpos]
            ctrl[layout.hinge] = goal + self._lead[layout.hinge] * (goal - before) / self._dt
        if len(layout.ball):
            at = layout.ball_qpos
            goal = self._goal[at]
            back = conjugate(np.stack([self.data.qpos[at], self._goal_before[at]]))
            now, error, turned = to_rotation_vector(np.concatenate([self.data.qpos[at][None], multiply(back, goal)]))
            ctrl[layout.ball] = now + error + self._lead[layout.ball] * turned / self._dt

    def _put_in_place(self, targets: Array) -> None:
        """Starts afresh at the targets, at rest."""
        mujoco.mj_resetData(self._robot.model, self.data)
        self.data.qpos[:] = self._goal
        self._goal_before[:] = self._goal
        self._started = True
        mujoco.mj_forward(self._robot.model, self.data)

    def _count(self, targets: Array) -> None:
        error = targets - self._measured
        self._writes += 1
        self._square_sum += float(error @ error)
        self._worst = max(self._worst, float(np.abs(error).max()))
