"""Warnings about a recorded body, a line each with bone, reason, remedy: sizes, sides, height, axis, missing parts."""

import numpy as np

from controller.motion.anatomy import SIDES, named_anatomy
from controller.motion.bone_names import THESIS_LIMBS, named_parts
from controller.motion.canonical.canonical_body import CANONICAL_BONES, NO_LENGTH, Landmarks, landmarks_of, to_canonical
from controller.motion.clip import Clip
from controller.motion.rotations import Array, by_blocks, dot, normalise, rotate
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError

SHORTEST_LEG, LONGEST_LEG = 0.35, 1.15  # m, thigh and shank: of a child of three, and of the tallest person
FLOATS = 0.3  # m: the lowest joint above the ground, nearly all the time
DEEPEST = 0.3  # m: the lowest joint below the ground, in the middle of the recording
NEARLY_NEVER = 5.0  # percent of the time
LIES = 0.5  # sine: neck and ankles within 30 degrees of the horizontal from the hips
STEADY = 0.7  # length of the mean of directions that hardly change
UPSIDE_DOWN = 0.4  # legs: a head this far below the feet; that of a lying body may be a little
SIDES_DIFFER = 1.25  # a bone over its counterpart
# Degrees: angles below 6.3 that move by more than 0.2 may be radians.
WITHIN_A_TURN, MOVES = 6.3, 0.2
_ARM_ENDS = ("sho", "elb", "wri", "han")
PROPORTIONS = (("kne", "ank", 0.6, 1.7), ("elb", "wri", 0.6, 2.2))  # thigh over shank, upper arm over forearm


def anatomy_doubts(clip: Clip) -> list[str]:
    """Doubts which bone is which part of the body, and whether it is a body: what is learned may be another one."""
    skeleton = clip.skeleton
    found: list[str] = []
    try:
        marks = landmarks_of(skeleton)
    except FileFormatError as error:
        return [str(error)]
    if named_anatomy(skeleton) is None:
        found.append("no names of legs were understood: parts were found by shape. Check them, or use --rename.")
    elif arms := _arms_by_shape(skeleton, marks):
        found.append(f"no name of {arms} was understood: found by shape. Check it, or use --rename OLD=LeftForeArm.")
    for side in SIDES:
        if side[0] + "elb" not in marks.joint:
            found.append(f"no {side} upper arm was found: the arm is assumed to hang (--rename OLD=LeftArm).")
    return found + _sizes(to_canonical(clip), skeleton, marks)


def doubts(clip: Clip) -> list[str]:
    """Warnings about the body of a clip, first those about its anatomy."""
    return [*anatomy_doubts(clip), *other_doubts(clip)]


def other_doubts(clip: Clip) -> list[str]:
    """Warnings about the body of a clip besides those about its anatomy."""
    skeleton = clip.skeleton
    found: list[str] = []
    try:
        marks = landmarks_of(skeleton)
    except FileFormatError:
        return found
    armless = {side[0] + end for side in SIDES for end in _ARM_ENDS if side[0] + "elb" not in marks.joint}
    lacking = [_called(bone) for bone in marks.lacking if bone not in armless]
    if lacking:
        what = "was found: its length and direction are" if len(lacking) == 1 else "were found: they are"
        found.append(f"no {', '.join(lacking)} {what} assumed.")
    own = to_canonical(clip)
    joints = own.joints()
    head, toes = (joints[:, 1 + CANONICAL_BONES.index(bone), 2] for bone in ("head", "lfoo"))
    lowest = joints[..., 2].min(axis=1)
    deep, floats = -float(np.median(lowest)), float(np.percentile(lowest, NEARLY_NEVER))
    if deep > DEEPEST:
        found.append(f"the body is {deep:.2f} m below the ground: give its height (--ground), or the up axis (--up).")
    if floats > FLOATS:
        found.append(
            f"the body floats {floats:.2f} m above the ground all the time: the up axis may be wrong (--up), or the "
            "ground is elsewhere (--ground)."
        )
    # The angle of each bone from its rest pose relative to its parent, shape (T, B), degrees.
    turns = by_blocks(lambda turned: dot(turned[:, 1:], turned[:, 1 + skeleton.parent]), clip.rotation)
    turns = by_blocks(lambda cosine: np.degrees(2.0 * np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))), turns)
    if np.ptp(turns, axis=0).max(initial=0.0) > MOVES and turns.max() < WITHIN_A_TURN:
        found.append(f"no joint turns by more than {turns.max():.1f} degrees: are the angles radians? Write degrees.")
    if np.median(head - toes) < -UPSIDE_DOWN * own.skeleton.leg_length:
        found.append("the head is below the feet most of the time: the up axis may be wrong (--up).")
    spans = joints[:, [1 + CANONICAL_BONES.index(bone) for bone in ("neck", "lank", "rank")]] - joints[:, :1]
    if _lie(normalise(spans)):
        found.append(
            "the body lies all the time: if the person did not, another axis is up (--up; where it is x, turn the "
            "recording in the program that it comes from)."
        )
    if "lfoo" in marks.joint and _toes_ahead(own) < -0.3:
        found.append("the toes point backwards: names may have left and right exchanged (--rename).")
    return found


