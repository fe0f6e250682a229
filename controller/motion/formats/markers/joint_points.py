"""Points in the joints of a person (keypoints of a pose estimator, computed centres), and the body that they make.

Labels are parsed as by `bone_names`, each as the joint in which the part of its name starts: "LKnee", "left_hip",
"RWrist", "LBigToe", "Neck", "MidHip".

With all limbs known the body is the canonical one: lengths are median distances, and each bone has the direction of its
joints. Unknown arms or trunk are left out, and the bones have usual names; `canonical_body` assumes the rest and
`body_doubts` says so.
"""

from dataclasses import replace

import numpy as np

from controller.motion.bone_names import THESIS_LIMBS, named_parts
from controller.motion.clip import Clip, Markers, bridged
from controller.motion.formats.markers.skin_markers import marks_pelvis
from controller.motion.orientation import orient
from controller.motion.rotations import Array, best_fit, by_blocks, continuous, dot, normalise, rotate
from controller.motion.skeleton import JAEGER_TREE, ROOT, Skeleton, thesis_skeleton
from controller.motion.up_axis import TO_OURS

LEGS = tuple(side + joint for side in "lr" for joint in ("hip", "kne", "ank"))  # which every body needs
ARMS = tuple(side + joint for side in "lr" for joint in ("sho", "elb", "wri"))
ON_HANDS = -0.5  # mean cosine between legs and arms, below which the body stands on its hands
HAND, HEAD, FOOT = 0.3, 0.9, 0.4  # over forearm, shoulder width and shank, if no point is known there

_USUAL = {"back": "Spine", "neck": "Chest", "head": "Head", "pelvis": "Pelvis"}
_LIMBS = ("Hip", "UpLeg", "Leg", "Foot", "Shoulder", "Arm", "ForeArm", "Hand")
for (_end, _), _part in zip(THESIS_LIMBS, _LIMBS, strict=True):
    _USUAL |= {"l" + _end: "Left" + _part, "r" + _end: "Right" + _part}
# The canonical joint in which a named part starts; toes and fingers are points on them.
_LIMB_STARTS = {
    **{"thigh": "hip", "shank": "kne", "foot": "ank", "toes": "foo"},
    **{"upper arm": "sho", "forearm": "elb", "hand": "wri"},
}
_STARTS = {(part, side): side[0] + joint for part, joint in _LIMB_STARTS.items() for side in ("left", "right")}
_STARTS |= {("neck", "middle"): "neck", ("head", "middle"): "head"}


def joint_points(markers: Markers) -> dict[str, Array]:
    """The tracks (T, 3) of the points that lie in joints, by canonical joint; empty unless both legs are complete.

    Gaps are interpolated linearly. An incomplete arm is left out. In a file with markers on the skin of the pelvis,
    "LKnee" may be such a marker too: there all limbs must be complete.
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


def turned_over(points: Markers) -> Markers:
    """Points in camera axes (vertical axis down), rotated by half a turn about x; others unchanged."""
    # Legs that point up may be those of a handstand: then the arms are stretched away from them.
    joints = joint_points(points)
    if not all(joint in joints for joint in (*LEGS, *ARMS)):
        return points
    legs, arms = (
        np.mean([joints[side + end] - joints[side + start] for side in "lr"], axis=0)
        for start, end in (("hip", "ank"), ("sho", "wri"))
    )
    y, z = legs.mean(axis=0)[1:]
    down = (y if abs(y) > abs(z) else z) > 0.0
    if not down or np.mean(dot(normalise(legs), normalise(arms))) < ON_HANDS:
        return points
    return replace(points, position=points.position * np.array([1.0, -1.0, -1.0]))


def jointed_body(joints: dict[str, Array], markers: Markers, name: str) -> Clip:
    """The motion of a body with these joints of a recording.

    Positions (T, 3), m, by canonical joint, in the axes of the file, without gaps. Those of LEGS are required; "pelvis"
    is a point straight above the middle between the hips.
    """
    upwards = sum(joints[side + "hip"] - joints[side + "ank"] for side in "lr")
    up = markers.up
    if up not in TO_OURS:
        tall = np.abs(np.mean(upwards, axis=0))
        up = "y" if tall[1] > tall[2] else "z"
    ends = {joint: rotate(TO_OURS[up], track) for joint, track in joints.items()}
    ends["root"] = 0.5 * (ends["lhip"] + ends["rhip"])
    whole = all(joint in ends for joint in ARMS)
    if whole:
        ends.setdefault("neck", 0.5 * (ends["lsho"] + ends["rsho"]))
        upright = normalise(ends["neck"] - ends["root"])
        width = np.sqrt(np.square(ends["lsho"] - ends["rsho"]).sum(-1, keepdims=True))
        ends.setdefault("head", ends["neck"] + HEAD * width * upright)
        ahead = normalise(np.cross(ends["lhip"] - ends["rhip"], upright))
        for side in "lr":
            shank = np.sqrt(np.square(ends[side + "ank"] - ends[side + "kne"]).sum(-1, keepdims=True))
            ends.setdefault(side + "foo", ends[side + "ank"] + FOOT * shank * ahead)
    if "neck" not in ends:  # the parent of head and arms
        ends = {joint: track for joint, track in ends.items() if joint != "head" and joint not in ARMS}
    for side in "lr":
        if side + "wri" in ends:
            ends.setdefault(side + "han", ends[side + "wri"] + HAND * (ends[side + "wri"] - ends[side + "elb"]))
    if "head" in ends:
        ends["back"] = 0.5 * (ends["root"] + ends["neck"])
    tree = {bone: (of, rest) for bone, of, rest in JAEGER_TREE if bone in ends}
    if "neck" in ends and "back" not in ends:  # one bone: of two without a head the upper would pass for the head
        tree["neck"] = "root", tree["neck"][1]
    if "neck" not in ends and "pelvis" in ends:  # gives the rotation of the root about the line between the hips
        tree["pelvis"] = "root", (0.0, 0.0, 1.0)
    bones = [*tree]
    lines = np.empty((len(ends["root"]), len(tree), 3))
    for line, (bone, (of, _)) in enumerate(tree.items()):
        lines[:, line] = ends[bone] - ends[of]
    length = np.median(by_blocks(lambda line: np.sqrt(np.square(line).sum(-1)), lines), axis=0)
    if whole:
        skeleton = thesis_skeleton(length, name)
    else:
        hangs = np.array([bones.index(of) if of != "root" else ROOT for of, _ in tree.values()])
        rest = np.array([rest for _, rest in tree.values()])
        skeleton = Skeleton(name, tuple(_USUAL[bone] for bone in bones), hangs, rest, length)
    # All joints together are as large as the clip.
    ends = {at: ends[at] for at in ("root", "lhip", "rhip", "pelvis") if at in ends}
    lines = by_blocks(normalise, lines)
    rotation = orient(skeleton, lines)
    del lines
    if "pelvis" in ends:
        left = normalise(ends["lhip"] - ends["rhip"])
        ahead = normalise(np.cross(left, ends["pelvis"] - ends["root"]))
        rotation[:, 0] = best_fit(np.stack([ahead, left, np.cross(ahead, left)], axis=-1))
    return Clip(name, skeleton, markers.rate, ends["root"], continuous(rotation, own=True), markers.source)
