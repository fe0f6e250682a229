"""Arrays of joint positions: .npy of HumanML3D and KIT-ML, .npz with `joints` of any program.

    .npy    joints (T, 22, 3), 20 Hz, or KIT-ML's (T, 21, 3), 12.5 Hz; also the features (T, 263) and (T, 251) of both
    .npz    joints (T, J, 3), fps, and joint_names (J,) where the order is none of `joint_layouts.toml`

AIST++ and GVHMR keep theirs in pickles, which are never loaded: save the arrays as .npz (keypoints3d and fps). Of two
orders with the same number of joints that counts in which limbs keep their lengths, and sides are alike.

The features (Guo et al. 2022, "Generating Diverse and Natural 3D Human Motions from Text", section 3.2) hold the speed
of the root's heading and its path in it, its height, and the other joints relative to it and in its heading:

    h(t) = h(t-1) - 2 f0(t-1),  x(t) = x(t-1) + R(h(t)) (f1, 0, f2)(t-1),  y = f3,  joints = x + R(h) (f4, f5, ...)
"""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, FARTHEST, MOST_NUMBERS, Format, Markers, ReadingOptions, unit_of_size
from controller.motion.formats.markers.joint_points import joint_points, turned_over
from controller.motion.formats.npz_arrays import NpzArrays, npz_names, plain_array
from controller.motion.formats.smpl import JOINTS
from controller.motion.rotations import Array, about, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed, read_bytes

_JOINTS = ("joints", "joints3d", "joints_3d", "keypoints3d_optim", "keypoints3d", "keypoints_3d", "joint_positions")
_NAMES = ("joint_names", "keypoint_names", "names", "labels")
_RATES = {22: 20.0, 21: 12.5}  # Hz, of HumanML3D and KIT-ML, by joints
_FEATURES = {263: 22, 251: 21}  # their joints, by features
_UPWARDS = np.array([0.0, 1.0, 0.0])
_LAYOUTS = {"SMPL": JOINTS, "SMPL with hands": (*JOINTS, "left_hand_end", "right_hand_end")}
for _name, _joints in tomllib.loads(Path(__file__).with_name("joint_layouts.toml").read_text(encoding="utf-8")).items():
    _LAYOUTS[_name] = tuple(_joints.split())
MEDIAPIPE = _LAYOUTS["MediaPipe"]
_MOST_CHANGE = 0.35  # of a limb's length: more has no body, however noisy its estimator


def read_joint_arrays(path: str | Path, options: ReadingOptions = AS_FOUND) -> Markers:
    """The points in the joints of a person; axis, and the rate of a .npy, are those of the options."""
    if Path(path).suffix.lower() == ".npy":
        position = plain_array(read_bytes(path), f"{path}: the array")
        if position.ndim == 2 and position.shape[1] in _FEATURES:
            if not (np.abs(position) < FARTHEST).all():
                raise FileFormatError(f"{path}: a feature is no number or impossibly large. Save it again.")
            position = _from_features(position, _FEATURES[position.shape[1]])
        names, usual = None, _RATES.get(position.shape[1]) if position.ndim == 3 else 0.0
        rate = float(options.rate) if isinstance(options.rate, int | float) else usual
        if rate is None:
            raise FileFormatError(
                f"{path}: a .npy has no rate. Save .npz with arrays 'joints' and 'fps', or give rate in a recipe."
            )
    else:
        arrays = NpzArrays(path)
        found = arrays.first(*_JOINTS)
        if found is None:
            raise FileFormatError(f"{path}: no array 'joints' (it holds {listed(arrays.names) or 'nothing'}).")
        position, names, rate = found, arrays.words(*_NAMES), arrays.rate()
    if position.ndim == 4 and len(position) == 1:
        position = position[0]
    if position.ndim != 3 or position.shape[2] != 3 or not 0 < position.size <= MOST_NUMBERS:
        people = " Save each person alone." if position.ndim == 4 else ""
        raise FileFormatError(f"{path}: joints of shape {position.shape}, expected (frames, joints, 3).{people}")
    position = np.where((np.abs(position).max(axis=-1) < FARTHEST)[..., None], position, np.nan)
    if np.isnan(position).all():
        raise FileFormatError(f"{path}: no joint has a position. Save it again.")
    position *= options.unit or unit_of_size(position)
    points = Markers((), rate, position, options.up, Path(path).name)
    if names is None:
        points = labelled(points, path)
    elif len(names) != position.shape[1] or len(set(names)) < len(names):
        raise FileFormatError(f"{path}: {len(names)} joint_names for {position.shape[1]} joints, or two alike.")
    points = Markers(options.renamed(names or points.labels, path), rate, position, options.up, points.source)
    return points if options.up else turned_over(points)


def _from_features(features: Array, joints: int) -> Array:
    """The positions (T, J, 3), y up, of J joints from their features."""
    before = np.concatenate([np.zeros((1, 3)), features[:-1, :3]])  # of the step to this frame
    heading = about(_UPWARDS, -2.0 * np.cumsum(before[:, 0]))
    steps = rotate(heading, np.stack([before[:, 1], np.zeros(len(before)), before[:, 2]], axis=-1))
    root = np.cumsum(steps, axis=0)
    local = features[:, 4 : 4 + 3 * (joints - 1)].reshape(len(features), joints - 1, 3)
    others = rotate(heading[:, None], local) + root[:, None]
    root[:, 1] = features[:, 3]
    return np.concatenate([root[:, None], others], axis=1)


def _holds_joints(path: Path) -> bool:
    if path.suffix.lower() == ".npy":
        return True
    names = npz_names(path)
    return any(name in names for name in _JOINTS) and not names & {"trans", "transl", "smpl_trans"}


def labelled(points: Markers, path: str | Path) -> Markers:
    """Points (T, J, 3) without names, named by the order of joints that fits; FileFormatError if none does."""
    count = points.position.shape[1]
    orders = {name: joints for name, joints in _LAYOUTS.items() if len(joints) == count}
    named = "Save it as .npz with arrays 'joints', 'fps' and 'joint_names'."
    if not orders:
        known = ", ".join(f"{len(joints)} ({name})" for name, joints in _LAYOUTS.items())
        raise FileFormatError(f"{path}: {count} joints without names; known are {known}. {named}")
    found = [replace(points, labels=joints) for joints in orders.values()]
    change, best = min(((_limbs_change(one), index) for index, one in enumerate(found)))
    if not change < _MOST_CHANGE:
        raise FileFormatError(
            f"{path}: as joints of {' or '.join(orders)}, limbs change their length by {100.0 * change:.0f} %. {named}"
        )
    return found[best]


def _limbs_change(points: Markers) -> float:
    """How much limbs change over time and from left to right, over their length: upper quartile, mean of the limbs."""
    joints = joint_points(points)
    changes: list[float] = []
    for start, end in (("hip", "kne"), ("kne", "ank"), ("sho", "elb"), ("elb", "wri")):
        if not all(side + joint in joints for side in "lr" for joint in (start, end)):
            return np.inf
        lengths = np.linalg.norm([joints[side + end] - joints[side + start] for side in "lr"], axis=-1)
        usual = float(np.median(lengths)) + 1e-12
        changes.append(float(np.quantile(np.abs(lengths - usual), 0.75)) / usual)
    return float(np.mean(changes))


FORMAT = Format(suffixes=(".npy", ".npz"), read=read_joint_arrays, matches=_holds_joints)