def _lie(lines: Array) -> bool:
    """Whether lines (T, N, 3) are horizontal: nearly always all of them, or on average with constant directions."""
    steepest = np.abs(lines[..., 2]).max(axis=1)
    whole = lines.mean(axis=0)
    same_way = np.linalg.norm(whole, axis=-1).min() > STEADY and np.abs(whole[:, 2]).max() < LIES
    return bool(np.percentile(steepest, 100.0 - NEARLY_NEVER) < LIES or same_way)


def _arms_by_shape(skeleton: Skeleton, marks: Landmarks) -> str:
    named = set(named_parts(skeleton.bones))
    arms = [side for side in SIDES if side[0] + "elb" in marks.joint]
    return " and ".join(f"the {arm} arm" for arm in arms if not {("upper arm", arm), ("forearm", arm)} <= named)


def _toes_ahead(own: Clip) -> float:
    """The median cosine between the toes, but for their part along the shank, and the heading of a canonical clip."""
    aside: list[Array] = []
    for side in "lr":
        bones = [own.skeleton.index(side + end) for end in ("foo", "ank")]
        foot, shank = (rotate(own.rotation[:, 1 + bone], own.skeleton.rest_direction[bone]) for bone in bones)
        aside.append(foot - dot(foot, shank)[:, None] * shank)  # crawling feet point backwards along it
    forward = rotate(own.rotation[:, 0], np.array([1.0, 0.0, 0.0]))
    return float(np.median(dot(0.5 * (aside[0] + aside[1]), forward)))


def _sizes(own: Clip, recorded: Skeleton, marks: Landmarks) -> list[str]:
    found: list[str] = []
    length = dict(zip(CANONICAL_BONES, own.skeleton.length.tolist(), strict=True))
    name = {bone: recorded.bones[marks.bone[bone]] for bone in marks.joint if marks.bone.get(bone, -1) >= 0}
    for side in SIDES:
        leg = length[side[0] + "kne"] + length[side[0] + "ank"]
        if not SHORTEST_LEG < leg < LONGEST_LEG:
            found.append(f"the {side} leg is {leg:.2f} m long: the unit may be wrong (--unit), or a bone (--rename).")
        for upper, lower, least, most in ((side[0] + a, side[0] + b, *span) for a, b, *span in PROPORTIONS):
            if upper in name and lower in name and not least < length[upper] / max(length[lower], NO_LENGTH) < most:
                taken = f"bone '{name[upper]}', taken for the {_called(upper)}"
                shorter = f"the {_called(lower).partition(' ')[2]} {length[lower]:.2f} m"
                found.append(f"{taken}, is {length[upper]:.2f} m, {shorter} (--rename).")
    for end in ("kne", "ank", "elb", "wri"):
        if "l" + end in name and "r" + end in name:
            one, other = length["l" + end], length["r" + end]
            if max(one, other) > SIDES_DIFFER * min(one, other):
                names = f"'{name['l' + end]}' and '{name['r' + end]}'"
                found.append(f"bones {names}, taken for {_NAMES[end]}s, are {one:.2f} and {other:.2f} m (--rename).")
    return found


_NAMES = dict[str, str](THESIS_LIMBS) | {"sho": "shoulder"}


def _called(bone: str) -> str:
    side = {"l": "left ", "r": "right "}.get(bone[0], "")
    return side + _NAMES[bone[1:]] if bone[1:] in _NAMES else {"neck": "chest"}.get(bone, bone)


def recorded_parts(clip: Clip) -> dict[str, str]:
    """The recorded bone of each part of the canonical body, by the name of the part."""
    marks = landmarks_of(clip.skeleton)
    return {
        _called(bone): clip.skeleton.bones[marks.bone[bone]]
        for bone in CANONICAL_BONES
        if marks.bone.get(bone, -1) >= 0 and (bone in marks.joint or bone == "back")
    }
