"""Samples what a deck plays: the motions and switches of a library on a robot, or a motion as a clip."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from typing import TypeVar

import numpy as np

from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import Motion, read_motions
from controller.deck.routes import Routes
from controller.library.motion_library import MotionLibrary
from controller.motion.clip import Clip
from sim.physics.played_motions import DT, PlayedMotion
from sim.robots.robot import Robot

T = TypeVar("T")

# A loop is sampled after SETTLED, s, when nothing is left of its start; a switch from BEFORE it to AFTER it has
# settled, for at most LONGEST.
SETTLED, BEFORE, AFTER, LONGEST = 0.5, 0.2, 0.3, 6.0


def play_motions(library: MotionLibrary, robot: Robot, names: Sequence[str] | None = None) -> Iterator[PlayedMotion]:
    """Each motion, or those named: one round of a loop, or a whole one-shot."""
    for motion in _named(library, names):
        deck = Deck(library, _copied(robot.retarget, robot), motion.name)
        if motion.loop:
            for _ in range(round(SETTLED / DT)):
                deck.update(DT)
        targets, poses = [], []
        for _ in range(max(2, round(motion.seconds / DT))):
            joints, pose = deck.update(DT)
            targets.append(joints.copy())
            poses.append(pose)
        yield PlayedMotion(motion.name, motion.loop, np.array(targets), tuple(poses))


def play_switches(library: MotionLibrary, robot: Robot, names: Sequence[str] | None = None) -> Iterator[PlayedMotion]:
    """Each direct switch from a motion, or from those named, to another; one-shots are left at their end."""
    repertoire = read_motions(library)
    routes = Routes.of(library)
    for source in _named(library, names):
        deck = Deck(library, _copied(robot.retarget, robot), source.name)
        for _ in range(round((SETTLED if source.loop else source.seconds) / DT)):
            deck.update(DT)
        for target in repertoire:
            if target == source.name or routes.way(source.name, target):
                continue
            branch = _copied(deck, robot)
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
            yield PlayedMotion(f"{source.name} > {target}", False, np.array(targets), tuple(poses))


def _named(library: MotionLibrary, names: Sequence[str] | None) -> list[Motion]:
    return [motion for name, motion in read_motions(library).items() if names is None or name in names]


def switches_by_way_of(library: MotionLibrary) -> dict[tuple[str, str], tuple[str, ...]]:
    """The switches that go by way of other motions, with those motions."""
    repertoire = read_motions(library)
    routes = Routes.of(library)
    pairs = ((a, b) for a in repertoire for b in repertoire if a != b)
    return {(a, b): way for a, b in pairs if (way := routes.way(a, b))}


def _copied(what: T, robot: Robot) -> T:
    """A deep copy that shares the robot's model, which nothing changes: with meshes it is large."""
    return deepcopy(what, {id(robot.model): robot.model})


def as_clip(library: MotionLibrary, motion: str, seconds: float, rate: float) -> Clip:
    """One motion of a library as a clip of a length, s, at a rate, Hz."""
    deck = Deck(library, lambda pose: np.zeros(0), motion)  # only its poses are needed
    poses = [deck.update(1.0 / rate)[1] for _ in range(round(seconds * rate))]
    places, turns = np.array([pose.root_position for pose in poses]), np.array([pose.rotation for pose in poses])
    return Clip(motion, library.skeleton, rate, places, turns)
