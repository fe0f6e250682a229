"""Tucked: the pose in which a human falls with least harm, hips bent as on a chair and forearms before the face.

Of the poses tried on servo20, this one lowers the speeds and forces of trunk, head and arms in falls to all sides
together: legs that are bent further let the trunk hit the floor harder, arms at the sides leave it to the head.
"""

from __future__ import annotations

import math

import numpy as np

from controller.mocap.anatomy import Part, anatomy
from controller.mocap.posture import Pose
from controller.mocap.skeleton import ROOT, Skeleton
from controller.rotations import Array, between

# How far limbs are raised forwards from where they point straight down, rad; a foot is straight ahead at zero.
_RAISED: dict[Part, float] = {
    "thigh": 1.6,
    "shank": 0.4,
    "foot": 0.4 + 0.5 * math.pi,
    "upper arm": 0.9,
    "forearm": 3.1,
    "hand": 3.1,
}


def tucked_pose(skeleton: Skeleton) -> Pose:
    """The pose, with an upright trunk at the height of a standing root, heading along x."""
    parts = anatomy(skeleton).part
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(skeleton), 1))
    for bone, (part, parent) in enumerate(zip(parts, skeleton.parent, strict=True)):
        raised = _RAISED.get(part)
        if raised is not None:
            rotation[1 + bone] = between(skeleton.rest_direction[bone], _direction(raised))
        elif parent != ROOT:
            rotation[1 + bone] = rotation[1 + parent]
    return Pose(np.array([0.0, 0.0, skeleton.leg_length]), np.zeros(()), rotation)


def _direction(raised: float) -> Array:
    return np.array([math.sin(raised), 0.0, -math.cos(raised)])
