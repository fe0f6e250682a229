"""Live steps: a ball under each foot of a running robot that stands, and the prints that its feet leave."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array
from motiondeck.page.body.footprints import StepWatch
from motiondeck.page.web.private_page import PrivatePage
from sim.models.feet import find_feet

PRINTS = 24  # of the latest ones are kept
PRINT, STANDS = (120, 130, 145), (38, 110, 200)
_FACES = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]], dtype=np.uint32)


class LiveSteps:
    """Marks on the floor of a page."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, rest: Array, height: float) -> None:
        """Finds the feet of a robot that stands at rest (nq,) and is so high, m."""
        self._page = page
        feet = find_feet(model, rest)
        self._steps = StepWatch(model, feet, height)
        scene = page.scene
        self._floor = scene.add_frame("/steps", show_axes=False)
        self._marks = [
            scene.add_icosphere(f"/steps/contact{foot}", radius=0.03 * height, color=STANDS, opacity=0.6, visible=False)
            for foot in range(len(feet))
        ]
        self._prints = 0

    def show(self, data: mujoco.MjData, centre: Array, dt: float, *, visible: bool) -> None:
        """Marks what the feet do after dt more seconds, seen from the centre (2,), m."""
        self._floor.visible = visible
        if not visible:
            for mark in self._marks:
                mark.visible = False
            return
        left = self._steps(data, dt)
        self._floor.position = (-float(centre[0]), -float(centre[1]), 0.0)
        for foot, mark in enumerate(self._marks):
            mark.visible = bool(self._steps.stands[foot])
            mark.position = tuple(self._steps.corners[foot].mean(axis=0))
        for corners in left:
            self._leave(corners)

    def _leave(self, corners: Array) -> None:
        """One more print, corners (4, 3), m, in place of the oldest."""
        name = f"/steps/print{self._prints % PRINTS}"
        self._page.scene.add_mesh_simple(
            name, corners.astype(np.float32), _FACES, color=PRINT, opacity=0.55, flat_shading=True
        )
        self._prints += 1
