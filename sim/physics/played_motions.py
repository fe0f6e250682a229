"""Plays the motions and switches of a library as the deck would, and samples the targets of a robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import Motion, read_motions
from controller.deck.routes import Routes
from controller.library.motion_library import MotionLibrary
from controller.motion.clip import Clip
from controller.motion.posture import Pose
from controller.motion.rotations import Array, continuous, multiply, normalise, rotate, yaw
from controller.motion.skeleton import Skeleton
from sim.robots.robot import Robot, load_robot

T = TypeVar("T")

DT = 0.01
"""s from sample to sample."""

# A loop is sampled after SETTLED, s, when nothing is left of its start; a switch from BEFORE it to AFTER it has
# settled, for at most LONGEST.
SETTLED, BEFORE, AFTER, LONGEST = 0.5, 0.2, 0.3, 6.0


@dataclass(frozen=True)
class PlayedMotion:
    """A motion or a switch as it was played, T samples DT apart.

    Attributes:
        name: "walk", or "walk > jog".
        loop: whether its end continues in its beginning.
        targets: joint targets as retargeted, shape (T, J), rad.
        poses: of the human, from which the targets come, length T.
    """

    name: str
    loop: bool
    targets: Array
    poses: tuple[Pose, ...]

    @property
    def seconds(self) -> float:
        """Its duration."""
        return len(self.targets) * DT


def load_sampled_robot(path: Path, skeleton: Skeleton) -> Robot:
    """Loads a robot that is posed once per sample: its joints may move as far as their limits allow in DT."""
    return load_robot(path, skeleton, dt=DT)


def play_motions(library: MotionLibrary, robot: Robot, names: Sequence[str] | None = None) -> Iterator[PlayedMotion]:
    """Each motion, or those named: one round of a loop, or a whole one-shot."""
    for motion in _named(library, names):
        deck = Deck(library, _copied(robot.retarget, robot), motion.name)
        if motion.loop:
            for _ in range(round(SETTLED / DT)):
                deck.update(DT)
        yield _played(motion.name, deck, max(2, round(motion.seconds / DT)), loop=motion.loop)


def play_switches(library: MotionLibrary, robot: Robot, names: Sequence[str] | None = None) -> Iterator[PlayedMotion]:
    """Each direct switch from a motion, or from those named, to another; one-shots are left at their end."""
    repertoire = read_motions(library)
    routes = Routes.of(library)
    for source in _named(library, names):
        deck = Deck(library, _copied(robot.retarget, robot), source.name)
        for _ in range(round((SETTLED if source.loop else source.seconds) / DT)):
            deck.update(DT)
        for target in repertoire:
            if target == source.name or routes.by_way_of(source.name, target):
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
    return {(a, b): way for a, b in pairs if (way := routes.by_way_of(a, b))}


def count_switches(library: MotionLibrary) -> int:
    """The number of switches that `play_switches` yields."""
    motions = len(read_motions(library))
    return motions * (motions - 1) - len(switches_by_way_of(library))


def onward(poses: Sequence[Pose]) -> Iterator[Pose]:
    """The poses of a loop, round after round, each of which begins where and as the last one has ended."""
    first, last, before = poses[0], poses[-1], poses[-2]
    # One sample more than the loop has is the beginning of the next round.
    turn = float(last.heading + (last.heading - before.heading) - first.heading)
    there = last.root_position + (last.root_position - before.root_position)
    there[2] = first.root_position[2]
    place, angle = np.zeros(3), 0.0
    while True:
        facing = yaw(angle)
        for pose in poses:
            root = place + rotate(facing, pose.root_position - first.root_position) + first.root_position
            yield Pose(root, pose.heading + angle, multiply(facing, pose.rotation))
        place, angle = place + rotate(facing, there - first.root_position), angle + turn


def targets_at(played: PlayedMotion, tempo: float, tick: float) -> Array:
    """The targets at a tempo, a tick, s, from one to the next, shape (K, J), rad."""
    k, share = _ticks(played, tempo, tick)
    return played.targets[k] + share[:, None] * (played.targets[k + 1] - played.targets[k])


def poses_at(played: PlayedMotion, tempo: float, tick: float) -> list[Pose]:
    """The poses at a tempo, a tick, s, from one to the next, length K."""
    k, share = _ticks(played, tempo, tick)
    root = np.array([pose.root_position for pose in played.poses])
    heading = np.unwrap([float(pose.heading) for pose in played.poses])
    rotation = continuous(np.array([pose.rotation for pose in played.poses]))
    root = root[k] + share[:, None] * (root[k + 1] - root[k])
    heading = heading[k] + share * (heading[k + 1] - heading[k])
    # From sample to sample a bone turns so little that linear interpolation is enough.
    rotation = normalise(rotation[k] + share[:, None, None] * (rotation[k + 1] - rotation[k]))
    return [Pose(*pose) for pose in zip(root, heading, rotation, strict=True)]


def _ticks(played: PlayedMotion, tempo: float, tick: float) -> tuple[NDArray[np.int64], Array]:
    """Which sample comes before each of the K ticks of a loop, and how far the tick is on the way to the next one."""
    at = np.arange(0.0, len(played.targets) - 1, tick * tempo / DT)
    before = at.astype(np.int64)
    return before, at - before


def _copied(what: T, robot: Robot) -> T:
    """A deep copy that shares the robot's model, which nothing changes: with meshes it is large."""
    return deepcopy(what, {id(robot.model): robot.model})


def _played(name: str, deck: Deck, count: int, *, loop: bool) -> PlayedMotion:
    targets, poses = [], []
    for _ in range(count):
        joints, pose = deck.update(DT)
        targets.append(joints.copy())
        poses.append(pose)
    return PlayedMotion(name, loop, np.array(targets), tuple(poses))


def as_clip(library: MotionLibrary, motion: str, seconds: float, rate: float) -> Clip:
    """One motion of a library as a clip of so many seconds at a rate, Hz."""
    deck = Deck(library, _no_joints, motion)
    places, turns = [], []
    for _ in range(round(seconds * rate)):
        _, pose = deck.update(1.0 / rate)
        places.append(pose.root_position.copy())
        turns.append(pose.rotation.copy())
    return Clip(motion, library.skeleton, rate, np.array(places), np.array(turns))


def _no_joints(pose: Pose) -> Array:
    """Stands in for a retargeter where only poses are needed."""
    return np.zeros(0)
