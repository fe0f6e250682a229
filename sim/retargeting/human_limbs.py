"""Directions of a human's limbs and trunk in the world, from joint points: the input of retargeting.

The chest is the frame of the trunk's line, from the middle of the hips to that of the shoulders, and of the line
through the shoulders. The pelvis is turned back from it about the line through the hips as far as both thighs are
raised towards the trunk, because spines round in sitting and bending. The zero of a recorded root or chest has no part
in them: recordings differ in it by up to 20 degrees.
"""

from collections.abc import Sequence
from math import cos, sin, sqrt

import numpy as np

from controller.motion.anatomy import Part, Side, anatomy, leg_without_name
from controller.motion.rotations import Array, conjugate, multiply
from controller.motion.skeleton import ROOT, Pose, Skeleton
from motiondeck_base.errors import FileFormatError

# The rows of a view; six are axes of head, chest and pelvis.
LIMBS = (
    *("r_upper_arm", "r_forearm", "l_upper_arm", "l_forearm"),
    *("r_thigh", "r_shank", "r_foot", "l_thigh", "l_shank", "l_foot"),
    *("head_ahead", "head_left", "chest_ahead", "chest_left", "pelvis_ahead", "pelvis_left"),
    *("r_arm_hand", "l_arm_hand"),
)
Vector = Sequence[float]
AHEAD, LEFT, UP = np.eye(3)
BEND = 0.4  # between pelvis and chest when sitting upright with level thighs, rad
FAINT = 1e-3  # m: weight of the root's or chest's own axes where a skeleton's hips or shoulders are in one place


class LimbView:
    """Directions of one skeleton's limbs with their `length` (18,), m; FileFormatError if a limb is missing."""

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

        arms = [bone(part, side) for side in ("right", "left") for part in ("upper arm", "forearm")]
        legs = [bone(part, side) for side in ("right", "left") for part in ("thigh", "shank", "foot")]
        bones, head = [*arms, *legs], parts.first("head")
        # A hand that no bone tells of is straight.
        hands = [parts.first("hand", side) or arm for side, arm in zip(("right", "left"), arms[1::2], strict=True)]
        chest = int(skeleton.parent[arms[0]])
        self.length = np.concatenate([skeleton.length[bones], np.ones(len(LIMBS) - len(bones))])
        # Each row is a sum of vectors that turn with the root and the bones.
        vectors = np.zeros((len(bones) + 7, 1 + len(skeleton), 3))
        vectors[[*range(len(bones)), -5, -4], 1 + np.array(bones + hands)] = skeleton.rest_direction[bones + hands]
        vectors[[-7, -6], 1 + (chest if head is None else head)] = AHEAD, LEFT
        right, left, right_hip, left_hip = (_way_to(skeleton, one) for one in (arms[0], arms[2], legs[0], legs[3]))
        lines = 0.5 * (right + left - right_hip - left_hip), left - right, left_hip - right_hip
        vectors[-3:, 1:] = np.stack(lines)[:, :, None]
        moves = np.flatnonzero(vectors.any(axis=(0, 2)) | np.isin(np.arange(1 + len(skeleton)), (0, 1 + chest)))
        self._lines = vectors[-3:, moves]  # the share of each moving bone in a line, shape (3, N, 3)
        self._faint = np.zeros_like(self._lines)
        for row, at, axis in zip(range(3), (0, 1 + chest, 0), (UP, LEFT, LEFT), strict=True):
            self._faint[row, moves == at] = FAINT * axis
        self._entries = (4 * moves[:, None] + np.arange(4)).ravel()
        self._turn = np.zeros((16 * len(moves), 3 * len(vectors)))
        self._turn[:, :-9] = _turns(vectors[:-3, moves])
        self._bones, self._skeleton_offsets = np.maximum(moves - 1, 0), skeleton.offsets
        self._offsets: Array | None = None
        self._fit(None)

    def _fit(self, offsets: Array | None) -> None:
        """Takes the lines of trunk, shoulders and hips of a body with other offsets (B, 3), m; None: the skeleton's."""
        self._offsets = offsets
        own = (self._skeleton_offsets if offsets is None else offsets)[self._bones]
        self._turn[:, -9:] = _turns(self._lines * own + self._faint)

    def __call__(self, pose: Pose) -> Array:
        """The unit vectors of LIMBS in the world, shape (18, 3)."""
        if pose.offsets is not self._offsets:
            self._fit(pose.offsets)
        q = pose.rotation.ravel().take(self._entries).reshape(-1, 4)
        rows = ((q[:, :, None] * q[:, None, :]).ravel() @ self._turn).reshape(-1, 3)
        found = np.empty((len(LIMBS), 3))
        found[:12], found[16:] = rows[:12], rows[12:14]
        line, shoulders, hips = rows[14:].tolist()
        chest_ahead, chest_left, (ux, uy, uz) = _axes(line, shoulders)
        bend = 0.5 * BEND * float((rows[4] + rows[7]) @ chest_ahead)
        c, s, (ax, ay, az) = cos(bend), sin(bend), chest_ahead
        pelvis_ahead, pelvis_left, _ = _axes((c * ux - s * ax, c * uy - s * ay, c * uz - s * az), hips)
        found[12:16] = chest_ahead, chest_left, pelvis_ahead, pelvis_left
        return found


def _way_to(skeleton: Skeleton, bone: int) -> Array:
    """Which bones lie between the root and the beginning of a bone, shape (B,)."""
    parent = int(skeleton.parent[bone])
    return np.zeros(len(skeleton)) if parent == ROOT else skeleton.chain[parent].astype(float)


def _axes(up: Vector, across: Vector) -> tuple[Vector, Vector, Vector]:
    """The unit vectors ahead, left and up of a frame, for a line up and one that points roughly left."""
    # By components and in one function, for speed.
    (ux, uy, uz), (x, y, z) = up, across
    length = sqrt(ux * ux + uy * uy + uz * uz) or 1.0
    ux, uy, uz = ux / length, uy / length, uz / length
    along = x * ux + y * uy + z * uz
    x, y, z = x - along * ux, y - along * uy, z - along * uz
    length = sqrt(x * x + y * y + z * z) or 1.0
    x, y, z = x / length, y / length, z / length
    return (y * uz - z * uy, z * ux - x * uz, x * uy - y * ux), (x, y, z), (ux, uy, uz)


# e_i v e_j* for the units of quaternions e_i, e_j and each axis v: shape (16, 3, 3), the last of the vector.
_UNITS = np.eye(4)
_TURNS = multiply(multiply(_UNITS[:, None, None], _UNITS[1:]), conjugate(_UNITS)[:, None])[..., 1:].reshape(16, 3, 3)


def _turns(vectors: Array) -> Array:
    """The matrix from products q_i q_j of N quaternions to sums (3 R) of vectors (R, N, 3) that they turn."""
    return np.einsum("pvo,rbv->bpro", _TURNS, vectors).reshape(16 * vectors.shape[1], -1)


def turning(v: Array) -> Array:
    """The matrix that turns the 16 products q_i q_j of a quaternion into the vector q v q*, shape (16, 3)."""
    return np.einsum("pvo,v->po", _TURNS, v)
