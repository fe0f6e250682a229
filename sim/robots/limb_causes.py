"""Why a limb points elsewhere than the human's: its joints' ranges, their pace, or how it was carried over.

The angles within reach that are best for both segments of a limb are found by `reachable`. Of two segments that cannot
both be right one may do better than in those angles, so limbs are compared as a whole: by the angle whose 1 - cos is
the mean of both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from sim.robots.limb_directions import MEAN_LIMIT, WORST_LIMIT, LimbDirections, degrees_between
from sim.robots.reachable import ReachableLimb
from sim.robots.robot import Robot

Cause = Literal["out of reach", "held back", "carried wrongly"]
# A limb is as good as the best within reach if it is this close to it, degrees, or misses it by this share of what is
# out of reach anyway. So often it is looked at, Hz.
CLOSE, SHARE, RATE = 5.0, 0.25, 30.0
FULL = 0.99  # of the speed that a joint may have


@dataclass(frozen=True)
class LimbCause:
    """One limb that is further off than it may be.

    Attributes:
        cause: "out of reach": no angles within the joints' ranges are closer; "held back": limits of speed and
            acceleration keep it from where the retargeter would have it, or from getting there sooner; "carried
            wrongly": the retargeter.
        best: mean and worst angle of each of its segments at the best angles, by name, degrees.
    """

    cause: Cause
    best: dict[str, tuple[float, float]]


def limb_causes(
    robot: Robot, directions: LimbDirections, wanted: Array, played: Array, limbs: Array, rate: float
) -> list[LimbCause]:
    """The limbs that are off by more than the limits, and why.

    Args:
        robot: whose.
        directions: its segments.
        wanted: joints as retargeted, shape (T, J), rad.
        played: joints as played, shape (T, J), rad.
        limbs: the human's, shape (T, 14, 3).
        rate: of the frames, Hz.
    """
    goals, there = directions.goals(limbs), _pointing(robot, directions, played)
    off = degrees_between(there, goals)
    found = []
    for limb in directions.limbs:
        rows = [directions.segments.index(segment) for segment in limb]
        often = bool(off[:, rows].mean(axis=0).max() > MEAN_LIMIT)
        if not often and off[:, rows].max() <= WORST_LIMIT:
            continue
        worst = off[:, rows].max(axis=1)
        frames = np.union1d(np.arange(0, len(off), max(round(rate / RATE), 1)), [int(worst.argmax())])
        own = goals[frames][:, rows]
        best_of = ReachableLimb(robot.model, directions, limb, robot.joints, robot.limits)
        reach = best_of.best(own)

        far, least = worst[frames] > WORST_LIMIT, _as_a_whole(reach, own)
        cause: Cause = "out of reach"
        if _does_worse(there[frames][:, rows], own, least, often, far):
            meant = _pointing(robot, directions, wanted[frames])[:, rows]
            short = degrees_between(meant, own)
            often = bool(short.mean(axis=0).max() > MEAN_LIMIT)
            far = (short.max(axis=1) > WORST_LIMIT) & ~_on_its_way(wanted, best_of.joints, robot, rate)[frames]
            cause = "carried wrongly" if _does_worse(meant, own, least, often, far) else "held back"
        best = degrees_between(reach, own)
        means = zip(best.mean(axis=0).tolist(), best.max(axis=0).tolist(), strict=True)
        found.append(LimbCause(cause, dict(zip((segment.name for segment in limb), means, strict=True))))
    return found


def _does_worse(there: Array, goals: Array, least: Array, often: bool, far: NDArray[np.bool_]) -> bool:
    """Whether limbs (F, s, 3) are further off than the least (F,) they could be: often, or in frames `far` (F,)."""
    missing = _as_a_whole(there, goals) - least
    passes = np.maximum(CLOSE, SHARE * least)
    return bool((often and missing.mean() > passes.mean()) or (missing > passes)[far].any())


def _on_its_way(wanted: Array, joints: NDArray[np.int64], robot: Robot, rate: float) -> NDArray[np.bool_]:
    """In which frames (T,) one of the joints goes, or would go, as fast as it may."""
    step = np.abs(np.diff(wanted[:, joints], axis=0, prepend=wanted[:1, joints]))
    return np.any(step * rate >= FULL * robot.limits.velocity[joints], axis=1)


def _pointing(robot: Robot, directions: LimbDirections, joints: Array) -> Array:
    """Where the segments point at joints (T, J), shape (T, K, 3)."""
    qpos, found = robot.model.qpos0.copy(), []
    for q in joints:
        robot.layout.place(q, qpos)
        found.append(directions(qpos))
    return np.array(found)


def _as_a_whole(there: Array, goals: Array) -> Array:
    """How far limbs (T, s, 3) are off as a whole, shape (T,), degrees."""
    angles: Array = np.degrees(np.arccos(np.clip(np.einsum("tsi,tsi->ts", there, goals).mean(axis=1), -1.0, 1.0)))
    return angles
