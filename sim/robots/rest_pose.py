"""The rest pose of a robot: standing with hanging arms, with elbows and knees that can bend like a human's.

Least squares may end in a local minimum: a straight arm with its elbow at the end of the range may be twisted so that
it can never bend. So if limbs cannot bend from the first solution, others are started anywhere in the joints' ranges,
and each limb takes its best one.
"""

from __future__ import annotations

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array
from sim.retargeting.human_limbs import LIMBS
from sim.retargeting.inverse_kinematics import LimbSolver
from sim.retargeting.robot_limbs import RobotLimbs, limb_directions
from sim.retargeting.robot_parts import SIDES

TRIES = 24
GOOD, BETTER = 0.1, 0.1  # rad: error that needs no other try, improvement that replaces a limb
UP = np.array([0.0, 0.0, 1.0])
SEGMENTS = (("thigh", "shank"), ("upper_arm", "forearm"))


def rest_pose(limbs: RobotLimbs, limits: JointLimits, stand: Array) -> Array:
    """The joints (N,), rad, that match the limbs (14, 3) of a standing human."""
    poses = stand, _bent(stand)
    rest = np.clip(np.zeros(len(limits.lower)), limits.lower, limits.upper)
    found, missed = _tried(limbs, limits, rest, poses)
    names, moved = limbs.vectors.names, limbs.moved
    own = [
        moved[[k for k, name in enumerate(names) if name.startswith(f"{side}_{first}")]].any(axis=0)
        & ~moved[[k for k, name in enumerate(names) if not _is_of(name, side, first)]].any(axis=0)
        for side in SIDES
        for first, _ in SEGMENTS
    ]
    random, best = np.random.default_rng(0), found
    for _ in range(TRIES):
        if missed.max() < GOOD:
            break
        start = random.uniform(np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi))
        tried, off = _tried(limbs, limits, np.where(np.any(own, axis=0), start, rest), poses)
        for limb, joints in enumerate(own):
            if off[limb] < missed[limb] - BETTER:
                best, missed[limb] = np.where(joints, tried, best), off[limb]
    return found if best is found else _tried(limbs, limits, best, poses)[0]


def _tried(limbs: RobotLimbs, limits: JointLimits, start: Array, poses: tuple[Array, Array]) -> tuple[Array, Array]:
    """The solution (N,) of the first pose from a start; errors of the limbs (4,), rad, in it and in the second pose."""
    answers, off = [start], np.zeros(4)
    for pose in poses:
        answers.append(LimbSolver(limbs, limits, answers[-1], 1.0)(pose, UP))
    for q, pose in zip(answers[1:], poses, strict=True):
        limbs.place(q)
        there = limb_directions(limbs)
        for limb, rows in enumerate(_rows()):
            angles = np.arccos(np.clip(np.einsum("si,si->s", there[rows], pose[rows]), -1.0, 1.0))
            off[limb] = max(off[limb], float((angles * there[rows].any(axis=1)).max()))
    return answers[1], off


def _bent(stand: Array) -> Array:
    bent = stand.copy()
    for side in SIDES:
        for part, way in (("thigh", (0.6, -0.8)), ("shank", (-0.6, -0.8)), ("forearm", (1.0, 0.0))):
            bent[LIMBS.index(f"{side}_{part}")] = way[0], 0.0, way[1]
    return bent


def _rows() -> list[list[int]]:
    """The rows of LIMBS of each of the four limbs."""
    return [[LIMBS.index(f"{side}_{part}") for part in parts] for side in SIDES for parts in SEGMENTS]


def _is_of(name: str, side: str, first: str) -> bool:
    """Whether a vector belongs to a limb, or goes from foot to foot."""
    arm = "arm" in name
    return name == "feet" or (name.startswith(f"{side}_") and arm == (first == "upper_arm"))
