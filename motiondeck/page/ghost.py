"""The ghost: the translucent human whose motion a robot plays, over it or beside it on the page."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from controller.motion.canonical.canonical_body import root_height
from controller.motion.rotations import Array, conjugate, multiply
from controller.motion.skeleton import Pose, Skeleton
from controller.wire.run_folder import write_shared
from motiondeck.page.web.page_state import GhostDescription
from sim.models.mannequin.mannequin import ROOT_BODY, build_mannequin, fit_mannequin

if TYPE_CHECKING:  # the deck writes the model; only its page draws
    import viser

    from motiondeck.page.body.drawn_model import DrawnModel

OPACITY = 0.4
WAYS = ("off", "over the robot", "beside it")


def draw_ghost(skeleton: Skeleton, scale: float, file: Path) -> GhostDescription:
    """Writes the model of a human of the robot's size, translucent; its description."""
    spec = build_mannequin(replace(skeleton, length=skeleton.length * scale))
    for material in spec.materials:
        material.rgba[3] = OPACITY
    spec.compile()
    write_shared(file, spec.to_xml())
    return GhostDescription(str(file), skeleton.info(), scale)


class Ghost:
    """Turns published poses into the coordinates of that model, and shows them."""

    def __init__(self, drawn: DrawnModel, about: GhostDescription, aside: float) -> None:
        """Reads what `draw_ghost` returned; beside the robot it is `aside`, m, to the left of it."""
        self._drawn, self._scale, self._aside = drawn, about.scale, aside
        model = drawn.model
        self._skeleton = self._own = Skeleton.restore(about.skeleton)
        self._offsets = self._skeleton.offsets
        self._parent = self._skeleton.parent + 1
        joints = [int(model.body(bone).jntadr[0]) for bone in self._skeleton.bones]
        self._turns = model.jnt_qposadr[joints][:, None] + np.arange(4)
        self._root = int(model.jnt_qposadr[model.body(ROOT_BODY).jntadr[0]])
        self._qpos = model.qpos0.copy()

    def twin(self, client: viser.ClientHandle) -> Self:
        """The same for one browser, which sees it in place of this one."""
        twin = copy(self)
        twin._drawn, twin._qpos = self._drawn.twin(client), self._qpos.copy()
        return twin

    def show(self, way: str, pose: Pose, beneath: Array, centre: Array) -> None:
        """Draws a pose in one of WAYS, on the body of its offsets, at the robot's root (2,), m, whatever its own path.

        The centre (2,), m, is that of the view.
        """
        if way == WAYS[0]:
            self._drawn.set_visible(False)
            return
        aside = np.array([0.0, self._aside if way == WAYS[2] else 0.0])
        self._qpos[self._root : self._root + 2] = beneath + aside
        if pose.offsets is not None and pose.offsets.any() and not np.array_equal(pose.offsets, self._offsets):
            self._offsets = pose.offsets.copy()
            self._own = self._skeleton.with_offsets(pose.offsets)
            fit_mannequin(self._drawn.model, self._skeleton.with_offsets(self._scale * pose.offsets))
            self._drawn.take_sizes()
        turns = pose.rotation
        self._qpos[self._root + 2] = self._scale * root_height(pose, self._skeleton, self._own)
        self._qpos[self._root + 3 : self._root + 7] = turns[0]
        self._qpos[self._turns] = multiply(conjugate(turns[self._parent]), turns[1:])
        self._drawn.show(self._qpos, centre)
