"""Several people in one file: each is a take by name, and none is taken in silence."""

from collections.abc import Collection, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from controller.motion.bone_names import named_parts
from controller.motion.clip import Decision
from controller.motion.joint_tree import JointTree, free_name
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed


class SeveralPeopleError(FileFormatError):
    """A file holds several people, and none of them was chosen."""

    def __init__(self, path: str | Path, people: Collection[str]) -> None:
        self.people = tuple(people)
        super().__init__(f"{path}: holds {len(people)} people ({listed(self.people)}). Choose one: --skeleton NAME.")


def chosen_person(path: str | Path, people: Collection[str], wanted: str | None) -> str:
    """The person of a file with several to read; FileFormatError if none of them is `wanted`."""
    if wanted is None:
        raise SeveralPeopleError(path, people)
    if wanted not in people:
        raise FileFormatError(f"{path}: no person in it is called '{wanted}' (there are: {listed(tuple(people))}).")
    return wanted


def people_in(names: Sequence[str], parent: Sequence[int]) -> dict[str, list[int]]:
    """The joints of each body with two thighs by name, with those above it; parents are -1 at the top."""
    # A body has the name of the topmost joint that is its own, up to a colon.

    ways: list[set[int]] = []  # of each joint, itself and all above it
    for joint in range(len(names)):
        ways.append(set())
        while joint >= 0:
            ways[-1].add(joint)
            joint = parent[joint]
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
