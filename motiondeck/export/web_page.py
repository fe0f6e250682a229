"""The page of an export: one folder with the player as WebAssembly, a figure and its drawing, for any file server."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.robot_joints import ROOT, RobotBody
from controller.motion.rotations import Array
from motiondeck.export.c_folder import write_folder
from motiondeck.export.figure import Figure, figure_of
from motiondeck.page.body.solids import batches
from sim.models.joint_layout import JointLayout
from sim.models.scenery import LABEL, body_height
from sim.robots.robot import Robot

WEB = Path(__file__).with_name("web")
FILES = ("index.html", "page.css", "scene.js", "player.js", "page.js")
FREE = JointLimits(*(np.full(len(ROOT), free) for free in (-1e3, 1e3, 1e3, 1e5, 1e7)))  # what shows where a root goes
MOST_TRIANGLES = 800  # of a mesh: less than on the live page, since the folder is sent to others
BODIES = ("body_parentid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_qposadr", "jnt_axis", "jnt_pos")
SHAPES = ("qpos0", "geom_bodyid", "geom_pos", "geom_quat", "site_bodyid", "site_pos")


def write_page(folder: Path, library: MotionLibrary, robot: Robot, rate: float, motions: Sequence[str] = ()) -> Figure:
    """Writes the page of some motions of a library, or all, on a robot, at ticks of a rate in Hz; as of `figure_of`.

    A browser loads nothing from elsewhere, so the page opens from a disk, too.
    """
    joints, limits, rest = robot.joints, robot.limits, robot.rest
    if isinstance(library.skeleton, RobotBody) and robot.footing is not None:  # its root is played as more joints
        joints, rest = (*joints, *ROOT), np.append(rest, np.zeros(len(ROOT)))
        limits = JointLimits(*map(np.append, astuple(limits), astuple(FREE)))
    figure = figure_of(library, joints, limits, rest, rate, motions)
    info = library.info
    texts = {"title": f"{info.name} on {robot.name}", "about": f"{info.acknowledgement} {info.licence}".strip()}
    content = {**texts, "words": _packed(figure.words), "drawing": drawn_figure(robot.drawn, robot.layout)}
    copy_player(folder)
    write_folder(folder, {"figure.js": b"motiondeck.figure = " + msgspec.json.encode(content) + b";\n"})
    return figure


def copy_player(folder: Path) -> None:
    """Writes what the pages of all figures have alike into a folder."""
    player = f'motiondeck.wasm = "{_packed((WEB / "player.wasm").read_bytes())}";\n'
    write_folder(folder, {name: (WEB / name).read_bytes() for name in FILES} | {"wasm.js": player.encode()})


def drawn_figure(model: mujoco.MjModel, layout: JointLayout) -> dict[str, Any]:
    """The drawing of a model of hinges for `scene.js`: arrays of the model by their names, and shapes."""
    led = [
        (int(follower), int(leader), curve.tolist())
        for group, followers, leaders in zip(layout.led, layout.followers, layout.leaders, strict=True)
        for follower, leader, curve in zip(followers, leaders, group.curve, strict=True)
    ]
    shapes = [
        {
            **{"vertices": _packed(batch.mesh[0].astype("<f4").tobytes()), "opacity": batch.opacity},
            **{"faces": _packed(batch.mesh[1].astype("<u2").tobytes())},
            **{name: _listed(getattr(batch, name)) for name in ("geom", "offset", "scale", "colour")},
        }
        for batch in batches(model, MOST_TRIANGLES).values()
    ]
    sites = [model.site(site).name for site in range(model.nsite)]
    labels = [name.removeprefix(LABEL) if name.startswith(LABEL) else "" for name in sites]
    joints = {"hinge": layout.hinge.tolist(), "hinge_qpos": layout.hinge_qpos.tolist(), "led": led}
    parts = {name: _listed(getattr(model, name)) for name in BODIES + SHAPES}
    return {**parts, **joints, "shapes": shapes, "labels": labels, "height": body_height(model)}


def _listed(values: Array) -> list[Any]:
    return np.round(values, 6).tolist()


def _packed(values: bytes) -> str:
    return b64encode(values).decode()
