"""Symmetric poses for falling and rising: both legs alike, both arms alike.

Of the poses tried on servo20, TUCKED gave the lowest speeds and forces of trunk, head and arms in falls to all sides:
with more bent legs the trunk hits the floor harder, with arms at the sides the head does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.motion.anatomy import Part, anatomy
from controller.motion.posture import Pose
from controller.motion.rotations import Array, between
from controller.motion.skeleton import ROOT, Skeleton


class Bends(NamedTuple):
    """Bends from a straight body with hanging arms, rad: thighs and upper arms forwards, toes towards the shanks."""

    hip: float
    knee: float
    ankle: float
    shoulder: float
    elbow: float


# Hips bent as on a chair, forearms before the face.
TUCKED = Bends(hip=1.6, knee=1.2, ankle=0.0, shoulder=0.9, elbow=2.2)


def symmetric_pose(skeleton: Skeleton, bends: Bends) -> Pose:
    """The pose, with an upright trunk at the height of a standing root, heading along x."""
    shank, forearm = bends.hip - bends.knee, bends.shoulder + bends.elbow
    # Angles forwards from straight down.
    raised: dict[Part, float] = {
        "thigh": bends.hip,
        "shank": shank,
        "foot": shank + 0.5 * math.pi + bends.ankle,
        "upper arm": bends.shoulder,
        "forearm": forearm,
        "hand": forearm,
    }
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(skeleton), 1))
    for bone, (part, parent) in enumerate(zip(anatomy(skeleton).part, skeleton.parent, strict=True)):
        if part in raised:
            rotation[1 + bone] = between(skeleton.rest_direction[bone], _direction(raised[part]))
        elif parent != ROOT:
            rotation[1 + bone] = rotation[1 + parent]
    return Pose(np.array([0.0, 0.0, skeleton.leg_length]), np.zeros(()), rotation)


def _direction(raised: float) -> Array:
    return np.array([math.sin(raised), 0.0, -math.cos(raised)])
