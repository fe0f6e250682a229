"""The robot of a rig alone: its joints by name in the rig's model, or in a figure made for it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import UnknownNameError
from sim.models.joint_layout import JointLayout
from sim.models.rig_figure import rig_figure
from sim.models.robot_file import LimitTable, RobotFile
from sim.models.surface import Surface
from sim.robots.robot import Robot, load_model


def rig_robot(file: Path, joints: Sequence[str], limits: JointLimits, model: Path | None, skeleton: Skeleton) -> Robot:
    """A robot with the J joints of a rig file, in its order; those that the skeleton's motions lack stay at rest.

    Other joints of the model, an MJCF or URDF file, stay where it has them. FileFormatError if the model cannot be
    used. UnknownNameError if it lacks a joint of the rig, or the rig one of the skeleton.
    """
    rest = np.clip(0.0, limits.lower, limits.upper)
    retarget = JointRetargeter(skeleton, joints, rest)
    if model is None:
        spec = rig_figure(joints, limits.lower, limits.upper)
        built = spec.compile()
    else:
        row = RobotFile(file.stem, "humanoid", LimitTable(1.0, 1.0, 1.0), str(model))
        height = _standing(load_model(file, row)[1])
        spec, built = load_model(file, msgspec.structs.replace(row, root_height=height))
    whole = JointLayout.of(built)
    for joint in joints:
        if joint not in whole.joints:
            raise UnknownNameError(f"{file}: {UnknownNameError.among(f'joint of {model}', joint, whole.joints)}")
    order = np.array([whole.joints.index(joint) for joint in joints])  # all are hinges: of balls the reader makes three
    places, own = whole.hinge_qpos[order], np.arange(len(joints))
    layout = replace(whole, joints=tuple(joints), hinge=own, hinge_qpos=places, dof=whole.dof[order])
    height = float(built.body(int(built.jnt_bodyid[0])).pos[2])
    return Robot(file.stem, spec, built, layout, limits, rest, rest, retarget, height)


def _standing(model: mujoco.MjModel) -> float:
    """The height of the root, m, at which the model stands on the floor."""
    data, surface = mujoco.MjData(model), Surface.of(model)
    mujoco.mj_kinematics(model, data)
    lowest = (surface.positions(data)[:, 2] - surface.radius).min()
    return max(float(data.qpos[2] - lowest), 1e-3)
