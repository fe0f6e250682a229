"""Directions of a human's limbs in the frame of the trunk: the input of retargeting.

Arms and head are seen from the chest, legs and chest from the pelvis (the root): a robot without a waist then holds its
arms to its trunk as the human does.
"""

from __future__ import annotations

import numpy as np

from controller.motion.anatomy import Part, Side, anatomy, leg_without_name
from controller.motion.posture import Pose
from controller.motion.rotations import Array, conjugate, multiply
from controller.motion.skeleton import ROOT, Skeleton
from motiondeck_base.errors import FileFormatError

# The rows of a view; the last four are axes of head and chest.
LIMBS = (
    *("r_upper_arm", "r_forearm", "l_upper_arm", "l_forearm"),
    *("r_thigh", "r_shank", "r_foot", "l_thigh", "l_shank", "l_foot"),
    *("head_ahead", "head_left", "chest_ahead", "chest_left"),
)
AHEAD, LEFT = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])

# conj(p) q = (left multiplication by conj(p)) q: where each entry of that 4 x 4 matrix sits in p, and its sign.
ENTRY = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
SIGN = np.array([[1.0, 1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, -1.0, 1.0]])


class LimbView:
    """Directions of one skeleton's limbs with their `length` (14,), m; FileFormatError if a limb is missing."""

    def __init__(self, skeleton: Skeleton) -> None:
        lacks = leg_without_name(skeleton)
        if lacks is not None:
            raise FileFormatError(f"skeleton '{skeleton.name}' has no {lacks} leg; the robot needs one")
        parts = anatomy(skeleton)

        def bone(part: Part, side: Side) -> int:
            found = parts.first(part, side)
            if found is None:
                raise FileFormatError(f"skeleton '{skeleton.name}' has no {side} {part}; the robot needs one")
            return found

        shoulder = parts.first("clavicle", "right")
        chest = int(skeleton.parent[bone("upper arm", "right") if shoulder is None else shoulder])
        arms = [bone(part, side) for side in ("right", "left") for part in ("upper arm", "forearm")]
        legs = [bone(part, side) for side in ("right", "left") for part in ("thigh", "shank", "foot")]
        head = parts.first("head")
        bones = [*arms, *legs, *([chest if head is None else head] * 2), chest, chest]
        seen_from = [chest] * len(arms) + [ROOT] * len(legs) + [chest, chest, ROOT, ROOT]
        vector = [*skeleton.rest_direction[[*arms, *legs]], AHEAD, LEFT, AHEAD, LEFT]
        self.length = np.concatenate([skeleton.length[[*arms, *legs]], np.ones(4)])
        # Indices of the quaternions' entries, and of their matrices', in a pose's flat rotations.
        self._quaternions = (4 * (np.array(bones) + 1)[:, None] + np.arange(4))[:, :, None]
        self._entries = 4 * (np.array(seen_from) + 1)[:, None, None] + ENTRY
        self._turn = np.stack([turning(v) for v in vector])

    def __call__(self, pose: Pose) -> Array:
        """The unit vectors of LIMBS, shape (14, 3)."""
        flat = pose.rotation.ravel()
        q = np.matmul(flat.take(self._entries) * SIGN, flat.take(self._quaternions))
        products = np.matmul(q, q.transpose(0, 2, 1)).reshape(len(q), 1, 16)
        return np.matmul(products, self._turn)[:, 0]


def up_of(pose: Pose) -> tuple[float, float, float]:
    """The vertical in the frame of the root."""
    w, x, y, z = pose.rotation[0].tolist()
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


# e_i v e_j* for the units of quaternions e_i, e_j and each axis v: shape (16, 3, 3), the last of the vector.
_UNITS = np.eye(4)
_TURNS = multiply(multiply(_UNITS[:, None, None], _UNITS[1:]), conjugate(_UNITS)[:, None])[..., 1:].reshape(16, 3, 3)


def turning(v: Array) -> Array:
    """The matrix that turns the 16 products q_i q_j of a quaternion into the vector q v q*, shape (16, 3)."""
    return np.einsum("pvo,v->po", _TURNS, v)
