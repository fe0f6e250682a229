"""Anatomy: which bone of a skeleton is the thigh, read from its shape, because every recording names bones otherwise.

In the rest pose a body stands with its arms out. The spine is the way from the root to the highest end near the
middle. What branches off at the root and ends below it is a leg, what branches off further up is an arm; the longest on
each side, for faces and twist bones branch off too. Along a leg the two neighbours that are longest together are thigh
and shank; along an arm the longest bone is the upper arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from controller.mocap.skeleton import ROOT, Skeleton

# Forearm and hand, as recorded mostly without the fingers, over the upper arm.
BEYOND_ELBOW = 1.25

Part = Literal[
    "trunk", "neck", "head", "hip", "thigh", "shank", "foot", "clavicle", "upper arm", "forearm", "hand", "other"
]
Side = Literal["left", "right", "middle"]


@dataclass(frozen=True)
class Anatomy:
    """What each of the B bones of a skeleton is.

    Attributes:
        part: the body part each bone belongs to, length B.
        side: the side each bone is on, length B.
    """

    part: tuple[Part, ...]
    side: tuple[Side, ...]

    def first(self, part: Part, side: Side = "middle") -> int | None:
        """The first bone of a part on a side, or None."""
        return next(iter(self.all(part, side)), None)

    def all(self, part: Part, side: Side | None = None) -> list[int]:
        """The bones of a part, from the root outwards; of both sides where no side is given."""
        return [
            bone
            for bone, (p, s) in enumerate(zip(self.part, self.side, strict=True))
            if p == part and side in (None, s)
        ]


def anatomy(skeleton: Skeleton) -> Anatomy:
    """Tells the parts of any skeleton; what resembles no part of a human is "other"."""
    ends = skeleton.chain @ (skeleton.rest_direction * skeleton.length[:, None])
    part: list[Part] = ["other"] * len(skeleton)
    side: list[Side] = ["middle"] * len(skeleton)

    leaves = [bone for bone in range(len(skeleton)) if len(skeleton.children(bone)) == 0]
    top = max(leaves, key=lambda leaf: ends[leaf, 2] - abs(ends[leaf, 1]))
    spine = _path(skeleton, top) if ends[top, 2] > 0.0 else []

    branches = [
        bone for bone in range(len(skeleton)) if bone not in spine and _parent(skeleton, bone) in (ROOT, *spine)
    ]
    ways = {branch: _main_path(skeleton, branch, leaves) for branch in branches}
    arms: list[int] = []  # how far up the spine they branch off
    for branch, way in ways.items():
        which: Side = "left" if ends[way[-1], 1] > 0.0 else "right"
        limb = np.flatnonzero(skeleton.chain[:, branch])
        for bone in limb:
            side[bone] = which
        rivals = [
            other
            for other in branches
            if (ends[ways[other][-1], 1] > 0.0) == (which == "left")
            and (_parent(skeleton, other) == ROOT) == (_parent(skeleton, branch) == ROOT)
        ]
        # Breasts, faces and twist bones branch off too: a limb is the longest of its side.
        if branch != max(rivals, key=lambda other: skeleton.length[ways[other]].sum()):
            continue
        if _parent(skeleton, branch) != ROOT:
            _name_arm(skeleton, way, limb, part)
            # Some skeletons fork below the chest: what goes up beside the arms is then trunk too.
            rises = float(skeleton.rest_direction[branch, 2]) > 0.7
            arms.append(spine.index(_parent(skeleton, branch)) + rises)
        elif ends[limb, 2].min() < 0.0:
            _name_leg(skeleton, way, limb, part)

    # The spine below the arms is trunk, above them neck, and its last bone the head.
    for level, bone in enumerate(spine):
        part[bone] = "trunk" if level <= max(arms, default=level) else "neck"
    if len(spine) > 1:
        part[spine[-1]] = "head"
    return Anatomy(tuple(part), tuple(side))


def _parent(skeleton: Skeleton, bone: int) -> int:
    return int(skeleton.parent[bone])


def _path(skeleton: Skeleton, bone: int) -> list[int]:
    """The bones from the root to this one."""
    path = [bone]
    while (parent := _parent(skeleton, path[0])) != ROOT:
        path.insert(0, parent)
    return path


def _main_path(skeleton: Skeleton, branch: int, leaves: list[int]) -> list[int]:
    """The longest way down a limb, from where it branches off."""
    ways = [_path(skeleton, leaf) for leaf in leaves if skeleton.chain[leaf, branch]]
    ways = [way[way.index(branch) :] for way in ways]
    return max(ways, key=lambda way: skeleton.length[way].sum())


def _name_leg(skeleton: Skeleton, main: Sequence[int], limb: np.ndarray, part: list[Part]) -> None:
    length = skeleton.length[list(main)]
    thigh = int(np.argmax(length[:-1] + length[1:])) if len(main) > 1 else 0
    _name(skeleton, main, limb, thigh, part, ("hip", "thigh", "shank", "foot"))


def _name_arm(skeleton: Skeleton, main: Sequence[int], limb: np.ndarray, part: list[Part]) -> None:
    length = skeleton.length[list(main)]
    upper = 0
    if len(main) > 1:
        # The longest bone; a collar bone or a forearm may be as long, but what lies beyond it tells them apart.
        ratio = np.maximum(length.sum() - np.cumsum(length), 1e-9)[:-1] / np.maximum(length[:-1], 1e-9)
        nearly_longest = length[:-1] >= 0.9 * length[:-1].max()
        upper = int(np.argmin(np.where(nearly_longest, np.abs(np.log(ratio / BEYOND_ELBOW)), np.inf)))
    _name(skeleton, main, limb, upper, part, ("clavicle", "upper arm", "forearm", "hand"))


def _name(
    skeleton: Skeleton,
    main: Sequence[int],
    limb: np.ndarray,
    first: int,
    part: list[Part],
    names: tuple[Part, Part, Part, Part],
) -> None:
    """Names a limb: what comes before its first long bone, the two long bones, and all that follows them."""
    for place, bone in enumerate(main):
        part[bone] = names[min(max(place - first + 1, 0), 3)]
    for bone in limb:
        # Whatever fingers and toes begin at the wrist or beyond; what branches off before is no part of its own.
        if bone not in main and any(part[above] in names[2:] for above in _path(skeleton, bone)[:-1]):
            part[bone] = names[3]
