"""Steps: when feet stand on the ground, and the prints they leave there; in a clip as in a run."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from sim.models.feet import Foot
from sim.models.scenery import body_height

# A foot stands if its lowest corner is so near the ground, in heights of the body, and so slow, in heights a second.
NEAR = 0.025
STILL = 0.3
MOMENT = 0.1  # s
RISE = 0.5  # 1/s, so fast the ground follows the lowest foot upwards; down it follows at once
LIFTED = 0.004  # heights: prints are drawn so far above the floor, or they would flicker


class Print(NamedTuple):
    """Where a foot has stood from a frame on."""

    frame: int
    corners: Array  # of its sole on the floor, shape (4, 3), m


def followed(
    model: mujoco.MjModel, frames: Array, feet: Sequence[Foot], rate: float
) -> tuple[Array, NDArray[np.bool_], list[Print]]:
    """What a `StepWatch` sees in frames of qpos (T, nq) at a rate, Hz: soles (T, F, 4, 3), m, stands (T, F), prints."""
    data, watch = mujoco.MjData(model), StepWatch(feet, body_height(model))
    soles, stands, prints = [], [], list[Print]()
    for frame, qpos in enumerate(frames):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        prints += [Print(frame, corners) for corners in watch(data, 1.0 / rate)]
        soles.append(watch.corners)
        stands.append(watch.stands)
    return np.array(soles), np.array(stands), prints


class StepWatch:
    """Sees, picture by picture, which feet of a running robot stand and which have left a print."""

    def __init__(self, feet: Sequence[Foot], height: float) -> None:
        """Args: the feet of the robot, and how high it is, m."""
        self._feet, self._height = feet, height
        self.corners = np.zeros((len(feet), 4, 3))  # of the soles at the last picture, shape (F, 4, 3), m
        self.stands = np.zeros(len(feet), dtype=bool)  # which feet stand, shape (F,)
        self._started, self._ground = False, np.inf
        self._stood = np.zeros(len(feet))  # s

    def __call__(self, data: mujoco.MjData, dt: float) -> list[Array]:
        """The corners (4, 3), m, of the prints that are left dt seconds after the last picture."""
        if not self._feet:
            return []
        bodies = ((foot, data.body(foot.body)) for foot in self._feet)
        corners = np.array([body.xpos + foot.corners @ body.xmat.reshape(3, 3).T for foot, body in bodies])
        before = self.corners if self._started else corners
        self.corners, self._started = corners, True
        low = corners[..., 2].min(axis=1)
        self._ground = min(low.min(), self._ground + RISE * dt * max(low.min() - self._ground, 0.0))
        speed = np.linalg.norm(corners.mean(axis=1) - before.mean(axis=1), axis=1) / max(dt, 1e-3)
        self.stands = (low < self._ground + NEAR * self._height) & (speed < STILL * self._height)
        stood = np.where(self.stands, self._stood + dt, 0.0)
        left = [corners[foot].copy() for foot in np.flatnonzero((self._stood < MOMENT) & (stood >= MOMENT))]
        self._stood = stood
        for flat in left:
            flat[:, 2] = LIFTED * self._height
        return left
