"""The body of a person of whom the places of the joints are known, frame by frame.

It is the canonical one where all limbs are known: median distances for lengths, and each bone points where its joints
were seen. Where arms or trunk are not known they are left out, and the bones that are left bear usual names;
`canonical_body` assumes the rest and `body_doubts` says so.
"""

from __future__ import annotations

import numpy as np

from controller.motion.clip import Clip
from controller.motion.formats.markers.tracks import Markers
from controller.motion.orientation import orient
from controller.motion.rotations import Array, best_fit, continuous, normalise, rotate
from controller.motion.skeleton import ROOT, Skeleton
from controller.motion.thesis_body import JAEGER_BONES, JAEGER_PARENT, JAEGER_REST, thesis_skeleton
from controller.motion.up_axis import TO_OURS

LEGS = tuple(side + joint for side in "lr" for joint in ("hip", "kne", "ank"))
"""The joints without which there is no body."""
ARMS = tuple(side + joint for side in "lr" for joint in ("sho", "elb", "wri"))
HAND, HEAD, FOOT = 0.3, 0.9, 0.4  # over forearm, shoulder width and shank, where no point is known there

_USUAL = {"back": "Spine", "neck": "Chest", "head": "Head", "pelvis": "Pelvis"}
_USUAL_LIMBS = {
    **{"hip": "Hip", "kne": "UpLeg", "ank": "Leg", "foo": "Foot"},
    **{"sho": "Shoulder", "elb": "Arm", "wri": "ForeArm", "han": "Hand"},
}
for _side, _name in (("l", "Left"), ("r", "Right")):
    _USUAL |= {_side + end: _name + part for end, part in _USUAL_LIMBS.items()}
# Of each bone the one it hangs from, and where it rests.
_TREE = [
    (bone, "root" if of == ROOT else JAEGER_BONES[of], rest)
    for bone, of, rest in zip(JAEGER_BONES, JAEGER_PARENT, JAEGER_REST, strict=True)
]


def jointed_body(joints: dict[str, Array], markers: Markers, name: str) -> Clip:
    """The motion of a person with these joints.

    Args:
        joints: where each was, shape (T, 3), m, in the file's axes, without gaps; by canonical joint. Those of LEGS
            are needed; "pelvis" is a point straight above the middle between the hips.
        markers: the recording that they were found in.
        name: of the clip.
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
        _assume_ends(ends)
    if "neck" not in ends:  # what would hang from it
        ends = {joint: track for joint, track in ends.items() if joint != "head" and joint not in ARMS}
    for side in "lr":
        if side + "wri" in ends:
            ends.setdefault(side + "han", ends[side + "wri"] + HAND * (ends[side + "wri"] - ends[side + "elb"]))
    if "head" in ends:
        ends["back"] = 0.5 * (ends["root"] + ends["neck"])
    tree = {bone: (of, rest) for bone, of, rest in _TREE if bone in ends}
    if (
        "neck" in ends and "back" not in ends
    ):  # a trunk of one bone: of two without a head, the upper one would be taken for it
        tree["neck"] = "root", tree["neck"][1]
    if "neck" not in ends and "pelvis" in ends:  # it tells how the root is turned about the line between the hips
        tree["pelvis"] = "root", (0.0, 0.0, 1.0)
    bones = [*tree]
    lines = np.stack([ends[bone] - ends[of] for bone, (of, _) in tree.items()], axis=1)
    length = np.median(np.sqrt(np.square(lines).sum(-1)), axis=0)
    if whole:
        skeleton = thesis_skeleton(length, name)
    else:
        hangs = np.array([bones.index(of) if of != "root" else ROOT for of, _ in tree.values()])
        rest = np.array([rest for _, rest in tree.values()])
        skeleton = Skeleton(name, tuple(_USUAL[bone] for bone in bones), hangs, rest, length)
    rotation = orient(skeleton, normalise(lines))
    if "pelvis" in ends:
        rotation[:, 0] = _turned(ends)
    return Clip(name, skeleton, markers.rate, ends["root"], continuous(rotation), markers.source)


def _turned(ends: dict[str, Array]) -> Array:
    """How the pelvis is turned, shape (T, 4)."""
    left = normalise(ends["lhip"] - ends["rhip"])
    ahead = normalise(np.cross(left, ends["pelvis"] - ends["root"]))
    return best_fit(np.stack([ahead, left, np.cross(ahead, left)], axis=-1))


def _assume_ends(ends: dict[str, Array]) -> None:
    """Adds the head and the toes of a whole body that has no points there."""
    upright = normalise(ends["neck"] - ends["root"])
    width = np.sqrt(np.square(ends["lsho"] - ends["rsho"]).sum(-1, keepdims=True))
    ends.setdefault("head", ends["neck"] + HEAD * width * upright)
    ahead = normalise(np.cross(ends["lhip"] - ends["rhip"], upright))
    for side in "lr":
        shank = np.sqrt(np.square(ends[side + "ank"] - ends[side + "kne"]).sum(-1, keepdims=True))
        ends.setdefault(side + "foo", ends[side + "ank"] + FOOT * shank * ahead)
