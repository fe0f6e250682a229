"""Pictures of a library's motions, and which can be blended; a thread plays each once, which takes a moment."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from threading import Thread

import msgspec
import numpy as np

from controller.deck.routes import Routes
from controller.learning.measures.self_test import run_free
from controller.library.motion_library import MotionLibrary, load_library
from motiondeck.page.web.stick_figure import figure_svg
from motiondeck_base.errors import MotiondeckError

MOMENTS = (0.1, 0.25, 0.4)  # of a motion, the last drawn darkest
MOST = 9  # motions around the middle of the pad


class Partners(msgspec.Struct, frozen=True):
    """What a motion can be blended with, and why not with the others."""

    others: list[str] = []  # on the pad, at most MOST, those that resemble each other side by side
    # For each of them, why it and the next one around the pad cannot be blended at once; "" if they can be.
    apart: list[str] = []
    refused: dict[str, str] = {}  # the other loops, with the reasons
    never: str = ""  # why it cannot be blended at all; "" if it can be


class LibraryGlance:
    """The pictures and blends of a library's motions, empty until known; a `direct` deck plays none in between."""

    def __init__(self, file: Path, *, direct: bool = False) -> None:
        self.pictures: dict[str, str] = {}  # SVG by motion; none for joints that were taught to a rig
        self.blends: dict[str, Partners] = {}  # by motion, what it can be blended with
        self._file, self._direct = file, direct
        Thread(target=self._compute, daemon=True).start()

    def _compute(self) -> None:
        try:
            library = load_library(self._file)
        except MotiondeckError:
            return  # it has been replaced by something else since the deck loaded it
        self.pictures = pictures_of(library)
        routes = Routes.of(library)
        self.blends = blends_of([*library.network.motions], routes.direct if self._direct else routes)


def pictures_of(library: MotionLibrary) -> dict[str, str]:
    """A picture of each motion, drawn from what the network plays; none where there is no body to draw."""
    skeleton = library.skeleton
    if skeleton.is_rig:
        return {}
    network, found = library.network.twin(), dict[str, str]()
    for motion in library.info.motions:
        played = run_free(network, motion.name, motion.frames)
        rows = [round(share * (motion.frames - 1)) for share in MOMENTS]
        rotation = library.encoding.decode(played[rows]).rotation
        joints = skeleton.joints(np.zeros((len(rows), 3)), rotation)
        found[motion.name] = figure_svg(joints, skeleton.parent.tolist())
    return found


def blends_of(motions: Sequence[str], routes: Routes) -> dict[str, Partners]:
    """By motion, what it can be blended with, as the deck decides it."""
    loops = [name for name in motions if name not in routes.bridges]
    return {name: _partners(name, loops, routes) for name in motions}


def _partners(one: str, loops: Sequence[str], routes: Routes) -> Partners:
    if why := routes.blend_obstacle([one]):
        return Partners(never=why)
    refused = {other: routes.blend_obstacle([one, other]) for other in loops if other != one}
    near = _side_by_side(one, [other for other, why in refused.items() if not why], routes)
    apart = [routes.blend_obstacle([one, *pair]) for pair in pairwise([*near, *near[:1]])]
    return Partners(near, apart, {other: why for other, why in refused.items() if why})


def _side_by_side(one: str, others: Sequence[str], routes: Routes) -> list[str]:
    """The nearest MOST of the others: next to a motion, first next to `one`, stands the one with the shortest leap."""
    found, left = [one], sorted(others, key=routes.leaps[one].__getitem__)[:MOST]
    while left:
        found.append(min(left, key=routes.leaps[found[-1]].__getitem__))
        left.remove(found[-1])
    return found[1:]
