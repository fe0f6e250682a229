"""The rest pose of a robot: it stands with hanging arms, and from there its elbows and knees can bend as a human's do.

Least squares ends where any small step is a loss: an arm that hangs straight, its elbow at the end of the range, may be
turned the wrong way round and could never bend. So where limbs cannot bend from the first answer, others are tried that
begin anywhere in the joints' ranges, and each limb takes the best of its own.
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
GOOD = 0.1  # rad: a limb that comes so close needs no other try
BETTER = 0.1  # rad
UP = np.array([0.0, 0.0, 1.0])
SEGMENTS = (("thigh", "shank"), ("upper_arm", "forearm"))


def rest_pose(limbs: RobotLimbs, limits: JointLimits, stand: Array) -> Array:
    """The joints (N,), rad, of a robot whose limbs point as those of a human who stands (14, 3)."""
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
    """The first pose (N,) from a start; how far limbs are off (4,), rad: in it, and in the second pose from there."""
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
    """The same human with bent knees and elbows."""
    bent = stand.copy()
    for side in SIDES:
        for part, way in (("thigh", (0.6, -0.8)), ("shank", (-0.6, -0.8)), ("forearm", (1.0, 0.0))):
            bent[LIMBS.index(f"{side}_{part}")] = way[0], 0.0, way[1]
    return bent


def _rows() -> list[list[int]]:
    """The rows of LIMBS of each of the four limbs."""
    return [[LIMBS.index(f"{side}_{part}") for part in parts] for side in SIDES for parts in SEGMENTS]


def _is_of(name: str, side: str, first: str) -> bool:
    """Whether a vector is of a limb, of what hangs from it, or goes from foot to foot."""
    arm = "arm" in name
    return name == "feet" or (name.startswith(f"{side}_") and arm == (first == "upper_arm"))
