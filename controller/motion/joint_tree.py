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

Of several people in one file each is a take by name, and none is taken in silence.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.motion.bone_names import named_parts
from controller.motion.clip import Clip, Decision, ReadingOptions, Up, unit_decision, up_decision
from controller.motion.rest_pose import RecordedBody, rest_skeleton
from controller.motion.rotations import Array, between, conjugate, continuous, dot, multiply, normalise, rotate
from controller.motion.upper_body import RESTS, lacks_legs, legs_at_rest, with_legs
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

MOST_POSES = 15_000_000  # joints times frames that fit into the memory of a laptop
COINCIDENT = 1e-4  # of the body's size: exporters write 0.000069 for joints in one place
# Assumed length of a bone without an end: a head relative to the spine below it, a hand to its arm.
HEAD_PER_SPINE, HAND_PER_ARM = 0.25, 0.35
BENT = 0.5  # cosine: wrists and necks are bent by less than 60 degrees on average


@dataclass(frozen=True, eq=False)
class JointTree:
    """J joints over T frames, in the axes and the unit of a file."""

    names: tuple[str, ...]  # unique
    parent: NDArray[np.int64]  # (J,), parents first; -1 at the top
    position: Array  # in the world, (T, J, 3)
    rotation: Array  # in the world, (T, J, 4)
    turns: NDArray[np.bool_]  # (J,), whether the rotation of a joint is recorded (not of an end site)


def played(
    names: Sequence[str], parent: Sequence[int], place: Array, turn: Array, turns: NDArray[np.bool_]
) -> JointTree:
    """Overwrites positions (T, J, 3) and rotations (T, J, 4) of joints in their parents by those in the world."""
    for joint, above in enumerate(parent):
        if above >= 0:
            place[:, joint] = place[:, above] + rotate(turn[:, above], place[:, joint])
            turn[:, joint] = multiply(turn[:, above], turn[:, joint])
    return JointTree(tuple(names), np.array(parent), place, turn, turns)


def distinct(names: Iterable[str]) -> list[str]:
    """Unique names: a repeated name gets a number."""
    found: dict[str, None] = {}
    for name in names:
        found[free_name(name, found)] = None
    return list(found)


def free_name(name: str, taken: Collection[str]) -> str:
    """The name, with a number if it is taken."""
    numbered = (f"{name} {number}" for number in count(2))
    return next(free for free in chain([name], numbered) if free not in taken)


def clip_of(
    tree: JointTree,
    rate: float,
    path: str | Path,
    options: ReadingOptions,
    unit: float | None = None,
    up: Up | None = None,
) -> Clip:
    """The clip of a tree of joints at a rate in Hz (FileFormatError if no body has such joints).

    `unit` of length, m, and `up` are those of the file or its format, None detects them, and options override them.
    """
    name = Path(path).stem
    tree = replace(tree, names=options.renamed(tree.names, path))
    rests = options.upper_body and lacks_legs(tree.names)
    if rests:
        tree = JointTree(*with_legs(tree.names, tree.parent, tree.position, tree.rotation, tree.turns, path))
    body = rest_skeleton(name, _body_of(tree, path), options.unit or unit, options.up or up)
    about_unit = unit_decision(body.unit, body.other_unit, body.skeleton.leg_length, options.unit, unit)
    decisions = about_unit, up_decision(body.up, options.up, up)
    rotation = continuous(body.rotation)
    clip = Clip(name, body.skeleton, rate, body.position, rotation, Path(path).name, decisions)
    return replace(legs_at_rest(clip), decisions=(RESTS, *decisions)) if rests else clip


def _body_of(tree: JointTree, path: str | Path) -> RecordedBody:
    joints = _Joints(tree, path)
    bones = joints.bones()
    if not bones:
        raise FileFormatError(f"{path}: all its joints are in one place. Is it the right file?")
    bends = np.abs(joints.offset - joints.rigid).max(axis=(0, 2)) > joints.least
    ends = {joint: joints.leading(joint) for _, joint, end, _ in bones if end is None}
    ways_on = joints.ways_on(ends)
    vectors: list[Array] = []
    rotations: list[Array] = []
    for _, joint, child, _ in bones:
        turned = tree.rotation[:, joint]
        if child is None:
            vector = ways_on[joint] * joints.assumed_length(joint, ends[joint])
        else:
            vector = joints.rigid[child]
            if bends[child]:
                seen = rotate(turned, joints.offset[:, child])
                there = np.sqrt(dot(seen, seen)) > joints.least
                swing = between(normalise(rotate(turned, vector)), normalise(seen))
                turned = np.where(there[:, None], multiply(swing, turned), turned)
        vectors.append(vector)
        rotations.append(turned)
    names, above = tuple(name for name, *_ in bones), np.array([above for *_, above in bones])
    rotation = np.stack([tree.rotation[:, joints.root], *rotations], axis=1)
    return RecordedBody(names, above, np.array(vectors), tree.position[:, joints.root], rotation)


