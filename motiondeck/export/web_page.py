"""The page of an export: one folder with the player as WebAssembly, a figure and its drawing, for any file server."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

import msgspec
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.robot_joints import ROOT, RobotBody
from motiondeck.export.drawn_figure import drawn_figure
from motiondeck.export.figure import Figure, figure_of
from motiondeck_base.files import write_file
from sim.robots.robot import Robot

WEB = Path(__file__).with_name("web")
FILES = ("index.html", "page.css", "scene.js", "player.js", "page.js")
FREE = JointLimits(*(np.full(len(ROOT), free) for free in (-1e3, 1e3, 1e3, 1e5, 1e7)))  # what shows where a root goes


def write_page(folder: Path, library: MotionLibrary, robot: Robot, rate: float, motions: Sequence[str] = ()) -> Figure:
    """Writes the page of some motions of a library, or all, on a robot, at ticks of a rate in Hz; as of `figure_of`.

    A browser loads nothing from elsewhere, so the page opens from a disk, too.
    """
    joints, limits, rest = robot.joints, robot.limits, robot.rest
    if isinstance(library.skeleton, RobotBody) and robot.footing is not None:  # its root is played as more joints
        joints, rest = (*joints, *ROOT), np.append(rest, np.zeros(len(ROOT)))
        limits = JointLimits(*map(np.append, astuple(limits), astuple(FREE)))
    figure = figure_of(library, joints, limits, rest, rate, motions)
    info, words = library.info, b64encode(figure.words).decode()
    texts = {"title": f"{info.name} on {robot.name}", "about": f"{info.acknowledgement} {info.licence}".strip()}
    content = msgspec.json.encode({**texts, "words": words, "drawing": drawn_figure(robot.drawn, robot.layout)})
    copy_player(folder)
    write_file(folder / "figure.js", b"motiondeck.figure = " + content + b";\n")
    return figure


def copy_player(folder: Path) -> None:
    """Writes what the pages of all figures have alike into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        write_file(folder / name, (WEB / name).read_bytes())
    player = b64encode((WEB / "player.wasm").read_bytes())
    write_file(folder / "wasm.js", b'motiondeck.wasm = "' + player + b'";\n')
