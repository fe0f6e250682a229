"""A robot beside the human whose motion it plays, in a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.library.motion_library import load_library
from controller.motion.clip import Clip
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from motiondeck_base.errors import UnknownNameError
from motiondeck_base.shipped import find_library, find_robot

RATE = 60.0
MOMENTS = 8
TILE = (480, 440)  # pixels: knees of a robot beside a human can be told at this size


def played(library: str, motion: str, seconds: float) -> Clip:
    """What a library plays of a motion, as a clip at RATE.

    Raises:
        UnknownNameError: if there is no such library or motion.
    """
    loaded = load_library(find_library(library))
    if motion not in loaded.network.motions:
        raise UnknownNameError.among("motion", motion, loaded.network.motions)
    from motiondeck.run.sampled_motions import as_clip

    return as_clip(loaded, motion, seconds, RATE)


def draw_beside(clip: Clip, robot: Path, out: Path) -> None:
    """Two rows of moments of a clip: the human, and beside it the robot."""
    from motiondeck.pictures.side_by_side import SideBySide
    from motiondeck.pictures.video import contact_sheet

    both = SideBySide(clip.skeleton, find_robot("mannequin"), robot, 1.0 / clip.rate)
    every = max(1, len(clip) // MOMENTS)
    row: list[Array] = []
    for frame in range(every * MOMENTS):
        qpos = both.qpos(Pose(clip.root_position[frame], np.zeros(()), clip.rotation[frame]))
        if frame % every == every - 1:
            row.append(qpos.copy())
    contact_sheet(both.model, [(clip.name, row[:4]), ("", row[4:])], out, TILE)
