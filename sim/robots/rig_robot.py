"""The robot of a rig alone: its joints by name in the rig's model, or on a figure made for it, a board of dials."""

import re
from collections.abc import Sequence
from dataclasses import replace
from math import ceil, cos, pi, sin, sqrt
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array, yaw
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import UnknownNameError
from sim.models.free_root import ROOT_JOINT
from sim.models.joint_layout import JointLayout
from sim.models.robot_file import LimitTable, RobotFile
from sim.models.scenery import LABEL, add_gantry, add_lamp, set_stage
from sim.models.surface import Surface
from sim.robots.robot import Robot, load_model

WIDE, HIGH, RADIUS, THIN = 0.3, 0.34, 0.1, 0.008  # m: from dial to dial, radius of a dial, of a pointer
TURNED = -0.4  # rad, towards the usual camera of the page
BOARD, FACE, POINTER, END = (0.42, 0.47, 0.54, 1), (0.93, 0.94, 0.96, 1), (0.11, 0.49, 0.84, 1), (0.85, 0.55, 0.2, 1)
_FIRST_WORD = re.compile(r"[^\s_.\-]+")


def rig_robot(file: Path, joints: Sequence[str], limits: JointLimits, model: Path | None, skeleton: Skeleton) -> Robot:
    """A robot with the J joints of a rig file, in its order; those that the skeleton's motions lack stay at rest.

    Other joints of the model, an MJCF or URDF file, stay where it has them. FileFormatError if the model cannot be
    used. UnknownNameError if it lacks a joint of the rig, or the rig one of the skeleton.
    """
    rest = np.clip(0.0, limits.lower, limits.upper)
    retarget = JointRetargeter(skeleton, joints, rest, getattr(skeleton, "robot_joints", None))
    if model is None:
        spec = rig_figure(joints, limits.lower, limits.upper)
        built = spec.compile()
    else:
        row = RobotFile(file.stem, "humanoid", LimitTable(1.0, 1.0, 1.0), str(model))
        _, hung = load_model(file, row)
        data, surface = mujoco.MjData(hung), Surface.of(hung)
        mujoco.mj_kinematics(hung, data)
        lowest = (surface.positions(data)[:, 2] - surface.radius).min()
        standing = msgspec.structs.replace(row, root_height=max(float(data.qpos[2] - lowest), 1e-3))
        spec, built = load_model(file, standing)
    whole = JointLayout.of(built)
    # All are hinges: of balls the reader makes three.
    order = np.array(UnknownNameError.indices(f"joint of {model}", joints, whole.joints, f"{file}: "))
    places, own = whole.hinge_qpos[order], np.arange(len(joints))
    layout = replace(whole, joints=tuple(joints), hinge=own, hinge_qpos=places, dof=whole.dof[order])
    height = float(built.body(int(built.jnt_bodyid[0])).pos[2])
    return Robot(file.stem, spec, built, layout, limits, rest, rest, retarget, height)


def rig_figure(joints: Sequence[str], lower: Array, upper: Array) -> mujoco.MjSpec:
    """A board with a dial for each joint; a pointer is upright at 0 and turns to the left as the angle, rad, grows.

    Marks show the range of a joint, `lower` to `upper`, shape (J,), rad, that is less than a turn.
    """
    rows = rows_of(joints)
    wide, high = WIDE * max(map(len, rows)), HIGH * len(rows)
    top = max(wide, high)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    set_stage(spec, top)
    turned = yaw(np.array(TURNED))
    board = spec.worldbody.add_body(name="board", pos=(0.0, 0.0, top - 0.5 * high), quat=turned)
    board.add_freejoint(name=ROOT_JOINT)
    box, cylinder, capsule = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE
    board.add_geom(type=box, size=(0.01, 0.5 * wide, 0.5 * high), pos=(-0.03, 0.0, 0.0), rgba=BOARD)
    if top > high:
        post = (-0.06, 0.0, 0.5 * high, -0.06, 0.0, 0.5 * high - top)
        board.add_geom(type=cylinder, fromto=post, size=(0.015, 0, 0), rgba=BOARD)
    places = {name: (column, row) for row, names in enumerate(rows) for column, name in enumerate(names)}
    for name, low, most in zip(joints, lower.tolist(), upper.tolist(), strict=True):
        column, row = places[name]
        y, z = WIDE * (column + 0.5) - 0.5 * wide, 0.5 * high - HIGH * (row + 0.42)
        board.add_geom(type=cylinder, fromto=(-0.02, y, z, -0.01, y, z), size=(RADIUS, 0, 0), rgba=FACE)
        for end in (low, most) if most - low < 2.0 * pi else ():
            mark = [(y - at * sin(end), z + at * cos(end)) for at in (0.8 * RADIUS, 1.15 * RADIUS)]
            ends = (-0.01, *mark[0], -0.01, *mark[1])
            board.add_geom(type=capsule, fromto=ends, size=(0.5 * THIN, 0, 0), rgba=END)
        board.add_site(name=LABEL + name, pos=(0.02, y, z - 1.2 * RADIUS))
        pointer = board.add_body(name=name, pos=(0.0, y, z))
        pointer.add_joint(name=name, axis=(1.0, 0.0, 0.0), range=(low, most))
        ends = (0.0, 0.0, -0.2 * RADIUS, 0.0, 0.0, RADIUS)
        pointer.add_geom(type=capsule, fromto=ends, size=(THIN, 0, 0), rgba=POINTER)
        servo = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        servo.set_to_position(kp=1.0)
    add_lamp(board, top)
    add_gantry(spec, board)
    return spec


def rows_of(joints: Sequence[str]) -> list[tuple[str, ...]]:
    """The joints in rows of a square: joints whose names begin with the same word stand in rows of their own."""
    groups = groups_of(joints)
    grouped = {joint for group in groups.values() for joint in group}
    together = [tuple(joint for joint in joints if joint not in grouped), *groups.values()]
    square = ceil(sqrt(len(joints)))
    columns = max(square, min(square + 1, max(map(len, together))))
    return [group[at : at + columns] for group in together for at in range(0, len(group), columns)]


def groups_of(joints: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """The joints whose names begin with the same word, by that word, where there are several."""
    words = [found[0] if (found := _FIRST_WORD.match(joint)) else "" for joint in joints]
    groups = {word: tuple(one for one, its in zip(joints, words, strict=True) if its == word) for word in words if word}
    return {word: group for word, group in groups.items() if len(group) > 1}