def _median(frames: Array) -> Array:
    """The median over some hundred frames, which ignores a few bad ones."""
    return np.median(frames[:: max(1, len(frames) // 400)], axis=0)


class _Joints:
    """The joints of a tree as ends of bones: their offsets in their parents over time, (T, J, 3), and rigid, (J, 3)."""

    def __init__(self, tree: JointTree, path: str | Path) -> None:
        above = np.maximum(tree.parent, 0)
        self.offset = rotate(conjugate(tree.rotation[:, above]), tree.position - tree.position[:, above])
        size = float(np.ptp(_median(tree.position - tree.position[:, :1]), axis=0).max())
        if not 0.0 < size < 1e9 or np.abs(tree.position).max() > 1e9:
            raise FileFormatError(f"{path}: no body has joints like these. Is it the right file?")
        self.rigid = _median(self.offset)
        self.least = COINCIDENT * size  # a smaller offset is none
        self._apart = np.abs(self.rigid).max(axis=1) > self.least
        self._tree = tree
        self._parts = [None if named is None else named.part for named in named_parts(tree.names)]
        self._children = [np.flatnonzero(tree.parent == joint).tolist() for joint in range(len(tree.names))]
        self.root = self._find_root()

    def _find_root(self) -> int:
        """The root of the body: the hips, or their ancestor that also carries the thighs and the spine."""
        hips = (joint for joint, part in enumerate(self._parts) if part == "pelvis" and self._children[joint])
        root = next(hips, 0)
        for joint, part in enumerate(self._parts):
            if part in ("thigh", "trunk"):
                while root not in self._above(joint) and self._tree.parent[root] >= 0:
                    root = int(self._tree.parent[root])
        while len(self._children[root]) == 1 and self._forks(self._children[root][0]):
            root = self._children[root][0]
        return root

    def _above(self, joint: int) -> list[int]:
        way = [joint]
        while self._tree.parent[way[-1]] >= 0:
            way.append(int(self._tree.parent[way[-1]]))
        return way

    def _forks(self, joint: int) -> bool:
        while len(self._children[joint]) == 1:
            joint = self._children[joint][0]
        return bool(self._children[joint])

    def bones(self) -> list[tuple[str, int, int | None, int]]:
        """The name of each bone, the joints it leads from and to (None: assumed), and its parent bone."""
        names, found = self._tree.names, list[tuple[str, int, int | None, int]]()
        waiting = [(self.root, -1)]  # a joint, and the bone that ends in it
        while waiting:
            joint, above = waiting.pop()
            apart = [child for child in self._children[joint] if self._apart[child]]
            if not apart and self._is_unfinished(joint) and self.leading(joint):
                found.append((names[joint], joint, None, above))
            below: list[tuple[int, int]] = []
            begun: list[tuple[int, int]] = []  # ends and indices of the joint's bones
            for child in self._children[joint]:
                bone = above
                if child in apart:
                    bone = next((index for end, index in begun if self._near(end, child)), len(found))
                    if bone == len(found):
                        begun.append((child, bone))
                        together = [other for other in apart if self._near(other, child)]
                        known = (names[other] for other in together if self._parts[other] is not None)
                        name = self._name(joint)
                        if len(together) < len(apart):
                            name += f"-{next(known, names[child])}"
                        found.append((name, joint, child, above))
                below.append((child, bone))
            waiting.extend(reversed(below))
        return found

    def _name(self, joint: int) -> str:
        """The name of a bone that begins in a joint: of the joint, or of its only-child ancestor in the same place."""
        place = joint
        while self._parts[place] is None and self._tree.parent[place] >= 0 and not self._apart[place]:
            place = int(self._tree.parent[place])
            if len(self._children[place]) > 1:
                break
        named = self._parts[place] is not None and len(self._children[place]) == 1
        return self._tree.names[place if named else joint]

    def _near(self, one: int, other: int) -> bool:
        return bool(np.abs(self.rigid[one] - self.rigid[other]).max() <= self.least)

    def _is_unfinished(self, joint: int) -> bool:
        """Whether a joint is a head or a hand without an end."""
        last = all(not self._children[child] for child in self._children[joint])
        part = self._parts[joint]
        return bool(self._tree.turns[joint]) and (part == "head" or (part == "hand" and last))

    def leading(self, joint: int) -> list[int]:
        """The ends of the bones that lead from the trunk to a joint, the last one first."""
        way = self._above(joint)
        way = way[: way.index(self.root)]
        trunk = next((at for at, above in enumerate(way) if self._parts[above] == "pelvis"), len(way))
        return [above for above in way[:trunk] if self._apart[above]]

    def ways_on(self, ends: dict[int, list[int]]) -> dict[int, Array]:
        """Directions of bones that continue those before them, in their own joints: in the zero pose, or on average."""
        # A zero pose that bends one of them is not that of a body: there the axes of joints are arbitrary.
        tree = self._tree
        straight = {joint: normalise(self.rigid[before[0]]) for joint, before in ends.items()}
        mean: dict[int, Array] = {}
        for joint, (last, *_) in ends.items():
            line = normalise(tree.position[:, last] - tree.position[:, tree.parent[last]])
            mean[joint] = normalise(rotate(conjugate(tree.rotation[:, joint]), line).mean(axis=0))
        return mean if any(straight[joint] @ mean[joint] < BENT for joint in ends) else straight

    def assumed_length(self, joint: int, leading: list[int]) -> float:
        """The length of a bone without an end, from the bones before it."""
        before, share = self.rigid[leading], HEAD_PER_SPINE
        if self._parts[joint] == "hand":
            before, share = before[:2], HAND_PER_ARM
        return share * float(np.linalg.norm(before, axis=1).sum())


class SeveralPeopleError(FileFormatError):
    """A file holds several people, or episodes of a robot, and none of them was chosen."""

    def __init__(self, path: str | Path, people: Collection[str], what: str = "people") -> None:
        self.people = tuple(people)
        super().__init__(f"{path}: holds {len(people)} {what} ({listed(self.people)}). Choose one: --skeleton NAME.")


def chosen_person(path: str | Path, people: Collection[str], wanted: str | None) -> str:
    """The person of a file with several to read; FileFormatError if none of them is `wanted`."""
    if wanted is None:
        raise SeveralPeopleError(path, people)
    if wanted not in people:
        raise FileFormatError(f"{path}: no person in it is called '{wanted}' (there are: {listed(tuple(people))}).")
    return wanted


def people_in(names: Sequence[str], parent: Sequence[int]) -> dict[str, list[int]]:
    """The joints of each body with two thighs by name, with those above it; parents come first, -1 at the top."""
    # A body has the name of the topmost joint that is its own, up to a colon.
    ways: list[set[int]] = []  # of each joint, itself and all above it
    for joint, above in enumerate(parent):
        ways.append({joint, *(ways[above] if above >= 0 else ())})
    found: dict[str, list[int]] = {}
    waiting = [-1]
    while waiting:
        joint = waiting.pop(0)
        bodies = [child for child, on in enumerate(parent) if on == joint and _has_thighs(names, ways, child)]
        if len(bodies) > 1 or joint == -1:
            waiting += bodies
        else:
            own = [one for one, way in enumerate(ways) if joint in way or one in ways[joint]]
            found[named_apart(names[joint], found)] = own
    return found


def one_body(tree: JointTree, path: str | Path, wanted: str | None) -> tuple[JointTree, tuple[Decision, ...]]:
    """The joints of one body, and what was decided where others were left out that are none; see `chosen_person`."""
    parent = tree.parent.tolist()
    tops = [joint for joint, above in enumerate(parent) if above < 0]
    people = people_in(tree.names, parent)
    if not people and len(tops) > 1:
        for top, end in pairwise([*tops, len(parent)]):
            people[named_apart(tree.names[top], people)] = list(range(top, end))
    if len(people) < 2 and len(tops) < 2:
        return tree, ()
    name = next(iter(people)) if len(people) == 1 else chosen_person(path, people, wanted)
    decisions: tuple[Decision, ...] = ()
    if others := [tree.names[top] for top in tops if not any(top in own for own in people.values())]:
        decisions = (Decision("people", name, f"{listed(others)}: no thighs by name", "--rename OLD=LeftUpLeg", True),)
    own = people[name]
    above = np.array([own.index(parent[joint]) if parent[joint] >= 0 else -1 for joint in own])
    names = tuple(tree.names[joint] for joint in own)
    return JointTree(names, above, tree.position[:, own], tree.rotation[:, own], tree.turns[own]), decisions


def named_apart(joint: str, taken: Collection[str]) -> str:
    """The name of a person by the topmost joint, "Anna:Hips" or "Hips", that none of `taken` has."""
    return free_name(joint.rpartition(":")[0] or joint, taken)


def _has_thighs(names: Sequence[str], ways: list[set[int]], top: int) -> bool:
    parts = named_parts([name for name, way in zip(names, ways, strict=True) if top in way])
    return {("thigh", "left"), ("thigh", "right")} <= {(of.part, of.side) for of in parts if of is not None}
