"""The body of a person of whom points in the joints are known: keypoints of a pose estimator, or computed centres.

Labels are read as `bone_names` does, each as the joint that the part of its name starts from: "LKnee", "left_hip",
"RWrist", "LBigToe", "Neck", "MidHip". The body is the canonical one, with the median distances for lengths; between its
joints each bone points where they were seen.
"""

from __future__ import annotations

import numpy as np

from controller.mocap.bone_names import named_parts
from controller.mocap.clip import Clip
from controller.mocap.formats.markers.tracks import Markers, bridged
from controller.mocap.orientation import orient
from controller.mocap.skeleton import ROOT
from controller.mocap.thesis_body import JAEGER_BONES, JAEGER_PARENT, thesis_skeleton
from controller.mocap.up_axis import TO_OURS
from controller.rotations import Array, continuous, normalise, rotate

# The canonical joint in which a named part starts; toes and fingers are points on them.
_STARTS = {
    **{("thigh", side): side[0] + "hip" for side in ("left", "right")},
    **{("shank", side): side[0] + "kne" for side in ("left", "right")},
    **{("foot", side): side[0] + "ank" for side in ("left", "right")},
    **{("toes", side): side[0] + "foo" for side in ("left", "right")},
    **{("upper arm", side): side[0] + "sho" for side in ("left", "right")},
    **{("forearm", side): side[0] + "elb" for side in ("left", "right")},
    **{("hand", side): side[0] + "wri" for side in ("left", "right")},
    ("neck", "middle"): "neck",
    ("head", "middle"): "head",
}
NEEDED = tuple(side + joint for side in "lr" for joint in ("hip", "kne", "ank", "sho", "elb", "wri"))
HAND, HEAD, FOOT = 0.3, 0.9, 0.4  # over forearm, shoulder width and shank, where a file has no point there


def joint_points(markers: Markers) -> dict[str, Array]:
    """The tracks (T, 3) of the points that lie in joints, by canonical joint; empty if not all of both limbs do."""
    found: dict[str, Array] = {}
    on_skin = any(mark in label.lower() for label in markers.labels for mark in ("asis", "sacr"))
    for index, part in enumerate(named_parts([label.rpartition(":")[2] for label in markers.labels])):
        track = markers.position[:, index]
        joint = None if part is None else _STARTS.get((part.part, part.side))
        if on_skin and part is not None and part.part == "thigh" and "hip" not in markers.labels[index].lower():
            continue  # a marker on the middle of the thigh (Helen Hayes: R.Thigh), not the joint that it starts in
        if joint is not None and joint not in found and not np.isnan(track).all():
            found[joint] = track
    return found if all(joint in found for joint in NEEDED) else {}


def body_of_points(markers: Markers, name: str) -> Clip:
    """The motion of a person with these points, which `joint_points` has found.

    Gaps are bridged by straight lines.
    """
    seen = {joint: bridged(track) for joint, track in joint_points(markers).items()}
    trunk = seen["lsho"] + seen["rsho"] - seen["lhip"] - seen["rhip"]
    up = markers.up
    if up not in TO_OURS:
        tall = np.abs(trunk.mean(axis=0))
        up = "y" if tall[1] > tall[2] else "z"
    ends = {joint: rotate(TO_OURS[up], track) for joint, track in seen.items()}
    ends["root"] = 0.5 * (ends["lhip"] + ends["rhip"])
    ends.setdefault("neck", 0.5 * (ends["lsho"] + ends["rsho"]))
    ends["back"] = 0.5 * (ends["root"] + ends["neck"])
    left = ends["lhip"] - ends["rhip"]
    upright = normalise(ends["neck"] - ends["root"])
    width = np.sqrt(np.square(ends["lsho"] - ends["rsho"]).sum(-1, keepdims=True))
    ends.setdefault("head", ends["neck"] + HEAD * width * upright)
    ahead = normalise(np.cross(left, upright))
    for side in "lr":
        shank = np.sqrt(np.square(ends[side + "ank"] - ends[side + "kne"]).sum(-1, keepdims=True))
        ends.setdefault(side + "foo", ends[side + "ank"] + FOOT * shank * ahead)
        ends[side + "han"] = ends[side + "wri"] + HAND * (ends[side + "wri"] - ends[side + "elb"])
    places = np.stack([ends[joint] for joint in ("root", *JAEGER_BONES)], axis=1)
    lines = places[:, 1:] - places[:, np.array(JAEGER_PARENT) - ROOT]
    length = np.median(np.sqrt(np.square(lines).sum(-1)), axis=0)
    skeleton = thesis_skeleton(length, name)
    rotation = orient(skeleton, normalise(lines))
    return Clip(name, skeleton, markers.rate, ends["root"], continuous(rotation), markers.source)
