"""A motion as it was played: samples of joint targets and of the human's poses, read at any tempo."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array, Indices, continuous, multiply, normalise, rotate, yaw
from controller.motion.skeleton import Pose

DT = 0.01  # s from sample to sample


@dataclass(frozen=True)
class PlayedMotion:
    """A motion or a switch as it was played, T samples DT apart."""

    name: str  # "walk", or "walk > jog"
    loop: bool  # whether its end continues in its beginning
    targets: Array  # retargeted joints, shape (T, J), rad
    poses: tuple[Pose, ...]  # of the human, length T


def endless_poses(poses: Sequence[Pose]) -> Iterator[Pose]:
    """The poses of an endless loop: each round continues place and heading of the last one."""
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
            yield Pose(root, pose.heading + angle, multiply(facing, pose.rotation), offsets=pose.offsets)
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
    offsets = [played.poses[sample].offsets for sample in k]
    return [Pose(*pose, offsets=own) for *pose, own in zip(root, heading, rotation, offsets, strict=True)]


def _ticks(played: PlayedMotion, tempo: float, tick: float) -> tuple[Indices, Array]:
    """The sample before each of the K ticks, and the tick's share of the way to the next one."""
    at = np.arange(0.0, len(played.targets) - 1, tick * tempo / DT)
    before = at.astype(np.int64)
    return before, at - before
