"""Layout: places of a robot's joint coordinates in MuJoCo's qpos and qvel.

A robot's joints are those its actuators drive, in the actuators' order. A hinge has one coordinate, its angle; a ball
joint has three, the components of its rotation vector, driven by three actuators in a row.
"""

from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np

from controller.motion.rotations import Array, Indices, dot, from_rotation_vector, to_rotation_vector
from motiondeck_base.errors import FileFormatError
from sim.models.kinematic_tree import LedJoints, led_joints

# Number of coordinates, and so servos, of a joint; slides are not played.
_COORDINATES = {int(mujoco.mjtJoint.mjJNT_HINGE): 1, int(mujoco.mjtJoint.mjJNT_BALL): 3}


@dataclass(frozen=True)
class JointLayout:
    """J coordinates in nq numbers, of which the first seven are the free root's position and quaternion."""

    joints: tuple[str, ...]  # the names of the coordinates, length J
    hinge: Indices  # coordinates that are hinge angles, shape (H,); all of them, in order, where there is no ball joint
    hinge_qpos: Indices  # their places in qpos
    ball: Indices  # coordinates that are rotation vectors, shape (N, 3)
    ball_qpos: Indices  # places of their quaternions in qpos, shape (N, 4)
    dof: Indices  # places of the coordinates in qvel, shape (J,)
    led: tuple[LedJoints, ...] = ()  # joints that follow others, in the order of placing
    followers: tuple[Indices, ...] = ()  # their places in qpos, by group
    leaders: tuple[Indices, ...] = ()  # likewise

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Self:
        """Reads the layout of a model.

        FileFormatError if the first joint is not a free one, an actuator drives no joint or a sliding one, or a ball
        joint has not three actuators in a row; it names the culprit.
        """
        name = model.names[: model.names.index(b"\0")].decode()
        if model.njnt == 0 or model.jnt_type[0] != mujoco.mjtJoint.mjJNT_FREE:
            raise FileFormatError(f"robot '{name}': its first joint is not a free joint")
        hinge, hinge_qpos, ball, ball_qpos, dof = [], [], [], [], []
        index, gear = 0, model.actuator_gear
        while index < model.nu:
            servo, joint = model.actuator(index).name, int(model.actuator_trnid[index, 0])
            if model.actuator_trntype[index] != mujoco.mjtTrn.mjTRN_JOINT or model.jnt_type[joint] not in _COORDINATES:
                raise FileFormatError(f"robot '{name}': actuator '{servo}' drives no hinge and no ball joint")
            count = _COORDINATES[model.jnt_type[joint]]
            row = slice(index, index + count)
            if count == 1:
                hinge.append(index)
                hinge_qpos.append(model.jnt_qposadr[joint])
            elif (model.actuator_trnid[row, 0] == joint).all() and np.array_equal(gear[row, :3], np.eye(3)):
                ball.append(index + np.arange(3))
                ball_qpos.append(model.jnt_qposadr[joint] + np.arange(4))
            else:
                raise FileFormatError(f"robot '{name}': ball joint of '{servo}' has not x, y, z servos in a row")
            dof.extend(model.jnt_dofadr[joint] + np.arange(count))
            index += count
        led = led_joints(model)
        return cls(
            tuple(model.actuator(index).name for index in range(model.nu)),
            np.array(hinge, dtype=np.int64),
            np.array(hinge_qpos, dtype=np.int64),
            np.array(ball, dtype=np.int64).reshape(-1, 3),
            np.array(ball_qpos, dtype=np.int64).reshape(-1, 4),
            np.array(dof, dtype=np.int64),
            led,
            tuple(model.jnt_qposadr[group.follower] for group in led),
            tuple(model.jnt_qposadr[group.leader] for group in led),
        )

    def place(self, targets: Array, qpos: Array) -> None:
        """Writes joint coordinates (J,) into qpos (nq,); the root is left alone."""
        if len(self.ball):
            qpos[self.ball_qpos] = from_rotation_vector(targets[self.ball])
            targets = targets[self.hinge]
        qpos[self.hinge_qpos] = targets
        for group, follower, leader in zip(self.led, self.followers, self.leaders, strict=True):
            qpos[follower] = group.followed(qpos[leader])

    def read(self, qpos: Array, near: Array, out: Array) -> None:
        """Reads joint coordinates into out (J,), of equivalent rotation vectors those closest to near (J,)."""
        if len(self.ball):
            out[self.hinge] = qpos[self.hinge_qpos]
            out[self.ball] = nearest_turn(to_rotation_vector(qpos[self.ball_qpos]), near[self.ball])
        else:
            out[...] = qpos[self.hinge_qpos]


def nearest_turn(vector: Array, near: Array) -> Array:
    """Rotation vectors (N, 3) of |angle| <= pi, changed by whole turns to come nearest: no jump at a half turn."""
    if np.abs(near - vector).max(initial=0.0) < 1.0:
        return vector  # less than a half turn away
    angle = np.sqrt(dot(vector, vector))
    turning = angle > 1e-9
    axis = vector / np.where(turning, angle, 1.0)[:, None]
    turns = np.rint((dot(near, axis) - angle) / (2.0 * np.pi))
    if not turns.any():
        return vector
    return vector + (2.0 * np.pi * turns)[:, None] * axis
