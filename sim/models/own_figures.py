"""A robot file's own figures of joints, set in the model, where simulation, checks, walking and pages read them."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.kinematic_tree import followers
from sim.models.robot_file import JointLimit
from sim.models.servo_motor import Motors, ServoMotor, strength


def set_joints(path: Path, spec: mujoco.MjSpec, own: Mapping[str, JointLimit]) -> None:
    """Sets ranges of hinges and torque limits of joints in a model; joints that follow these get no range.

    `path` is for errors: UnknownNameError for a joint that is not played, FileFormatError for an empty range.
    """
    if not own:
        return
    model = spec.compile()
    joints = [model.actuator(index).name for index in range(model.nu)]
    for name, limit in own.items():
        if name not in joints:
            raise UnknownNameError(f"{path}: limits.joints: {UnknownNameError.among('joint', name, joints)}")
        joint = int(model.actuator_trnid[joints.index(name), 0])
        turning, is_hinge = spec.joint(model.joint(joint).name), model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        lower, upper = model.jnt_range[joint].tolist() if model.jnt_limited[joint] else (-np.pi, np.pi)
        lower = limit.lower if limit.lower is not None else lower if is_hinge else -upper
        upper = limit.upper if limit.upper is not None else upper
        if not lower < upper:
            raise FileFormatError(f"{path}: limits.joints.{name}: lower must be less than upper")
        if is_hinge and (limit.lower, limit.upper) != (None, None):
            turning.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            turning.range = np.degrees((lower, upper)) if spec.compiler.degree else (lower, upper)
            for follower, (leader, _) in followers(model).items():
                if leader == joint:
                    spec.joint(model.joint(follower).name).limited = mujoco.mjtLimited.mjLIMITED_FALSE
        if limit.torque is not None:
            servo = spec.actuator(name)
            servo.forcelimited, servo.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, (-limit.torque, limit.torque)
            turning.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE


def motors_of(servo: ServoMotor, model: mujoco.MjModel, own: Mapping[str, JointLimit]) -> Motors:
    """The servos of a model: with the own torques of joints at stall, and own speeds above the servo's without load."""
    none = JointLimit()
    limits = [own.get(model.actuator(index).name, none) for index in range(model.nu)]
    torque = np.array([limit.torque or servo.torque for limit in limits])
    speed = np.array([max(limit.velocity or 0.0, servo.speed) for limit in limits])
    return Motors(servo, torque, speed, strength(model))
