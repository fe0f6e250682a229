"""Points in the joints of a person: keypoints of a pose estimator, or computed centres.

Labels are read as `bone_names` does, each as the joint that the part of its name starts from: "LKnee", "left_hip",
"RWrist", "LBigToe", "Neck", "MidHip".
"""

from __future__ import annotations

import numpy as np

from controller.motion.bone_names import named_parts
from controller.motion.formats.markers.jointed_body import ARMS, LEGS
from controller.motion.formats.markers.skin_markers import marks_pelvis
from controller.motion.formats.markers.tracks import Markers, bridged
from controller.motion.rotations import Array

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


def joint_points(markers: Markers) -> dict[str, Array]:
    """The tracks (T, 3) of the points that lie in joints, by canonical joint; empty if not all of both legs do.

    Gaps are bridged by straight lines. Of an arm with a point missing there are none. In a file with markers on the
    skin of the pelvis, "LKnee" may be such a marker too: there all limbs must have their points.
    """
    found: dict[str, Array] = {}
    on_skin = marks_pelvis(markers)
    for index, part in enumerate(named_parts([label.rpartition(":")[2] for label in markers.labels])):
        track = markers.position[:, index]
        joint = None if part is None else _STARTS.get((part.part, part.side))
        if on_skin and part is not None and part.part == "thigh" and "hip" not in markers.labels[index].lower():
            continue  # a marker on the middle of the thigh (Helen Hayes: R.Thigh), not the joint that it starts in
        if joint is not None and joint not in found and not np.isnan(track).all():
            found[joint] = bridged(track)
    if not all(joint in found for joint in ((*LEGS, *ARMS) if on_skin else LEGS)):
        return {}
    for side in "lr":
        arm = [joint for joint in ARMS if joint[0] == side]
        if not all(joint in found for joint in arm):
            found = {joint: track for joint, track in found.items() if joint not in arm}
    return found
