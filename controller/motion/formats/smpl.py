"""Motions of the SMPL family's bodies (.npz): AMASS, SMPL-H, SMPL-X.

The file holds the rotation vector of every joint relative to its parent, and `trans`, the translation of the body:
AMASS has one array `poses`, its SMPL-X releases also `root_orient` and `pose_body`, the models' programs
`global_orient` and `body_pose`. The first 22 joints are the same in all models; hands and face are left out. The
model's axes are x left, y up, z forward; AMASS rotates them into a world with z up.

The joint positions of a person are in the licensed body model. Given that (`SMPLX_NEUTRAL.npz`, or the `model.npz` of
SMPL-H), joints are J = J_regressor (v_template + shapedirs betas) (Loper et al. 2015, eq. 10). Without it, the
rotations are applied to a body of average proportions (Winter 2009, fig. 4.1) in the pose of the models' template.
"""

from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.formats.npz_arrays import NpzArrays
from controller.motion.joint_tree import MOST_POSES, clip_of, played
from controller.motion.rest_pose import STATURE
from controller.motion.rotations import Array, from_rotation_vector
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

LARGEST_ANGLE = 100.0  # rad: a longer vector is not a rotation

JOINTS = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
PARENT = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)

# Lengths of an average body over its stature, and the directions of its limbs in the template: sideways, up, forward.
_LIMBS: dict[str, tuple[float, tuple[float, float, float]]] = {
    "spine1": (0.065, (0.0, 1.0, -0.2)),
    "spine2": (0.080, (0.0, 1.0, 0.0)),
    "spine3": (0.030, (0.0, 1.0, 0.5)),
    "neck": (0.100, (0.0, 1.0, -0.2)),
    "head": (0.095, (0.0, 1.0, 0.1)),
    "hip": (0.068, (0.55, -0.85, -0.2)),
    "knee": (0.245, (0.13, -1.0, -0.03)),
    "ankle": (0.246, (-0.07, -1.0, -0.07)),
    "foot": (0.090, (0.37, -0.5, 1.0)),
    "collar": (0.060, (0.5, 0.9, -0.1)),
    "shoulder": (0.075, (1.0, 0.45, -0.15)),
    "elbow": (0.172, (1.0, -0.2, -0.13)),
    "wrist": (0.157, (1.0, 0.03, -0.03)),
}
# Depth of the pelvis below the origin of a template, m: SMPL and SMPL-H, SMPL-X.
_PELVIS_BELOW = {"SMPL": 0.24, "SMPL-X": 0.35}


def read_smpl(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in an .npz file of the SMPL family."""
    arrays = NpzArrays(path)
    root = arrays.first("root_orient", "global_orient")
    if root is not None:
        body = arrays.first("pose_body", "body_pose")
        pose = None if body is None else np.concatenate([_rows(root), _rows(body)[:, :63]], axis=1)
        width = 165
    else:
        poses = arrays.first("poses", "pose", "smpl_poses", "fullpose")
        pose = None if poses is None else _rows(poses)
        width = 0 if pose is None else pose.shape[1]
    trans = arrays.first("trans", "transl", "smpl_trans")
    if pose is None or trans is None:
        raise FileFormatError(
            f"{path}: this .npz is no motion of a body: it holds {listed(arrays.names) or 'nothing'}. Expected are "
            "poses (or root_orient and pose_body), trans and mocap_framerate, as AMASS writes them, or joints (frames, "
            "joints, 3) and fps."
        )
    hertz = arrays.rate()
    if (scaling := arrays.first("smpl_scaling")) is not None and scaling.size and scaling.ravel()[0] > 0.0:
        trans = trans / scaling.ravel()[0]  # AIST++: in cm or so
    trans = _rows(trans)
    frames = len(pose)
    if frames == 0 or pose.shape[1] < 66 or trans.shape != (frames, 3):
        raise FileFormatError(f"{path}: rotations {pose.shape} and trans {trans.shape} are no frames of 22 joints.")
    if frames * len(JOINTS) > MOST_POSES:
        raise FileFormatError(f"{path}: {frames} frames are more than fit into memory. Cut the recording into pieces.")
    vectors = pose[:, :66].reshape(frames, len(JOINTS), 3)
    bad = ~(np.abs(vectors).max(axis=(1, 2)) < LARGEST_ANGLE) | ~(np.abs(trans).max(axis=1) < 1e9)
    if bad.any():
        raise FileFormatError(f"{path}: frame {int(np.argmax(bad))} holds a number that is no angle or position.")

    model = "SMPL-X" if width >= 165 else "SMPL"
    joints = average_joints(model) if options.skeleton is None else _joints_of(options.skeleton, arrays.first("betas"))
    offset = joints - np.where(np.array(PARENT)[:, None] >= 0, joints[list(PARENT)], 0.0)
    place = np.broadcast_to(offset, (frames, *offset.shape)).copy()
    place[:, 0] += trans
    tree = played(JOINTS, PARENT, place, from_rotation_vector(vectors), np.ones(len(JOINTS), dtype=np.bool_))
    amass = any(name in arrays.names for name in ("mocap_framerate", "mocap_frame_rate"))
    return clip_of(tree, hertz, path, options, unit=1.0, up="z" if amass else None)


def average_joints(model: str) -> Array:
    """Positions of the 22 joints of an average body in the template of a model, shape (22, 3), m; x left, y up."""
    joints = np.zeros((len(JOINTS), 3))
    joints[0, 1] = -_PELVIS_BELOW[model]
    for joint, name in enumerate(JOINTS[1:], 1):
        side, _, limb = name.rpartition("_")
        length, (out, up, forward) = _LIMBS[limb]
        way = np.array([-out if side == "right" else out, up, forward])
        joints[joint] = joints[PARENT[joint]] + STATURE * length * way / np.linalg.norm(way)
    return joints


def _joints_of(model: Path, betas: Array | None) -> Array:
    """Positions of the first 22 joints of a body model for a person's shape, shape (22, 3), m."""
    arrays = NpzArrays(model)
    regressor, vertices, shapes = (arrays.first(name) for name in ("J_regressor", "v_template", "shapedirs"))
    if regressor is None or vertices is None:
        raise FileFormatError(
            f"{model}: no body model: it holds {listed(arrays.names) or 'nothing'}, but J_regressor and v_template are "
            "needed. Give SMPLX_NEUTRAL.npz, or the model.npz of SMPL-H."
        )
    if vertices.ndim != 2 or vertices.shape[1] != 3 or regressor.ndim != 2 or regressor.shape[1] != len(vertices):
        raise FileFormatError(f"{model}: its arrays do not belong together. Fetch the model again.")
    if len(regressor) < len(JOINTS):
        raise FileFormatError(f"{model}: a model of {len(regressor)} joints, but a body has 22. Give another.")
    if betas is not None and shapes is not None and shapes.ndim == 3 and shapes.shape[:2] == vertices.shape:
        count = min(betas.size, shapes.shape[2], 10)
        vertices = vertices + shapes[..., :count] @ betas.ravel()[:count]
    joints = regressor[: len(JOINTS)] @ vertices
    if not (np.abs(joints) < 10.0).all():
        raise FileFormatError(f"{model}: a joint would be more than 10 m away. Fetch the model again.")
    return joints


def _rows(array: Array) -> Array:
    return array.reshape(len(array), int(np.prod(array.shape[1:]))) if array.ndim else np.zeros((0, 0))


FORMAT = Format(suffixes=(".npz",), read=read_smpl, general=True)
