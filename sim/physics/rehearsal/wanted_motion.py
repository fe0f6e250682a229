"""Wanted motion: a motion as a robot would do it if nothing could make it fall, and how it gets into it and out of it.

A motion that is played once starts and ends in the robot's rest pose where it starts and ends on its feet: half a step
in the air cannot be held.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice

import mujoco
import numpy as np

from controller.motion.rotations import (
    Array,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
    yaw,
)
from sim.models.gravity import GRAVITY
from sim.models.surface import LowestPoint
from sim.physics.played_motions import DT, PlayedMotion, onward, poses_at, targets_at
from sim.robots.robot import Robot

# A root above this share of its height at rest is on its feet.
ON_FEET = 0.85
# How long it takes from rest to the motion and back, and how long the end is held, in sqrt(height / g).
JOINS, HOLDS = 4.0, 5.0


@dataclass(frozen=True)
class WantedMotion:
    """What a robot is to do, T samples DT apart.

    Attributes:
        targets: of its joints, shape (T, J), rad.
        qpos: the robot in it, its lowest point on the floor, shape (T, nq).
    """

    targets: Array
    qpos: Array

    def __len__(self) -> int:
        return len(self.targets)


def wanted_motion(robot: Robot, played: PlayedMotion, tempo: float = 1.0, rounds: int = 1) -> WantedMotion:
    """What is wanted of a robot that does a motion.

    Args:
        robot: who does it.
        played: the motion.
        tempo: at which it is done.
        rounds: how often a loop goes round.
    """
    postures = _Postures(robot)
    motion = postures.played(played, tempo, rounds)
    first, last = motion.qpos[0], motion.qpos[-1]
    high = ON_FEET * float(postures.standing(first)[2])
    beat = math.sqrt(float(postures.standing(first)[2]) / GRAVITY)
    parts = [motion]
    if first[2] > high:
        parts.insert(0, postures.joined(postures.standing(first), first, JOINS * beat))
    if not played.loop and last[2] > high:
        end = postures.standing(last)
        parts += [postures.joined(last, end, JOINS * beat), postures.joined(end, end, HOLDS * beat)]
    return WantedMotion(np.concatenate([part.targets for part in parts]), np.concatenate([part.qpos for part in parts]))


class _Postures:
    """Postures of a robot on the floor."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._data = robot, mujoco.MjData(robot.model)
        self._lowest = LowestPoint(robot.model)

    def played(self, played: PlayedMotion, tempo: float, rounds: int) -> WantedMotion:
        """The motion itself."""
        robot = self._robot
        targets = np.clip(targets_at(played, tempo, DT), robot.limits.lower, robot.limits.upper)
        poses = poses_at(played, tempo, DT)
        if played.loop:
            targets, poses = np.tile(targets, (rounds, 1)), [*islice(onward(poses), rounds * len(poses))]
        if robot.footing is not None:
            robot.footing.reset(DT)
        state, qpos = robot.model.qpos0.copy(), np.empty((len(targets), robot.model.nq))
        for k, pose in enumerate(poses):
            robot.place(targets[k], pose, state)
            qpos[k] = state
        return WantedMotion(targets, np.array([self._on_the_floor(row) for row in qpos]))

    def standing(self, where: Array) -> Array:
        """The rest pose (nq,) at the place and with the heading of another one."""
        qpos = self._robot.model.qpos0.copy()
        self._robot.layout.place(self._robot.rest, qpos)
        qpos[:2] = where[:2]
        qpos[3:7] = multiply(yaw(_heading(where, qpos[3:7])), qpos[3:7])
        return self._on_the_floor(qpos)

    def joined(self, start: Array, end: Array, seconds: float) -> WantedMotion:
        """The way from a posture (nq,) to before another one, smoothly."""
        layout, rest = self._robot.layout, self._robot.rest
        first, last = np.empty_like(rest), np.empty_like(rest)
        layout.read(start, near=rest, out=first)
        layout.read(end, near=rest, out=last)
        share = np.arange(round(seconds / DT)) / round(seconds / DT)
        share = (share * share * (3.0 - 2.0 * share))[:, None]
        targets = first + share * (last - first)
        qpos = start + share * (end - start)
        turn = to_rotation_vector(multiply(end[3:7], conjugate(start[3:7])))
        qpos[:, 3:7] = multiply(from_rotation_vector(share * turn), start[3:7])
        for row, target in zip(qpos, targets, strict=True):
            layout.place(target, row)
            row[:] = self._on_the_floor(row)
        return WantedMotion(targets, qpos)

    def _on_the_floor(self, qpos: Array) -> Array:
        """The same posture (nq,) with its lowest point on the floor."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._robot.model, self._data)
        placed = qpos.copy()
        placed[2] -= self._lowest(self._data)
        return placed


def _heading(qpos: Array, upright: Array) -> float:
    """Which way a root heads that is turned from the upright one, rad: where its x axis points, or its belly if that is
    more level."""
    turned = multiply(qpos[3:7], conjugate(upright))
    ahead, down = rotate(turned, np.array([1.0, 0.0, 0.0])), rotate(turned, np.array([0.0, 0.0, 1.0]))
    axis = ahead if abs(ahead[2]) < abs(down[2]) else down
    return float(np.arctan2(axis[1], axis[0]))
