"""What the page shows of a library beside its names: a small picture of each motion, and what blends with what.

Both are found out in a thread, because playing each motion once takes a moment.
"""

from __future__ import annotations

from pathlib import Path
from threading import Thread

import numpy as np

from controller.deck.routes import Routes
from controller.library.motion_library import MotionLibrary, load_library
from controller.measures.self_test import run_free
from controller.mocap.encodings.joint_angles import JointBody
from motiondeck_base.errors import MotiondeckError
from sim.view.web.stick_figure import figure_svg

MOMENTS = (0.1, 0.25, 0.4)  # of a motion, the last drawn darkest
MOST = 9  # motions around the middle of the pad


class LibraryGlance:
    """The pictures and the blends of a library's motions; empty until they are known.

    Attributes:
        pictures: SVG by motion; none for joints that were taught to a rig.
        blends: by motion, the loops that it can be blended with, at most MOST; those that resemble each other stand
            side by side.
    """

    def __init__(self, file: Path) -> None:
        self.pictures: dict[str, str] = {}
        self.blends: dict[str, list[str]] = {}
        self._file = file
        Thread(target=self._find_out, daemon=True).start()

    def _find_out(self) -> None:
        try:
            library = load_library(self._file)
        except MotiondeckError:
            return  # it has been replaced by something else since the deck loaded it
        self.pictures = pictures_of(library)
        self.blends = blends_of(library)


def pictures_of(library: MotionLibrary) -> dict[str, str]:
    """A picture of each motion, drawn from what the network plays; none where there is no body to draw."""
    skeleton = library.skeleton
    if isinstance(skeleton, JointBody):
        return {}
    network, found = library.network.twin(), dict[str, str]()
    for motion in library.info.motions:
        played = run_free(network, motion.name, motion.frames)
        rows = [round(share * (motion.frames - 1)) for share in MOMENTS]
        rotation = library.encoding.decode(played[rows]).rotation
        joints = skeleton.joints(np.zeros((len(rows), 3)), rotation)
        found[motion.name] = figure_svg(joints, skeleton.parent.tolist())
    return found


def blends_of(library: MotionLibrary) -> dict[str, list[str]]:
    """By motion, the loops that it can be blended with."""
    routes = Routes.of(library)
    loops = [motion.name for motion in library.info.motions if motion.plays == "loop"]
    return {
        one: _side_by_side(one, [other for other in loops if other != one and not routes.by_way_of(one, other)], routes)
        for one in loops
    }


def _side_by_side(one: str, others: list[str], routes: Routes) -> list[str]:
    """At most MOST of the others: next to a motion, at first next to `one`, stands the one with the shortest leap."""
    found, left = [one], others[:MOST]
    while left:
        found.append(min(left, key=routes.leaps[found[-1]].__getitem__))
        left.remove(found[-1])
    return found[1:]
