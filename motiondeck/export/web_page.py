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
from controller.deck.motion_generator import MotionGenerator
from controller.library.motion_library import MotionLibrary
from controller.motion.canonical.canonical_body import root_height
from controller.motion.encodings.robot_joints import ROOT, RobotBody
from motiondeck.export.c_folder import write_folder
from motiondeck.export.figure import Figure, figure_of
from motiondeck.page.body.solids import batches
from sim.models.joint_layout import JointLayout
from sim.models.mannequin.mannequin import ROOT_BODY, build_mannequin
from sim.models.scenery import LABEL, body_height
from sim.robots.robot import Robot

WEB = Path(__file__).with_name("web")
FILES = ("index.html", "page.css", "scene.js", "human.js", "player.js", "trace.js", "page.js")
FREE = JointLimits(*(np.full(len(ROOT), free) for free in (-1e3, 1e3, 1e3, 1e5, 1e7)))  # what shows where a root goes
MOST_TRIANGLES = 800  # of a mesh: less than on the live page, since the folder is sent to others
SAMPLES, POSE_UNIT = 20.0, 8192.0  # of a human: poses a second, and what their numbers are multiplied with
BODIES = ("body_parentid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_qposadr", "jnt_axis", "jnt_pos")
COPIES = ("geom", "offset", "scale", "colour", "opacity")
SHAPES = ("qpos0", "geom_bodyid", "geom_pos", "geom_quat", "site_bodyid", "site_pos")


def write_page(
    folder: Path,
    library: MotionLibrary,
    robot: Robot,
    rate: float,
    motions: Sequence[str] = (),
    *,
    networks: bool = False,
    **also: Any,
) -> Figure:
    """Writes the page of some motions of a library, or all, on a robot, at ticks of a rate in Hz; as of `figure_of`.

    It shows also `human`, of `drawn_human`, beside the robot, and takes layers on `groups` of joints, names by name. A
    browser loads nothing from elsewhere, so the page opens from a disk, too.
    """
    joints, limits, rest = robot.joints, robot.limits, robot.rest
    if isinstance(library.skeleton, RobotBody) and robot.footing is not None:  # its root is played as more joints
        joints, rest = (*joints, *ROOT), np.append(rest, np.zeros(len(ROOT)))
        limits = JointLimits(*map(np.append, astuple(limits), astuple(FREE)))
    figure = figure_of(library, joints, limits, rest, rate, motions, networks=networks)
    info = library.info
    texts = {"title": f"{info.name} on {robot.name}", "about": f"{info.acknowledgement} {info.licence}".strip()}
    content = {**texts, "words": _packed(figure.words), "drawing": drawn_figure(robot.drawn, robot.layout), **also}
    copy_player(folder)
    write_folder(folder, {"figure.js": b"motiondeck.figure = " + msgspec.json.encode(content) + b";\n"})
    return figure


def copy_player(folder: Path) -> None:
    """Writes what the pages of all figures have alike into a folder."""
    player = f'motiondeck.wasm = "{_packed((WEB / "player.wasm").read_bytes())}";\n'
    write_folder(folder, {name: (WEB / name).read_bytes() for name in FILES} | {"wasm.js": player.encode()})


def drawn_human(library: MotionLibrary, motions: Sequence[str]) -> dict[str, Any]:
    """The drawing of a library's human, with SAMPLES poses a second of some of its motions, or all.

    A pose is the height of the root, m, and the turns of root and bones, seen from the heading, as quaternions.
    """
    skeleton, rate, poses = library.skeleton, library.info.rate, dict[str, str]()
    model = build_mannequin(skeleton).compile()
    for one in (one for one in library.info.motions if not motions or one.name in motions):
        seconds = (one.frames - (one.plays != "loop")) / rate  # until its phase is 1
        every = seconds / round(SAMPLES * seconds)
        played = MotionGenerator(library, one.name).frames(seconds + every, 1.0 / every)
        posture, own = library.encoding.decode(played), skeleton.with_offsets(library.offsets(one.name))
        pose = posture.at(np.multiply.outer(posture.height, [0.0, 0.0, 1.0]))
        rows = np.column_stack([root_height(pose, skeleton, own), pose.rotation.reshape(len(played), -1)])
        poses[one.name] = _packed(np.round(POSE_UNIT * rows).astype("<i2").tobytes())
    turned = [model.body(name).id for name in (ROOT_BODY, *skeleton.bones)]
    return {**drawn_figure(model, JointLayout.of(model)), "turned": turned, "poses": poses}


def drawn_figure(model: mujoco.MjModel, layout: JointLayout) -> dict[str, Any]:
    """The drawing of a model of hinges for `scene.js`: arrays of the model by their names, and shapes."""
    curves = [group.curve for group in layout.led]
    led = [np.column_stack(group).tolist() for group in zip(layout.followers, layout.leaders, curves, strict=True)]
    shapes = [
        {
            **{name: np.round(getattr(batch, name), 6).tolist() for name in COPIES},
            **{
                name: [_packed(vertices.tobytes()), _packed(faces.astype("<u2").tobytes())]
                for name, (vertices, faces) in (("mesh", batch.mesh), ("shadow", batch.shadow))
            },
        }
        for batch in batches(model, MOST_TRIANGLES).values()
    ]
    labels = [model.site(site).name.partition(LABEL)[2] for site in range(model.nsite)]
    joints = {"hinge": layout.hinge.tolist(), "hinge_qpos": layout.hinge_qpos.tolist(), "led": led}
    parts = {name: np.round(getattr(model, name), 6).tolist() for name in BODIES + SHAPES}
    return {**parts, **joints, "shapes": shapes, "labels": labels, "height": body_height(model)}


def _packed(values: bytes) -> str:
    return b64encode(values).decode()
