"""The target pose: a translucent robot where the simulated servos are to bring the real one."""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from controller.motion.rotations import Array
from motiondeck.page.body.drawn_model import DrawnModel
from motiondeck.page.web.private_page import PrivatePage

OPACITY = 0.35
COLOUR = (0.11, 0.49, 0.84)


class TargetPose:
    """Drawn over the body; its solids are sent to the browsers when it is first switched on.

    Args:
        page: where it is drawn.
        load: gives a model of the robot, which is changed.
        height: of the robot, m.
    """

    def __init__(self, page: PrivatePage, load: Callable[[], mujoco.MjModel], height: float) -> None:
        self._page, self._load, self._height = page, load, height
        self._drawn: DrawnModel | None = None

    def show(self, target: Array, centre: Array, *, visible: bool) -> None:
        """Draws it at a target (nq,), as seen by someone at the centre (2,), m."""
        if not visible:
            if self._drawn is not None:
                self._drawn.hide()
            return
        if self._drawn is None:
            model = self._load()
            seen = (model.geom_rgba[:, 3] > 0.0) & (model.geom_group < 3)
            model.geom_matid[:] = -1
            model.geom_rgba[seen] = (*COLOUR, OPACITY)
            self._drawn = DrawnModel(self._page, model, self._height, " target")
        self._drawn.show(target, centre)
