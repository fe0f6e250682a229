"""Anatomy: the body part of each bone of a skeleton, by usual names or else by shape.

Names are used if both legs have them (`bone_names`); unnamed arms are found by shape, and an unnamed spine leads to
the arms. An unnamed bone belongs to the part that it leads to. Fingers belong to the hand, toes to the foot.

By shape: limbs are pairs of chains of the same length. The pair that branches off at the root is the legs, the pair
further up the arms, and the spine connects them and continues to the highest end near the middle. If that is ambiguous,
the body is assumed to stand with its arms out: chains from the root that end below it are legs, chains from further up
are arms; the longest on each side, since faces and twist bones branch off too. Thigh and shank are the two neighbours
of a leg with the largest sum of lengths; the upper arm is the longest bone of an arm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np

from controller.motion.bone_names import SIDES, LimbPart, NamedPart, Side, named_parts
from controller.motion.rotations import Array
from controller.motion.skeleton import ROOT, Skeleton

SHORTEST_LIMB = 0.25  # of the longest path through the body: fingers and eyes are pairs as well
SAME_LENGTH = 0.06  # relative difference between the lengths of a pair of limbs
BEYOND_ELBOW = 1.25  # forearm and hand, mostly recorded without fingers, over the upper arm
# Over the upper arm: a shorter forearm goes on in the next bone, as in Acclaim files, if that is longer than HALF of it
# and both are shorter than WHOLE.
PART_OF_FOREARM, HALF, WHOLE = 0.78, 0.4, 1.15

Part = Literal["trunk", "neck", "head", "other"] | LimbPart
FirstBones: TypeAlias = dict[tuple[str, str], int]  # by part and side


@dataclass(frozen=True)
class Anatomy:
    """Body part and side of each of the B bones of a skeleton, length B each."""

    part: tuple[Part, ...]
    side: tuple[Side, ...]

    def first(self, part: Part, side: Side = "middle") -> int | None:
        """The first bone of a part on a side, or None."""
        return next(iter(self.all(part, side)), None)

    def all(self, part: Part, side: Side | None = None) -> list[int]:
        """The bones of a part, from the root outwards; by default of both sides."""
        return [b for b, (p, s) in enumerate(zip(self.part, self.side, strict=True)) if p == part and side in (None, s)]


def anatomy(skeleton: Skeleton) -> Anatomy:
    """The parts of any skeleton, by names or else by shape; other bones are "other"."""
    if (named := named_anatomy(skeleton)) is not None:
        return named
    shape = shaped_anatomy(skeleton)
    # A limb is none if one of its bones is named as another part: such a name is right.
    refuted = {
        (kind, side)
        for of, part, side in zip(named_parts(skeleton.bones), shape.part, shape.side, strict=True)
        for kind in (_LEG, _ARM)
        if of is not None and part in kind and _is_other(of.part, kind)
    }
    part: tuple[Part, ...] = tuple(
        "other" if any(p in kind and s == side for kind, side in refuted) else p
        for p, s in zip(shape.part, shape.side, strict=True)
    )
    return Anatomy(part, shape.side)


def _is_other(named: str, kind: tuple[Part, ...]) -> bool:
    return any(named in parts for parts in (_LEG, _ARM, ("neck", "head")) if parts != kind)


def named_anatomy(skeleton: Skeleton) -> Anatomy | None:
    """The parts of a skeleton whose names identify both legs; None for others."""
    named = named_parts(skeleton.bones)
    first: FirstBones = {}
    for bone, of in enumerate(named):
        if of is not None:
            first.setdefault((of.part, of.side), bone)
    part: list[Part] = ["other"] * len(skeleton)
    side: list[Side] = ["middle"] * len(skeleton)
    for which in SIDES:
        if not _name_limb(skeleton, first, which, _LEG, part, side):
            return None
    shape: Anatomy | None = None
    for which in SIDES:
        if _name_limb(skeleton, first, which, _ARM, part, side):
            continue
        shape = shape or shaped_anatomy(skeleton)
        for bone, (p, s) in enumerate(zip(shape.part, shape.side, strict=True)):
            of = named[bone]
            if p in _ARM and s == which and part[bone] == "other" and not (of and _is_other(of.part, _ARM)):
                part[bone], side[bone] = p, s
    heads = [b for b, of in enumerate(named) if of is not None and of.part in ("head", "neck")]
    spine_end = heads or [b for b, of in enumerate(named) if of is not None and of.part == "trunk"]
    spine = _path(skeleton, _main_end(skeleton, spine_end[-1], named)) if spine_end else _way_up(skeleton, part)
    arms = [b for b in range(len(skeleton)) if part[b] in _ARM and skeleton.parent.item(b) in spine]
    level = max((_level(skeleton, spine, b) for b in arms), default=len(spine) - 1)
    for place, bone in enumerate(spine):
        if part[bone] == "other":
            part[bone] = "trunk" if place <= level else "neck"
            of = named[bone]
            # Blender's rigs name bones spine up to the head.
            if of is not None and of.part in ("trunk", "neck", "head") and (place <= level or heads):
                part[bone] = of.part
    if "head" not in part and len(spine) > 1:
        part[spine[-1]] = "head"
    return Anatomy(tuple(part), tuple(side))


def leg_without_name(skeleton: Skeleton) -> Side | None:
    """The side of the only leg without usual names: by shape, another limb would pass for it."""
    named = set(named_parts(skeleton.bones))
    has = {side: {("thigh", side), ("shank", side)} <= named for side in SIDES}
    return next((side for side in SIDES if not has[side]), None) if any(has.values()) else None


_LEG: tuple[Part, ...] = ("hip", "thigh", "shank", "foot")
_ARM: tuple[Part, ...] = ("clavicle", "upper arm", "forearm", "hand")
_LIMBS_AND_HEAD = (
    *(("thigh", "left"), ("thigh", "right"), ("upper arm", "left"), ("upper arm", "right")),
    *(("head", "middle"), ("neck", "middle")),
)


def _name_limb(
    skeleton: Skeleton, first: FirstBones, which: Side, kinds: tuple[Part, ...], part: list[Part], side: list[Side]
) -> bool:
    """Labels a leg or an arm from its two long bones; False if they are not named, or not in one chain."""
    upper, lower = first.get((kinds[1], which)), first.get((kinds[2], which))
    if upper is None or lower is None or not skeleton.chain[lower, upper] or upper == lower:
        return False
    end = first.get((kinds[3], which))
    limb = _path(skeleton, lower)
    sides = [b for b in limb if skeleton.chain[b, upper]]
    others = [first[of] for of in _LIMBS_AND_HEAD if of in first and first[of] != upper]
    begin = limb.index(upper)
    while begin > 0 and not skeleton.chain[others, limb[begin - 1]].any():
        begin -= 1
    for bone in limb[begin : limb.index(upper)]:
        part[bone], side[bone] = kinds[0], which
    for bone in sides[:-1]:
        part[bone], side[bone] = kinds[1], which
    part[lower], side[lower] = kinds[2], which
    for bone in range(len(skeleton)):
        if bone != lower and skeleton.chain[bone, lower]:
            before_end = end is not None and bone != end and skeleton.chain[end, bone]
            part[bone] = kinds[2] if before_end else kinds[3]
    for bone in range(len(skeleton)):
        if skeleton.chain[bone, limb[begin]]:
            side[bone] = which
    return True


def _level(skeleton: Skeleton, spine: list[int], arm: int) -> int:
    """The index in the spine of the last bone of the trunk, from an arm that branches off."""
    # Bones "A-B" and "A-C" begin in one joint (`joint_tree`): beside a collar bone the spine is still trunk.
    place = spine.index(skeleton.parent.item(arm))
    start, way, _ = skeleton.bones[arm].partition("-")
    beside = place + 1 < len(spine) and skeleton.bones[spine[place + 1]].partition("-")[0] == start
    return place + (bool(way) and beside)


def _main_end(skeleton: Skeleton, bone: int, named: list[NamedPart | None]) -> int:
    while True:
        up = [int(b) for b in skeleton.children(bone) if (of := named[b]) is not None and of.part in ("neck", "head")]
        if not up:
            return bone
        bone = up[0]


def _way_up(skeleton: Skeleton, part: list[Part]) -> list[int]:
    """An unnamed spine: the path to the fork of the arms, and on to the highest end beyond."""
    arms = [bone for bone in range(len(skeleton)) if part[bone] in _ARM]
    shared = [b for b in range(len(skeleton)) if part[b] == "other" and arms and skeleton.chain[arms, b].all()]
    if not shared:
        return []
    fork = max(shared, key=lambda bone: len(_path(skeleton, bone)))
    ends = skeleton.chain @ (skeleton.rest_direction * skeleton.length[:, None])
    beyond = [b for b in range(len(skeleton)) if part[b] == "other" and skeleton.chain[b, fork]]
    return _path(skeleton, max(beyond, key=lambda bone: ends[bone, 2] - abs(ends[bone, 1])))


def shaped_anatomy(skeleton: Skeleton) -> Anatomy:
    """The parts of a skeleton by its shape alone."""
    ends = skeleton.chain @ (skeleton.rest_direction * skeleton.length[:, None])
    part: list[Part] = ["other"] * len(skeleton)
    side: list[Side] = ["middle"] * len(skeleton)

    leaves = [bone for bone in range(len(skeleton)) if len(skeleton.children(bone)) == 0]
    pairs = _limb_pairs(skeleton, leaves)
    limbs = [branch for pair in pairs for branch in pair]
    # With both arms known, the head is what else lies beyond them, even with raised hands.
    beyond = [leaf for leaf in leaves if pairs and skeleton.chain[leaf, skeleton.parent.item(limbs[-1])]]
    beyond = [leaf for leaf in beyond if not skeleton.chain[leaf, limbs].any()]
    top = max(beyond or leaves, key=lambda leaf: ends[leaf, 2] - abs(ends[leaf, 1]))
    if pairs:
        spine = _path(skeleton, top if beyond else skeleton.parent.item(limbs[-1]))
    else:
        spine = _path(skeleton, top) if ends[top, 2] > 0.0 else []

    branches = [b for b in range(len(skeleton)) if b not in spine and skeleton.parent.item(b) in (ROOT, *spine)]
    ways = {branch: _main_path(skeleton, branch, leaves) for branch in branches}
    at_root = {branch: skeleton.parent.item(branch) == ROOT for branch in branches}
    on_left = {branch: bool(ends[ways[branch][-1], 1] > 0.0) for branch in branches}
    for pair in pairs:
        left = max(pair, key=lambda branch: _first_aside(ends, ways[pair[0]], ways[pair[1]], branch == pair[1]))
        on_left |= {branch: branch == left for branch in pair}
    arms: list[int] = []  # indices in the spine where they branch off
    for branch, way in ways.items():
        which: Side = "left" if on_left[branch] else "right"
        limb = np.flatnonzero(skeleton.chain[:, branch])
        for bone in limb:
            side[bone] = which
        rivals = [one for one in branches if (on_left[one], at_root[one]) == (on_left[branch], at_root[branch])]
        # Breasts, faces and twist bones branch off too: a limb is the longest chain of its side.
        if branch not in (limbs or [max(rivals, key=lambda other: skeleton.length[ways[other]].sum())]):
            continue
        if branch in limbs[2:] or not (limbs or at_root[branch]):
            _name_arm(skeleton, way, limb, part)
            # Some skeletons fork below the chest: the bone that rises beside the arms is then trunk too.
            rises = float(skeleton.rest_direction[branch, 2]) > 0.7
            arms.append(spine.index(skeleton.parent.item(branch)) + rises)
        elif limbs or ends[limb, 2].min() < 0.0:
            length = skeleton.length[list(way)]
            thigh = int(np.argmax(length[:-1] + length[1:])) if len(way) > 1 else 0
            _name(skeleton, way, limb, thigh, part, _LEG)

    # The spine below the arms is trunk, above them neck, and its last bone the head.
    for level, bone in enumerate(spine):
        part[bone] = "trunk" if level <= max(arms, default=level) else "neck"
    if len(spine) > 1:
        part[spine[-1]] = "head"
    return Anatomy(tuple(part), tuple(side))


def _limb_pairs(skeleton: Skeleton, leaves: list[int]) -> list[tuple[int, int]]:
    """The pair of legs and the pair of arms; empty if they are ambiguous."""
    # The limbs of a pair have the same length, in any pose. Legs fork off at the root, arms further up.
    length = {bone: skeleton.length[_main_path(skeleton, bone, leaves)] for bone in range(len(skeleton))}
    least = SHORTEST_LIMB * max((float(way.sum()) for way in length.values()), default=0.0)
    found: list[tuple[int, int]] = []
    for fork in (ROOT, *range(len(skeleton))):
        long = [int(bone) for bone in skeleton.children(fork) if len(length[bone]) > 1 and length[bone].sum() > least]
        alike = [(a, b) for a, b in combinations(long, 2) if _unlike(length[a], length[b]) < SAME_LENGTH]
        if alike:
            found.append(min(alike, key=lambda pair: _unlike(length[pair[0]], length[pair[1]])))
    legs = [pair for pair in found if skeleton.parent.item(pair[0]) == ROOT]
    in_legs = [leg for pair in legs for leg in pair]
    arms = [pair for pair in found if pair not in legs and not skeleton.chain[pair[0], in_legs].any()]
    return [legs[0], arms[0]] if legs and len(arms) == 1 else []


def _unlike(one: Array, other: Array) -> float:
    """The relative difference of two limbs, in total length or in their longest bones."""
    sums = [abs(a - b) / max(a, b) for a, b in ((one.sum(), other.sum()), (one.max(), other.max()))]
    return float(max(sums))


def _first_aside(ends: Array, one: Sequence[int], other: Sequence[int], second: bool) -> float:
    """Distance of a limb to the left of its counterpart where they first separate: at the hips or the shoulders."""
    apart = [float(ends[a, 1] - ends[b, 1]) for a, b in zip(one, other, strict=False)]
    size = max(map(abs, apart), default=0.0)
    first = next((way for way in apart if abs(way) > 0.1 * size), 0.0)
    return -first if second else first


def _path(skeleton: Skeleton, bone: int) -> list[int]:
    return np.flatnonzero(skeleton.chain[bone]).tolist()


def _main_path(skeleton: Skeleton, branch: int, leaves: list[int]) -> list[int]:
    """The longest path down a limb, from its branch."""
    ways = [_path(skeleton, leaf) for leaf in leaves if skeleton.chain[leaf, branch]]
    ways = [way[way.index(branch) :] for way in ways]
    return max(ways, key=lambda way: skeleton.length[way].sum())


def _name_arm(skeleton: Skeleton, main: Sequence[int], limb: np.ndarray, part: list[Part]) -> None:
    length = skeleton.length[list(main)]
    upper = 0
    if len(main) > 1:
        # The longest bone; a collar bone or a forearm may be as long, but the length beyond it distinguishes them.
        ratio = np.maximum(length.sum() - np.cumsum(length), 1e-9)[:-1] / np.maximum(length[:-1], 1e-9)
        nearly_longest = length[:-1] >= 0.9 * length[:-1].max()
        upper = int(np.argmin(np.where(nearly_longest, np.abs(np.log(ratio / BEYOND_ELBOW)), np.inf)))
    _name(skeleton, main, limb, upper, part, _ARM)
    if len(main) > upper + 3:
        arm, near, far = length[upper : upper + 3]
        if near < PART_OF_FOREARM * arm and far > HALF * near and near + far < WHOLE * arm:
            part[main[upper + 2]] = "forearm"


def _name(
    skeleton: Skeleton, main: Sequence[int], limb: np.ndarray, first: int, part: list[Part], names: tuple[Part, ...]
) -> None:
    """Labels a limb: bones before its first long bone, the two long bones, and all that follow."""
    for place, bone in enumerate(main):
        part[bone] = names[min(max(place - first + 1, 0), 3)]
    for bone in limb:
        # Fingers and toes begin at the wrist or beyond; other branches stay unlabelled.
        if bone not in main and any(part[above] in names[2:] for above in _path(skeleton, bone)[:-1]):
            part[bone] = names[3]
