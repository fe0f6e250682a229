"""Steps: when the feet of a motion stand on the ground, and the prints they leave there."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import runs
from controller.motion.rotations import Array
from sim.models.feet import Foot
from sim.models.scenery import body_height

# A foot stands if its lowest corner is so near the ground, in heights of the body, and so slow, in heights a second.
NEAR = 0.025
STILL = 0.3
MOMENT = 0.1  # s
RISE = 0.5  # 1/s, so fast the ground follows the lowest foot upwards; down it follows at once
LIFTED = 0.004  # heights: prints are drawn so far above the floor, or they would flicker


@dataclass(frozen=True)
class Print:
    """Where a foot stood."""

    foot: int  # which one
    first: int  # the first and the last frame in which it stood
    last: int
    corners: Array  # of its sole on the floor, shape (4, 3), m


def soles(model: mujoco.MjModel, frames: Array, feet: Sequence[Foot]) -> Array:
    """Where the corners of the feet are, shape (T, F, 4, 3), m, in frames of qpos (T, nq)."""
    data, out = mujoco.MjData(model), np.empty((len(frames), len(feet), 4, 3))
    for frame, qpos in enumerate(frames):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        for index, foot in enumerate(feet):
            out[frame, index] = _corners(foot, data)
    return out


def _corners(foot: Foot, data: mujoco.MjData) -> Array:
    body = data.body(foot.body)
    return body.xpos + foot.corners @ body.xmat.reshape(3, 3).T


def standing(corners: Array, rate: float, height: float) -> NDArray[np.bool_]:
    """Which feet stand, shape (T, F), given their corners (T, F, 4, 3), m, at a rate in Hz, for a body so high, m."""
    # The ground is where the lowest corners are most of the time: recordings know it only to some centimetres. A foot
    # that trembles off it for a moment goes on standing, one that brushes it does not stand.
    low = corners[..., 2].min(axis=2)
    ground = np.quantile(low.min(axis=1), 0.2) if low.size else 0.0
    middle = corners.mean(axis=2)
    step = np.diff(middle, axis=0, prepend=middle[:1])
    speed = np.linalg.norm(step, axis=-1) * rate
    stands = (low < ground + NEAR * height) & (speed < STILL * height)
    for foot in range(stands.shape[1]):
        for first, end in runs(~stands[:, foot]):
            if end - first <= MOMENT * rate and first > 0 and end < len(stands):
                stands[first:end, foot] = True
        for first, end in runs(stands[:, foot]):
            if end - first <= MOMENT * rate and end - first < len(stands):
                stands[first:end, foot] = False
    return stands


def footprints(model: mujoco.MjModel, corners: Array, stands: NDArray[np.bool_]) -> list[Print]:
    """One print for each time that a foot stands, drawn where it stood in the middle of that time."""
    prints: list[Print] = []
    for foot in range(stands.shape[1]):
        for first, end in runs(stands[:, foot]):
            flat = corners[(first + end) // 2, foot].copy()
            flat[:, 2] = LIFTED * body_height(model)
            prints.append(Print(foot, first, end - 1, flat))
    return sorted(prints, key=lambda p: p.first)


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
        corners = np.array([_corners(foot, data) for foot in self._feet])
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
