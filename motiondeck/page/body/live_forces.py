"""Live forces: arrows from the floor where it holds the body, as long as they are strong."""

from __future__ import annotations

import numpy as np

from controller.motion.rotations import Array
from motiondeck.page.web.private_page import PrivatePage

COLOUR = (230, 119, 0)
WEIGHT_IS = 0.5  # heights of the robot: the length of an arrow that carries all of it


class LiveForces:
    """Arrows on a page."""

    def __init__(self, page: PrivatePage, weight: float, height: float) -> None:
        """Prepares arrows for a robot of a weight, N, and a height, m."""
        self._metres = WEIGHT_IS * height / weight
        self._shown = False
        self._arrows = page.scene.add_arrows(
            "/forces",
            np.zeros((1, 2, 3)),
            COLOUR,
            shaft_radius=0.008 * height,
            head_radius=0.02 * height,
            head_length=0.04 * height,
            visible=False,
        )

    def show(self, forces: Array, centre: Array, *, visible: bool) -> None:
        """Draws forces (N, 6), m and N, NaN for none, as seen from the centre (2,), m."""
        if visible != self._shown:
            self._arrows.visible = self._shown = visible
        if not visible:
            return
        rows = forces[np.isfinite(forces[:, 0])]
        starts = rows[:, :3] - np.array([*centre, 0.0])
        self._arrows.points = np.stack([starts, starts + self._metres * rows[:, 3:]], axis=1).astype(np.float32)
