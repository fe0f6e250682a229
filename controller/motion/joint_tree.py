"""A recorded tree of joints, whatever file it came from, made into bones.

A reader gives where every joint is and how it is turned, frame by frame; here joints become rigid bones:

- The root is the joint called hips or pelvis, or else the first fork; what is above it ("Reference", "Armature", a root
  on the floor) only carries the body, and its movement is in the positions.
- A joint becomes the bone from itself to its children. Where these begin in different places there is one bone for each
  of them, called after both joints ("Hips-LeftUpLeg"); children that begin where their parent does add no bone.
- A joint that ends the tree without an end site is a bone too if it is a hand or a head: how it is turned is recorded,
  only its length is not. It continues the bone before it, in the zero pose where that is a body's, else on average.
- Where a bone changes its length or bends (position channels), it is as long as in the median frame, and turned in each
  frame to where it points there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from controller.motion.bone_names import NamedPart, named_parts
from controller.motion.rest_pose import RecordedBody
from controller.motion.rotations import Array, between, conjugate, dot, multiply, normalise, rotate
from motiondeck_base.errors import FileFormatError

MOST_POSES = 15_000_000  # joints times frames: what fits into the memory of a laptop
COINCIDENT = 1e-4  # of the body's size: exporters write 0.000069 for joints that sit in one place
Parts: TypeAlias = list[NamedPart | None]  # what the name of each joint means
# How long a bone is whose end the file does not give: a head against the spine below it, a hand against its arm.
HEAD_PER_SPINE, HAND_PER_ARM = 0.25, 0.35
BENT = 0.5  # cosine: nobody's wrist or neck is bent by more than 60 degrees on average


@dataclass(frozen=True, eq=False)
class JointTree:
    """J joints over T frames, in the axes and the unit of a file.

    Attributes:
        names: of the joints, no two alike.
        parent: of each joint, shape (J,), parents first; -1 for the one at the top.
        position: world positions, shape (T, J, 3).
        rotation: world rotations, shape (T, J, 4).
        turns: whether a joint's own rotation is recorded (an end site's is not), shape (J,).
    """

    names: tuple[str, ...]
    parent: NDArray[np.int64]
    position: Array
    rotation: Array
    turns: NDArray[np.bool_]


def played(
    names: Sequence[str], parent: Sequence[int], place: Array, turn: Array, turns: NDArray[np.bool_]
) -> JointTree:
    """The tree whose joints stand and turn as given against their parents.

    Args:
        names: of the joints, no two alike.
        parent: of each joint, parents first; -1 for the one at the top.
        place: of each joint seen from its parent, shape (T, J, 3); overwritten by the tree's own positions.
        turn: of each joint against its parent, shape (T, J, 4); overwritten by the tree's own rotations.
        turns: whether a joint's own rotation is recorded, shape (J,).
    """
    for joint, above in enumerate(parent):
        if above >= 0:
            place[:, joint] = place[:, above] + rotate(turn[:, above], place[:, joint])
            turn[:, joint] = multiply(turn[:, above], turn[:, joint])
    return JointTree(tuple(names), np.array(parent), place, turn, turns)


def distinct(names: Iterable[str]) -> list[str]:
    """Names of which no two are alike: a name that was there before gets a number."""
    found: dict[str, None] = {}
    for name in names:
        number = 2
        free = name
        while free in found:
            free = f"{name} {number}"
            number += 1
        found[free] = None
    return list(found)


def body_of(tree: JointTree, path: object) -> RecordedBody:
    """The bones of a tree.

    Raises:
        FileFormatError: naming the file, if no body has such joints.
    """
    children = [np.flatnonzero(tree.parent == joint).tolist() for joint in range(len(tree.names))]
    above = np.maximum(tree.parent, 0)
    offset = rotate(conjugate(tree.rotation[:, above]), tree.position - tree.position[:, above])
    size = float(np.ptp(_median(tree.position - tree.position[:, :1]), axis=0).max())
    if not 0.0 < size < 1e9 or np.abs(tree.position).max() > 1e9:
        raise FileFormatError(f"{path}: no body has joints like these. Is it the right file?")
    rigid = _median(offset)
    least = COINCIDENT * size
    bends = np.abs(offset - rigid).max(axis=(0, 2)) > least
    parts = named_parts(tree.names)
    root = _root(tree, parts, children)

    names: list[str] = []
    parents: list[int] = []
    vectors: list[Array] = []
    rotations: list[Array] = []
    bones = [*_bones(tree, parts, children, rigid, least, root, names)]
    ends = {joint: _leading(tree, parts, joint, rigid, least, root) for joint, end, _ in bones if end is None}
    ways_on = _ways_on(tree, ends, rigid)
    for joint, child, bone_above in bones:
        turned = tree.rotation[:, joint]
        if child is None:
            vector = ways_on[joint] * _assumed_length(parts[joint], rigid[ends[joint]])
        else:
            vector = rigid[child]
            if bends[child]:
                seen = rotate(turned, offset[:, child])
                there = np.sqrt(dot(seen, seen)) > least
                swing = between(normalise(rotate(turned, vector)), normalise(seen))
                turned = np.where(there[:, None], multiply(swing, turned), turned)
        parents.append(bone_above)
        vectors.append(vector)
        rotations.append(turned)
    if not names:
        raise FileFormatError(f"{path}: all its joints are in one place. Is it the right file?")
    return RecordedBody(
        tuple(names),
        np.array(parents),
        np.array(vectors),
        tree.position[:, root],
        np.stack([tree.rotation[:, root], *rotations], axis=1),
    )


def _median(frames: Array) -> Array:
    """The median over some hundred frames: enough to see past a few bad ones."""
    return np.median(frames[:: max(1, len(frames) // 400)], axis=0)


def _root(tree: JointTree, parts: Parts, children: list[list[int]]) -> int:
    """The joint that the body hangs from: the hips, or what is above them if thighs or a spine hang from there."""
    named = (
        joint for joint, part in enumerate(parts) if part is not None and part.part == "pelvis" and children[joint]
    )
    root = next(named, 0)
    for joint, part in enumerate(parts):
        if part is not None and part.part in ("thigh", "trunk"):
            while root not in _above(tree, joint) and tree.parent[root] >= 0:
                root = int(tree.parent[root])
    while len(children[root]) == 1:
        child = children[root][0]
        if not _forks(children, child):
            break
        root = child
    return root


def _above(tree: JointTree, joint: int) -> list[int]:
    """A joint and what it hangs from."""
    way = [joint]
    while tree.parent[way[-1]] >= 0:
        way.append(int(tree.parent[way[-1]]))
    return way


def _forks(children: list[list[int]], joint: int) -> bool:
    while len(children[joint]) == 1:
        joint = children[joint][0]
    return bool(children[joint])


def _bones(
    tree: JointTree,
    parts: Parts,
    children: list[list[int]],
    offset: Array,
    least: float,
    root: int,
    names: list[str],
) -> Iterator[tuple[int, int | None, int]]:
    """Names each bone and gives the joints it leads from and to (None: assumed), and the bone it hangs from."""
    waiting = [(root, -1)]  # a joint, and the bone that ends in it
    while waiting:
        joint, above = waiting.pop()
        apart = [child for child in children[joint] if np.abs(offset[child]).max() > least]
        ways = _distinct([offset[child] for child in apart], least)
        unfinished = not apart and _unfinished(tree, parts, children, joint)
        if unfinished and _leading(tree, parts, joint, offset, least, root):
            names.append(tree.names[joint])
            yield joint, None, above
        below: list[tuple[int, int]] = []
        begun: list[tuple[Array, int]] = []  # where the joint's bones end, and which bones they are
        for child in children[joint]:
            bone = above
            if child in apart:
                same = (b for way, b in begun if _near(way, offset[child], least))
                bone = next(same, -2)
                if bone == -2:
                    bone = len(names)
                    begun.append((offset[child], bone))
                    one = _called(tree, parts, children, joint, offset, least)
                    together = [c for c in apart if _near(offset[c], offset[child], least)]
                    known = (tree.names[c] for c in together if parts[c] is not None)
                    names.append(one if len(ways) == 1 else f"{one}-{next(known, tree.names[child])}")
                    yield joint, child, above
            below.append((child, bone))
        waiting.extend(reversed(below))


def _called(tree: JointTree, parts: Parts, children: list[list[int]], joint: int, offset: Array, least: float) -> str:
    """What a bone that begins in a joint is called: the joint, or one in the same place of which only it hangs."""
    place = joint
    while parts[place] is None and tree.parent[place] >= 0 and np.abs(offset[place]).max() <= least:
        place = int(tree.parent[place])
        if len(children[place]) > 1:
            break
    return tree.names[place if parts[place] is not None and len(children[place]) == 1 else joint]


def _near(one: Array, other: Array, tolerance: float) -> bool:
    return bool(np.abs(one - other).max() <= tolerance)


def _distinct(vectors: list[Array], tolerance: float) -> list[Array]:
    kept: list[Array] = []
    for vector in vectors:
        if not any(_near(vector, other, tolerance) for other in kept):
            kept.append(vector)
    return kept


def _unfinished(tree: JointTree, parts: Parts, children: list[list[int]], joint: int) -> bool:
    """Whether a joint is a head or a hand without an end."""
    part = parts[joint]
    if part is None or not tree.turns[joint]:
        return False
    last = all(not children[child] for child in children[joint])
    return part.part == "head" or (part.part == "hand" and last)


def _leading(tree: JointTree, parts: Parts, joint: int, offset: Array, least: float, root: int) -> list[int]:
    """The joints in which the bones end that lead to a joint from the trunk, the last one first."""
    way = _above(tree, joint)
    way = way[: way.index(root)]
    names = [parts[above] for above in way]
    trunk = next((at for at, part in enumerate(names) if part is not None and part.part == "pelvis"), len(way))
    return [above for above in way[:trunk] if np.abs(offset[above]).max() > least]


def _ways_on(tree: JointTree, ends: dict[int, list[int]], offset: Array) -> dict[int, Array]:
    """Where bones point that continue those before them, seen from their own joints: in the zero pose, or on average.

    A zero pose that bends one of them is none of a body: there the joints' axes have directions of their own.
    """
    straight = {joint: normalise(offset[before[0]]) for joint, before in ends.items()}
    mean: dict[int, Array] = {}
    for joint, (last, *_) in ends.items():
        line = normalise(tree.position[:, last] - tree.position[:, tree.parent[last]])
        mean[joint] = normalise(rotate(conjugate(tree.rotation[:, joint]), line).mean(axis=0))
    return mean if any(straight[joint] @ mean[joint] < BENT for joint in ends) else straight


def _assumed_length(part: NamedPart | None, before: Array) -> float:
    """How long a bone without an end is, after those before it, shape (N, 3)."""
    hand = part is not None and part.part == "hand"
    before, share = (before[:2], HAND_PER_ARM) if hand else (before, HEAD_PER_SPINE)
    return share * float(np.linalg.norm(before, axis=1).sum())
