"""What looks wrong about a recorded body: sizes, sides, the up axis, and parts that were not found.

Each doubt is one line that names the bone, the reason and the remedy. Judged over the whole recording.
"""

from __future__ import annotations

import numpy as np

from controller.mocap.anatomy import SIDES, Anatomy, Part, anatomy, named_anatomy
from controller.mocap.canonical.canonical_body import CANONICAL_BONES, landmarks_of, to_canonical
from controller.mocap.clip import Clip
from controller.rotations import dot, rotate
from motiondeck_base.errors import FileFormatError

SHORTEST_LEG, LONGEST_LEG = 0.5, 1.3  # m, thigh and shank
HIGHEST_ROOT = 1.5  # m, in the middle of the recording
DEEPEST = 0.3  # m: the lowest joint below the ground, in the middle of the recording
SIDES_DIFFER = 1.25  # a bone over its counterpart
PROPORTIONS: tuple[tuple[Part, Part, float, float], ...] = (
    ("thigh", "shank", 0.6, 1.7),
    ("upper arm", "forearm", 0.6, 2.2),
)


def doubts(clip: Clip) -> list[str]:
    """What looks wrong about the body of a clip."""
    skeleton = clip.skeleton
    found: list[str] = []
    parts = named_anatomy(skeleton)
    if parts is None:
        found.append("no names of legs were understood: parts were found by shape. Check them, or use --rename.")
        parts = anatomy(skeleton)
    try:
        marks = landmarks_of(skeleton)
    except FileFormatError as error:
        return [*found, str(error)]
    lacking = [_called(bone) for bone in marks.lacking]
    if lacking:
        what = "was found: its length and direction are" if len(lacking) == 1 else "were found: they are"
        found.append(f"no {', '.join(lacking)} {what} assumed.")
    found += _sizes(clip, parts)
    own = to_canonical(clip)
    joints = own.joints()
    head, toes = (joints[:, 1 + CANONICAL_BONES.index(bone), 2] for bone in ("head", "lfoo"))
    deep = -float(np.median(joints[..., 2].min(axis=1)))
    if deep > DEEPEST:
        found.append(
            f"the body is {deep:.2f} m below the ground: its height is not in the file, or the up axis (--up)."
        )
    if np.median(head - toes) < 0.0:
        found.append("the head is below the feet most of the time: the up axis may be wrong (--up).")
    if "lfoo" in marks.joint and _toes_ahead(own) < -0.3:
        found.append("the toes point backwards: names may have left and right exchanged (--rename).")
    return found


def _toes_ahead(own: Clip) -> float:
    """How far the toes of a canonical clip point ahead of the body: cosine, median over time.

    Only what points aside of the shank counts: the feet of somebody who crawls or kneels point behind him.
    """
    line = {
        bone: rotate(
            own.rotation[:, 1 + own.skeleton.index(bone)], own.skeleton.rest_direction[own.skeleton.index(bone)]
        )
        for bone in ("lank", "rank", "lfoo", "rfoo")
    }
    aside = [
        foot - dot(foot, shank)[:, None] * shank
        for foot, shank in ((line["lfoo"], line["lank"]), (line["rfoo"], line["rank"]))
    ]
    forward = rotate(own.rotation[:, 0], np.array([1.0, 0.0, 0.0]))
    return float(np.median(dot(0.5 * (aside[0] + aside[1]), forward)))


def _sizes(clip: Clip, parts: Anatomy) -> list[str]:
    """Implausible lengths and heights."""
    skeleton = clip.skeleton
    found: list[str] = []
    for side in SIDES:
        leg = sum(float(skeleton.length[bone]) for part in ("thigh", "shank") for bone in parts.all(part, side)[:1])
        if not SHORTEST_LEG < leg < LONGEST_LEG:
            found.append(f"the {side} leg is {leg:.2f} m long: the unit may be wrong (--unit), or a bone (--rename).")
        for upper, lower, least, most in PROPORTIONS:
            bones = [parts.first(part, side) for part in (upper, lower)]
            one, other = (None if bone is None else float(skeleton.length[bone]) for bone in bones)
            if one is not None and other and not least < one / other < most and bones[0] is not None:
                taken = f"bone '{skeleton.bones[bones[0]]}', taken for the {side} {upper}"
                found.append(f"{taken}, is {one:.2f} m, the {lower} {other:.2f} m (--rename).")
    for part in ("thigh", "shank", "upper arm", "forearm"):
        left, right = (parts.first(part, side) for side in SIDES)
        if left is not None and right is not None:
            one, other = float(skeleton.length[left]), float(skeleton.length[right])
            if max(one, other) > SIDES_DIFFER * min(one, other):
                names = f"'{skeleton.bones[left]}' and '{skeleton.bones[right]}'"
                found.append(f"bones {names}, taken for both {part}s, are {one:.2f} and {other:.2f} m (--rename).")
    height = float(np.median(clip.root_position[:, 2]))
    if height > HIGHEST_ROOT:
        found.append(f"the root is {height:.2f} m high: the unit (--unit) or the up axis (--up) may be wrong.")
    return found


_NAMES = {"hip": "hip", "kne": "thigh", "ank": "shank", "foo": "foot"}
_NAMES |= {"sho": "shoulder", "elb": "upper arm", "wri": "forearm", "han": "hand"}


def _called(bone: str) -> str:
    """A canonical bone in words."""
    side = {"l": "left ", "r": "right "}.get(bone[0], "")
    return side + _NAMES[bone[1:]] if bone[1:] in _NAMES else {"neck": "chest"}.get(bone, bone)


def taken_for(clip: Clip) -> dict[str, str]:
    """The recorded bone that each part of the canonical body was found in, by the part's name."""
    marks = landmarks_of(clip.skeleton)
    return {
        _called(bone): clip.skeleton.bones[marks.bone[bone]]
        for bone in CANONICAL_BONES
        if marks.bone.get(bone, -1) >= 0 and (bone in marks.joint or bone == "back")
    }
