"""Legs for a recording of an upper body: below the pelvis, straight and vertical, in the proportions of the arms.

They are added to the joints of the file, so that all that follows finds a whole body in it, and stand still: feet move
with the pelvis and turn with its heading.
"""

from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from controller.motion.bone_names import SIDES, NamedPart, Part, named_parts
from controller.motion.clip import Clip, Decision
from controller.motion.rotations import Array, Flags, Indices, conjugate, cross, normalise, rotate, yaw
from motiondeck_base.errors import FileFormatError

ACCEPTED = "upper-body"
"""What `motiondeck learn --accept` takes to have legs added."""
RESTS = Decision("body", "an upper body, to which legs that rest are added", "as given", "", notable=True)
_LEGS = {"thigh", "shank", "foot", "toes"}
_ARM: tuple[Part, ...] = ("upper arm", "forearm", "hand")
_CHAIN = ("UpLeg", "Leg", "Foot", "ToeBase")
# Over thigh and shank (Winter 2009, fig. 4.1): upper arm and forearm; half the hips' width; toes ahead of the ankle.
ARM_PER_LEG, HALF_HIPS_PER_LEG, TOES_AHEAD, TOES_BELOW = 0.68, 0.19, 0.25, 0.045
SHORTEST_TRUNK, LONGEST_TRUNK = 0.35, 0.9  # over thigh and shank, usually 0.58, from the pelvis to the shoulders


def lacks_legs(names: tuple[str, ...]) -> bool:
    """Whether joints or bones are those of arms by name, and none of a leg."""
    parts = {of.part for of in named_parts(names) if of is not None}
    return "forearm" in parts and not parts & _LEGS


def with_legs(
    names: tuple[str, ...], parent: Indices, position: Array, rotation: Array, turns: Flags, path: str | Path
) -> tuple[tuple[str, ...], Indices, Array, Array, Flags]:
    """The fields of the tree of joints of an upper body, in the axes and the unit of its file, with legs.

    The pelvis is the first joint of pelvis or trunk by name, or else the first one. FileFormatError if that is not as
    far from the shoulders as a pelvis, or a joint of the arms is not known by name.
    """
    first: dict[NamedPart, int] = {}
    for joint, of in enumerate(named_parts(names)):
        if of is not None:
            first.setdefault(of, joint)
    arms = [[first.get(NamedPart(part, side), -1) for part in _ARM] for side in SIDES]
    pelvis = first.get(NamedPart("pelvis", "middle"), first.get(NamedPart("trunk", "middle"), 0))
    if min(chain(*arms)) < 0:
        raise FileFormatError(
            f"{path}: an upper body needs both arms with names that are understood, from shoulder to hand (--rename "
            "OLD=LeftForeArm and so on)."
        )
    away = position - position[:, [pelvis]]
    (left, *_), (right, *_) = arms
    bones = [away[:, other] - away[:, one] for arm in arms for one, other in pairwise(arm)]
    leg = 0.5 * float(np.median(np.linalg.norm(bones, axis=-1), axis=-1).sum()) / ARM_PER_LEG
    back = conjugate(rotation[:, pelvis])
    spine = rotate(back, 0.5 * (away[:, left] + away[:, right])).mean(axis=0)
    if not SHORTEST_TRUNK * leg < np.linalg.norm(spine) < LONGEST_TRUNK * leg:
        raise FileFormatError(
            f"{path}: an upper body needs a joint in its pelvis; '{names[pelvis]}' is too near to or too far "
            "from the shoulders (--rename OLD=Hips)."
        )
    up = normalise(spine)
    aside = rotate(back, away[:, left] - away[:, right]).mean(axis=0)
    aside = normalise(aside - (aside @ up) * up)
    shank, toes = -0.5 * leg * up, leg * (TOES_AHEAD * cross(aside, up) - TOES_BELOW * up)
    hips = (HALF_HIPS_PER_LEG * leg * aside, -HALF_HIPS_PER_LEG * leg * aside)
    places = np.concatenate([np.cumsum([hip, shank, shank, toes], axis=0) for hip in hips])
    added = [side + name for side in ("Left", "Right") for name in _CHAIN]
    above = np.append(parent, [pelvis if joint % 4 == 0 else len(names) + joint - 1 for joint in range(8)])
    position = np.concatenate([position, position[:, [pelvis]] + rotate(rotation[:, [pelvis]], places)], axis=1)
    rotation = np.concatenate([rotation, np.repeat(rotation[:, [pelvis]], 8, axis=1)], axis=1)
    return (*names, *added), above, position, rotation, np.append(turns, [joint % 4 < 3 for joint in range(8)])


def legs_at_rest(clip: Clip) -> Clip:
    """The clip of such a tree with its legs vertical, below hips that move with the pelvis."""
    rotation = clip.rotation.copy()
    for side in ("Left", "Right"):
        for name in _CHAIN[:-1]:
            rotation[:, 1 + clip.skeleton.index(side + name)] = yaw(clip.heading())
    return replace(clip, rotation=rotation)
