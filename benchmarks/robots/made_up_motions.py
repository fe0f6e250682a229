"""Motions on the spot that no shipped library contains: waving and squats, for any skeleton."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controller.deck.interfaces import Retargeter
from controller.motion.anatomy import Part, Side, anatomy
from controller.motion.rotations import Array, about, multiply
from controller.motion.skeleton import Pose, Skeleton

X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
ROUND = 2.0
"""s for one wave or one squat."""

Turns = dict[tuple[Part, Side], Array]


def _hanging() -> Turns:
    """Arms that hang, from a rest pose with the arms out."""
    return {("upper arm", "left"): about(X, np.array(-1.35)), ("upper arm", "right"): about(X, np.array(1.35))}


def _wave(phase: float) -> tuple[Turns, float]:
    turns = _hanging()
    turns["upper arm", "right"] = about(X, np.array(-0.5))
    turns["forearm", "right"] = about(X, np.array(-0.7 + 0.5 * np.sin(phase)))
    return turns, 0.0


def _squat(phase: float) -> tuple[Turns, float]:
    bend = 0.45 * (1.0 - np.cos(phase))
    turns = _hanging()
    for side in ("left", "right"):
        turns["thigh", side] = about(Y, np.array(-bend))
        turns["shank", side] = about(Y, np.array(2.0 * bend))
        turns["foot", side] = about(Y, np.array(-bend))
    return turns, 1.0 - float(np.cos(bend))


def _player(
    shape: Callable[[float], tuple[Turns, float]], skeleton: Skeleton, retarget: Retargeter
) -> Callable[[float], tuple[Array, Pose]]:
    parts = anatomy(skeleton)
    time = 0.0

    def update(dt: float) -> tuple[Array, Pose]:
        nonlocal time
        time += dt
        turns, lower = shape(2.0 * np.pi * time / ROUND)
        own: dict[int | None, Array] = {parts.first(part, side): turn for (part, side), turn in turns.items()}
        rotation = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(skeleton), 1))
        for bone, parent in enumerate(skeleton.parent):
            turn = own.get(bone)
            rotation[bone + 1] = rotation[parent + 1] if turn is None else multiply(rotation[parent + 1], turn)
        height = skeleton.leg_length * (1.0 - 0.9 * lower)
        pose = Pose(np.array([0.0, 0.0, height]), np.zeros(()), rotation)
        return retarget(pose), pose

    return update


MADE_UP: dict[str, Callable[[Skeleton, Retargeter], Callable[[float], tuple[Array, Pose]]]] = {
    "wave": lambda skeleton, retarget: _player(_wave, skeleton, retarget),
    "squat": lambda skeleton, retarget: _player(_squat, skeleton, retarget),
}
