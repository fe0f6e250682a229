"""Turns a recorded tree of joints, of any file, into a clip of rigid bones.

A reader gives the world position and rotation of every joint in every frame:

- The root is the joint called hips or pelvis, or else the first fork; joints above it ("Reference", "Armature", a root
  on the floor) only carry the body, and their movement is in the positions.
- A joint becomes the bone from itself to its children. Children in different places give one bone each, named after
  both joints ("Hips-LeftUpLeg"); children in the same place as their parent add no bone.
- A last joint without an end site is a bone too if it is a hand or a head: its rotation is recorded, not its length. It
  continues the bone before it, in the zero pose if that is one of a body, else on average.
- A bone that changes its length or bends (position channels) has the length of the median frame, and its recorded
  direction in each frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from controller.motion.bone_names import NamedPart, named_parts
from controller.motion.clip import Clip
from controller.motion.reading_options import ReadingOptions
from controller.motion.rest_pose import RecordedBody, rest_skeleton
from controller.motion.rotations import Array, between, conjugate, continuous, dot, multiply, normalise, rotate
from controller.motion.up_axis import Up
from motiondeck_base.errors import FileFormatError

MOST_POSES = 15_000_000  # joints times frames that fit into the memory of a laptop
COINCIDENT = 1e-4  # of the body's size: exporters write 0.000069 for joints in one place
Parts: TypeAlias = list[NamedPart | None]  # body part of each joint, by its name
# Assumed length of a bone without an end: a head relative to the spine below it, a hand to its arm.
HEAD_PER_SPINE, HAND_PER_ARM = 0.25, 0.35
BENT = 0.5  # cosine: wrists and necks are bent by less than 60 degrees on average


@dataclass(frozen=True, eq=False)
class JointTree:
    """J joints over T frames, in the axes and the unit of a file.

    Attributes:
        names: of the joints, unique.
        parent: of each joint, shape (J,), parents first; -1 at the top.
        position: world positions, shape (T, J, 3).
        rotation: world rotations, shape (T, J, 4).
        turns: whether the rotation of a joint is recorded (not of an end site), shape (J,).
    """

    names: tuple[str, ...]
    parent: NDArray[np.int64]
    position: Array
    rotation: Array
    turns: NDArray[np.bool_]


def played(
    names: Sequence[str], parent: Sequence[int], place: Array, turn: Array, turns: NDArray[np.bool_]
) -> JointTree:
    """Forward kinematics: the tree of joints whose poses relative to their parents are known.

    Args:
        names, parent, turns: as in JointTree.
        place: position of each joint in its parent, shape (T, J, 3); overwritten by world positions.
        turn: rotation of each joint relative to its parent, shape (T, J, 4); overwritten by world rotations.
    """
    for joint, above in enumerate(parent):
        if above >= 0:
            place[:, joint] = place[:, above] + rotate(turn[:, above], place[:, joint])
            turn[:, joint] = multiply(turn[:, above], turn[:, joint])
    return JointTree(tuple(names), np.array(parent), place, turn, turns)


def distinct(names: Iterable[str]) -> list[str]:
    """Unique names: a repeated name gets a number."""
    found: dict[str, None] = {}
    for name in names:
        number = 2
        free = name
        while free in found:
            free = f"{name} {number}"
            number += 1
        found[free] = None
    return list(found)


def clip_of(
    tree: JointTree,
    rate: float,
    path: str | Path,
    options: ReadingOptions,
    *,
    unit: float | None = None,
    up: Up | None = None,
) -> Clip:
    """The clip of a tree of joints.

    Args:
        tree: the joints, in the axes and the unit of the file.
        rate: frames per second, Hz.
        path: of the file, which names the clip.
        options: override the file.
        unit: of length, m, by the file or its format; None detects it.
        up: vertical axis, by the file or its format; None detects it.

    Raises:
        FileFormatError: naming the file, if no body has such joints.
    """
    name = Path(path).stem
    tree = replace(tree, names=options.renamed(tree.names, path))
    skeleton, position, rotation = rest_skeleton(name, _body_of(tree, path), options.unit or unit, options.up or up)
    return Clip(name, skeleton, rate, position, continuous(rotation), Path(path).name)


def _body_of(tree: JointTree, path: str | Path) -> RecordedBody:
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
    """The median over some hundred frames, which ignores a few bad ones."""
    return np.median(frames[:: max(1, len(frames) // 400)], axis=0)


def _root(tree: JointTree, parts: Parts, children: list[list[int]]) -> int:
    """The root of the body: the hips, or their ancestor that also carries the thighs and the spine."""
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
    """Names each bone and yields the joints it leads from and to (None: assumed), and its parent bone."""
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
        begun: list[tuple[Array, int]] = []  # ends and indices of the joint's bones
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
    """The name of a bone that begins in a joint: of the joint, or of its only-child ancestor in the same place."""
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
    """The ends of the bones that lead from the trunk to a joint, the last one first."""
    way = _above(tree, joint)
    way = way[: way.index(root)]
    names = [parts[above] for above in way]
    trunk = next((at for at, part in enumerate(names) if part is not None and part.part == "pelvis"), len(way))
    return [above for above in way[:trunk] if np.abs(offset[above]).max() > least]


def _ways_on(tree: JointTree, ends: dict[int, list[int]], offset: Array) -> dict[int, Array]:
    """Directions of bones that continue those before them, in their own joints: in the zero pose, or on average.

    A zero pose that bends one of them is not that of a body: there the axes of joints are arbitrary.
    """
    straight = {joint: normalise(offset[before[0]]) for joint, before in ends.items()}
    mean: dict[int, Array] = {}
    for joint, (last, *_) in ends.items():
        line = normalise(tree.position[:, last] - tree.position[:, tree.parent[last]])
        mean[joint] = normalise(rotate(conjugate(tree.rotation[:, joint]), line).mean(axis=0))
    return mean if any(straight[joint] @ mean[joint] < BENT for joint in ends) else straight


def _assumed_length(part: NamedPart | None, before: Array) -> float:
    """The length of a bone without an end, from the bones before it, shape (N, 3)."""
    hand = part is not None and part.part == "hand"
    before, share = (before[:2], HAND_PER_ARM) if hand else (before, HEAD_PER_SPINE)
    return share * float(np.linalg.norm(before, axis=1).sum())
