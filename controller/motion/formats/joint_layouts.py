"""Orders of joints in arrays without names, of data sets and pose estimators; they are in `joint_layouts.toml`.

Of two orders with the same number of joints the one counts in which limbs keep their lengths, and left and right are
alike.
"""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.motion.formats.markers.joint_points import joint_points
from controller.motion.formats.smpl import JOINTS
from controller.motion.markers import Markers
from motiondeck_base.errors import FileFormatError

_LAYOUTS = {"SMPL": JOINTS, "SMPL with hands": (*JOINTS, "left_hand_end", "right_hand_end")}
for _name, _joints in tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")).items():
    _LAYOUTS[_name] = tuple(_joints.split())
MEDIAPIPE = _LAYOUTS["MediaPipe"]
_MOST_CHANGE = 0.35  # of a limb's length: more has no body, however noisy its estimator


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
        limbs = [joints[side + end] - joints[side + start] for side in "lr"]
        lengths = np.linalg.norm(limbs, axis=-1)
        usual = float(np.median(lengths)) + 1e-12
        changes.append(float(np.quantile(np.abs(lengths - usual), 0.75)) / usual)
    return float(np.mean(changes))
