"""The cause of a limb's wrong direction: its joints' ranges, their limits of speed, or the retargeter.

`reachable` finds the best angles within reach for both segments of a limb. As one segment may do better at the other's
cost, limbs are compared as a whole: by the angle whose 1 - cos is the mean of both.
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
# Accepted error beyond the best within reach, degrees, or as a share of what is out of reach; rate of the search, Hz.
CLOSE, SHARE, RATE = 5.0, 0.25, 30.0
FULL = 0.99  # of a joint's speed limit


@dataclass(frozen=True)
class LimbCause:
    """One limb beyond the limits.

    Attributes:
        cause: "out of reach": of the joints' ranges; "held back": by limits of speed and acceleration; "carried
            wrongly": by the retargeter.
        best: mean and worst angle of its segments at the best joint angles, by name, degrees.
    """

    cause: Cause
    best: dict[str, tuple[float, float]]


def limb_causes(
    robot: Robot, directions: LimbDirections, wanted: Array, played: Array, limbs: Array, rate: float
) -> list[LimbCause]:
    """The limbs beyond the limits, each with its cause, for T frames at a rate, Hz.

    `wanted` and `played` are retargeted and played joints (T, J), rad, and `limbs` the human's, (T, 14, 3).
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
    """Whether limbs (F, s, 3) exceed the least error (F,) within reach: often, or in frames `far` (F,)."""
    missing = _as_a_whole(there, goals) - least
    passes = np.maximum(CLOSE, SHARE * least)
    return bool((often and missing.mean() > passes.mean()) or (missing > passes)[far].any())


def _on_its_way(wanted: Array, joints: NDArray[np.int64], robot: Robot, rate: float) -> NDArray[np.bool_]:
    """Whether one of the joints is at its speed limit, by frame (T,)."""
    step = np.abs(np.diff(wanted[:, joints], axis=0, prepend=wanted[:1, joints]))
    return np.any(step * rate >= FULL * robot.limits.velocity[joints], axis=1)


def _pointing(robot: Robot, directions: LimbDirections, joints: Array) -> Array:
    """Directions of the segments at joints (T, J), shape (T, K, 3)."""
    qpos, found = robot.model.qpos0.copy(), []
    for q in joints:
        robot.layout.place(q, qpos)
        found.append(directions(qpos))
    return np.array(found)


def _as_a_whole(there: Array, goals: Array) -> Array:
    """Error of limbs (T, s, 3) as a whole, shape (T,), degrees."""
    angles: Array = np.degrees(np.arccos(np.clip(np.einsum("tsi,tsi->ts", there, goals).mean(axis=1), -1.0, 1.0)))
    return angles
