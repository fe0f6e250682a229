"""Live marks on the page of a run: contacts and prints of feet, contact forces, and the target pose of the servos."""

from collections.abc import Callable

import mujoco
import numpy as np
import viser

from controller.motion.rotations import Array
from motiondeck.page.body.drawn_model import DrawnModel
from motiondeck.page.body.footprints import StepWatch
from motiondeck.page.web.private_page import PrivatePage
from sim.models.feet import find_feet

OPACITY = 0.35
TARGET_COLOUR = (0.11, 0.49, 0.84)


class TargetPose:
    """Drawn over the body of a height, m, and sent when first switched on; the model that `load` gives is changed."""

    def __init__(self, page: PrivatePage, load: Callable[[], mujoco.MjModel], height: float) -> None:
        self._page, self._load, self._height = page, load, height
        self._drawn: DrawnModel | None = None

    def show(self, target: Array, centre: Array, *, visible: bool) -> None:
        """Draws it at a target (nq,), as seen by someone at the centre (2,), m."""
        if not visible:
            if self._drawn is not None:
                self._drawn.set_visible(False)
            return
        if self._drawn is None:
            model = self._load()
            seen = (model.geom_rgba[:, 3] > 0.0) & (model.geom_group < 3)
            model.geom_matid[:] = -1
            model.geom_rgba[seen] = (*TARGET_COLOUR, OPACITY)
            self._drawn = DrawnModel(self._page, model, self._height, " target")
        self._drawn.show(target, centre)


FORCE_COLOUR = (230, 119, 0)
WEIGHT_IS = 0.5  # heights of the robot: the length of an arrow that carries all of it


class LiveForces:
    """Arrows on a page."""

    def __init__(self, page: PrivatePage, weight: float, height: float) -> None:
        """Prepares arrows for a robot of a weight, N, and a height, m."""
        self._metres = WEIGHT_IS * height / weight
        self._arrows = page.scene.add_arrows(
            "/forces",
            np.zeros((1, 2, 3)),
            FORCE_COLOUR,
            shaft_radius=0.008 * height,
            head_radius=0.02 * height,
            head_length=0.04 * height,
            visible=False,
        )

    def show(self, forces: Array, centre: Array, *, visible: bool) -> None:
        """Draws forces (N, 6), m and N, NaN for none, as seen from the centre (2,), m."""
        self._arrows.visible = visible
        if not visible:
            return
        rows = forces[np.isfinite(forces[:, 0])]
        starts = rows[:, :3] - np.array([*centre, 0.0])
        self._arrows.points = np.stack([starts, starts + self._metres * rows[:, 3:]], axis=1).astype(np.float32)


PRINTS = 24  # of the latest ones are kept
PRINT, STANDS = (120, 130, 145), (38, 110, 200)
_FACES = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]], dtype=np.uint32)


def add_print(
    page: PrivatePage, name: str, corners: Array, colour: tuple[int, int, int], *, visible: bool = True
) -> viser.MeshHandle:
    """A footprint on the floor, of the corners (4, 3), m, of a sole."""
    points = corners.astype(np.float32)
    return page.scene.add_mesh_simple(
        name, points, _FACES, color=colour, opacity=0.55, flat_shading=True, visible=visible
    )


class LiveSteps:
    """Marks on the floor of a page."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, rest: Array, height: float) -> None:
        """Finds the feet of a robot that stands at rest (nq,) and is so high, m."""
        self._page = page
        feet = find_feet(model, rest)
        self._steps = StepWatch(feet, height)
        scene = page.scene
        self._floor = scene.add_frame("/steps", show_axes=False)
        self.marks = [
            scene.add_icosphere(f"/steps/contact{foot}", radius=0.03 * height, color=STANDS, opacity=0.6, visible=False)
            for foot in range(len(feet))
        ]
        self._prints = 0

    def show(self, data: mujoco.MjData, centre: Array, dt: float, *, visible: bool) -> None:
        """Marks what the feet do after dt more seconds, seen from the centre (2,), m."""
        self._floor.visible = visible
        if not visible:
            for mark in self.marks:
                mark.visible = False
            return
        left = self._steps(data, dt)
        self._floor.position = (-float(centre[0]), -float(centre[1]), 0.0)
        for foot, mark in enumerate(self.marks):
            mark.visible = bool(self._steps.stands[foot])
            mark.position = tuple(self._steps.corners[foot].mean(axis=0))
        for corners in left:
            add_print(self._page, f"/steps/print{self._prints % PRINTS}", corners, PRINT)
            self._prints += 1
