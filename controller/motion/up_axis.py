"""Detects the vertical axis of a file from how the body stands and touches the ground."""

from dataclasses import replace

import numpy as np

from controller.motion.clip import Clip, Up
from controller.motion.rotations import IDENTITY, Array, conjugate, multiply, normalise, rotate

AXES: tuple[Up, ...] = ("y", "z")
# Rotations from the axes of a file to ours (z up): (x, y, z) becomes (z, x, y), or stays.
TO_OURS = {"y": np.array([0.5, 0.5, 0.5, 0.5]), "z": IDENTITY}

UPRIGHT = 0.8  # cosine: a trunk within 37 degrees of the vertical stands
ERECT = 0.5  # cosine: a trunk farther from it lies, crawls or hangs head down
HIPS = (0.6, 1.3)  # height of the root of a standing body, in legs
GROUND = 0.2  # legs: a body is on the ground if its lowest joint is mostly this near to the height of the origin
MOSTLY = (10.0, 50.0, 90.0)  # percentiles of time
IN_PLACE = 0.05  # legs: a root that stays this near to the origin has lost its position


def turned_up(clip: Clip, was: Up, up: Up) -> Clip:
    """A clip that was read with one vertical axis of its file, as if read with another."""
    turn = multiply(TO_OURS[up], conjugate(TO_OURS[was]))
    rotation = multiply(np.broadcast_to(turn, clip.rotation.shape), clip.rotation)
    return replace(clip, root_position=rotate(turn, clip.root_position), rotation=rotation)


def up_in_recording(rest: Up, certain: bool, trunk: Array, root: Array, joints: Array, leg: float) -> Up:
    """The vertical axis while the body moves: that of its rest pose, unless the recording clearly has the other.

    A trunk along an axis may stand or lie: a lying body touches the ground along the other axis. `rest` is `certain` if
    the zero pose of the file stands along it. In the axes of the file: directions of the trunk (T, 3), positions of the
    root (T, 3) and of the joints of limbs and head (T, J, 3), m, and the length of a leg, m.
    """
    other: Up = "z" if rest == "y" else "y"
    trunk = normalise(trunk)
    height = float(np.median(rotate(TO_OURS[other], root)[:, 2])) / leg
    lies = _grounded(rest, joints, leg) and not _grounded(other, joints, leg)
    if _uprightness(other, trunk) > UPRIGHT and HIPS[0] < height < HIPS[1] and not lies:
        return other
    in_place = float(np.median(np.linalg.norm(root, axis=-1))) < IN_PLACE * leg
    if in_place or (certain and _uprightness(rest, trunk) > ERECT):
        return rest
    return other if _grounded(other, joints, leg) and not _grounded(rest, joints, leg) else rest


def _uprightness(up: Up, trunk: Array) -> float:
    return float(rotate(TO_OURS[up], trunk.mean(axis=0))[2])


def _grounded(up: Up, joints: Array, leg: float) -> bool:
    """Whether the body touches the ground most of the time with this vertical axis."""
    lowest = np.percentile(rotate(TO_OURS[up], joints)[..., 2].min(axis=1), MOSTLY)
    return bool(np.abs(lowest).max() < GROUND * leg)
