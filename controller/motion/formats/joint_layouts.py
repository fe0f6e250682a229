"""Orders of joints in arrays without names: of data sets and pose estimators, by the number of joints.

Of two orders with the same number the one counts in which limbs keep their lengths, and left and right are alike.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.motion.formats.markers.joint_points import joint_points
from controller.motion.formats.smpl import JOINTS
from controller.motion.markers import Markers
from motiondeck_base.errors import FileFormatError

_MEDIAPIPE = (
    "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear right_ear "
    "mouth_left mouth_right left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist left_pinky "
    "right_pinky left_index right_index left_thumb right_thumb left_hip right_hip left_knee right_knee left_ankle "
    "right_ankle left_heel right_heel left_foot_index right_foot_index"
)
_COCO = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
    "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
)
_HUMAN36M = (
    "pelvis right_hip right_knee right_ankle left_hip left_knee left_ankle spine neck nose head left_shoulder "
    "left_elbow left_wrist right_shoulder right_elbow right_wrist"
)
_KIT = (
    "pelvis spine1 spine2 neck head right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist "
    "right_hip right_knee right_ankle right_foot right_toe_end left_hip left_knee left_ankle left_foot left_toe_end"
)
_BODY_25 = (
    "nose neck right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist pelvis right_hip right_knee "
    "right_ankle left_hip left_knee left_ankle right_eye left_eye right_ear left_ear left_foot left_small_toe "
    "left_heel right_foot right_small_toe right_heel"
)
MEDIAPIPE = tuple(_MEDIAPIPE.split())
_LAYOUTS = {
    "SMPL": JOINTS,  # also HumanML3D's
    "SMPL with hands": (*JOINTS, "left_hand_end", "right_hand_end"),
    "KIT-ML": tuple(_KIT.split()),
    "COCO": tuple(_COCO.split()),  # AIST++
    "Human3.6M": tuple(_HUMAN36M.split()),
    "BODY_25": tuple(_BODY_25.split()),
    "MediaPipe": MEDIAPIPE,
}
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
