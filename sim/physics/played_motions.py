"""Takes: what a library plays on a robot, motion by motion and switch by switch, as the deck would play it."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import read_motions
from controller.deck.routes import Routes
from controller.library.motion_library import MotionLibrary
from controller.mocap.clip import Clip
from controller.mocap.posture import Pose
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array
from sim.robots.robot import Robot, load_robot

DT = 0.01
"""s from sample to sample of a take."""

# A loop is taken from here on, s, when nothing is left of how it began; a switch from so long before it, s, to so long
# after it has settled, and for LONGEST at most.
SETTLED, BEFORE, AFTER, LONGEST = 0.5, 0.2, 0.3, 6.0


@dataclass(frozen=True)
class Take:
    """What was played, T samples DT apart.

    Attributes:
        name: "walk", or "walk > jog".
        loop: whether its end goes over into its beginning.
        targets: joint targets as retargeted, shape (T, J), rad.
        poses: where they come from, length T.
    """

    name: str
    loop: bool
    targets: Array
    poses: tuple[Pose, ...]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self.targets) * DT


def load_for_takes(path: Path, skeleton: Skeleton) -> Robot:
    """Loads a robot as `load_robot` does, to be posed once a sample: its joints may go as far as DT allows."""
    return load_robot(path, skeleton, dt=DT)


def motion_takes(library: MotionLibrary, robot: Robot) -> Iterator[Take]:
    """Each motion: one round of a loop, or all of what happens once."""
    for motion in read_motions(library).values():
        deck = Deck(library, deepcopy(robot.retarget), motion.name)
        if motion.loop:
            for _ in range(round(SETTLED / DT)):
                deck.update(DT)
        yield _take(motion.name, deck, max(2, round(motion.seconds / DT)), loop=motion.loop)


def switch_takes(library: MotionLibrary, robot: Robot) -> Iterator[Take]:
    """Each switch that goes straight from one motion to another; what happens once is left at its end."""
    repertoire = read_motions(library)
    routes = Routes.between(repertoire)
    for source in repertoire.values():
        deck = Deck(library, deepcopy(robot.retarget), source.name)
        for _ in range(round((SETTLED if source.loop else source.seconds) / DT)):
            deck.update(DT)
        for target in repertoire:
            if target == source.name or routes.by_way_of(source.name, target):
                continue
            branch = deepcopy(deck)
            targets, poses = [], []
            after = round(AFTER / DT)
            while after > 0 and len(targets) < round(LONGEST / DT):
                if len(targets) == round(BEFORE / DT):
                    branch.switch(target, direct=True)
                elif len(targets) > round(BEFORE / DT) and branch.settled:
                    after -= 1
                joints, pose = branch.update(DT)
                targets.append(joints.copy())
                poses.append(pose)
            yield Take(f"{source.name} > {target}", False, np.array(targets), tuple(poses))


def switches_by_way_of(library: MotionLibrary) -> dict[tuple[str, str], tuple[str, ...]]:
    """The switches that go by way of other motions, and which."""
    repertoire = read_motions(library)
    routes = Routes.between(repertoire)
    pairs = ((a, b) for a in repertoire for b in repertoire if a != b)
    return {(a, b): way for a, b in pairs if (way := routes.by_way_of(a, b))}


def count_switches(library: MotionLibrary) -> int:
    """How many takes `switch_takes` has."""
    motions = len(read_motions(library))
    return motions * (motions - 1) - len(switches_by_way_of(library))


def _take(name: str, deck: Deck, count: int, *, loop: bool) -> Take:
    targets, poses = [], []
    for _ in range(count):
        joints, pose = deck.update(DT)
        targets.append(joints.copy())
        poses.append(pose)
    return Take(name, loop, np.array(targets), tuple(poses))


def as_clip(library: MotionLibrary, motion: str, seconds: float, rate: float) -> Clip:
    """What a library plays of one motion, as a clip of so many seconds at some rate, Hz."""
    deck = Deck(library, _no_joints, motion)
    places, turns = [], []
    for _ in range(round(seconds * rate)):
        _, pose = deck.update(1.0 / rate)
        places.append(pose.root_position.copy())
        turns.append(pose.rotation.copy())
    return Clip(motion, library.skeleton, rate, np.array(places), np.array(turns))


def _no_joints(pose: Pose) -> Array:
    """For a deck that is asked for its poses only."""
    return np.zeros(0)
