"""Live steps: a ball under each foot of a running robot that stands, and the prints that its feet leave."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np

from controller.rotations import Array
from sim.models.feet import find_feet
from sim.view.footprints import LIFTED, MOMENT, NEAR, STILL
from sim.view.private_page import PrivatePage

PRINTS = 24  # of the latest ones are kept
RISE = 0.5  # 1/s, so fast the ground follows the lowest foot upwards; down it follows at once
PRINT, STANDS = (120, 130, 145), (38, 110, 200)
_FACES = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]], dtype=np.uint32)


class LiveSteps:
    """Marks on the floor of a page."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, rest: Array, height: float) -> None:
        """Finds the feet of a robot that stands at rest (nq,) and is so high, m."""
        self._page, self._height = page, height
        self._feet = find_feet(model, rest)
        self._bodies = [model.body(foot.body).id for foot in self._feet]
        self._before: Array | None = None
        self._ground = np.inf
        self._stood = np.zeros(len(self._feet))  # s
        scene = page.scene
        self._floor = scene.add_frame("/steps", show_axes=False)
        self._marks = [
            scene.add_icosphere(f"/steps/contact{foot}", radius=0.03 * height, color=STANDS, opacity=0.6, visible=False)
            for foot in range(len(self._feet))
        ]
        self._prints = 0

    def show(self, data: mujoco.MjData, centre: Array, dt: float, *, visible: bool) -> None:
        """Marks what the feet do after dt more seconds, seen from the centre (2,), m."""
        places = ((data.xpos[body], data.xmat[body].reshape(3, 3)) for body in self._bodies)
        soles = zip(self._feet, places, strict=True)
        corners = np.array([place + foot.corners @ turn.T for foot, (place, turn) in soles])
        if not len(corners):
            return
        before = corners if self._before is None else self._before
        self._before = corners
        low = corners[..., 2].min(axis=1)
        self._ground = min(low.min(), self._ground + RISE * dt * max(low.min() - self._ground, 0.0))
        speed = np.linalg.norm(corners.mean(axis=1) - before.mean(axis=1), axis=1) / max(dt, 1e-3)
        stands = (low < self._ground + NEAR * self._height) & (speed < STILL * self._height)
        stood = np.where(stands, self._stood + dt, 0.0)
        self._floor.visible = visible
        self._floor.position = (-float(centre[0]), -float(centre[1]), 0.0)
        for foot, mark in enumerate(self._marks):
            mark.visible = visible and bool(stands[foot])
            mark.position = tuple(corners[foot].mean(axis=0))
            if visible and self._stood[foot] < MOMENT <= stood[foot]:
                self._leave(corners[foot])
        self._stood = stood

    def _leave(self, corners: Array) -> None:
        """One more print, in place of the oldest."""
        flat = corners.copy()
        flat[:, 2] = LIFTED * self._height
        name = f"/steps/print{self._prints % PRINTS}"
        self._page.scene.add_mesh_simple(
            name, flat.astype(np.float32), _FACES, color=PRINT, opacity=0.55, flat_shading=True
        )
        self._prints += 1
