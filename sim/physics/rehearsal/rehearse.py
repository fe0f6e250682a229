"""Rehearse: finds joint targets, around a motion, with which a robot does it on a free root.

The cross-entropy method (Rubinstein 1999) on the whole motion: N courses are drawn,

    targets = motion + B x,        x ~ N(mean, sigma^2), one a knot and joint

with B the straight lines between knots, from 0 at the start. Each is simulated with several variations of the robot,
and judged by the mean of `cost` over time and variations, more by the worst of these. Mean and sigma follow the best
ones, weighted by their rank, and the best course of all stays in. All variations are told the same: it must do without
being watched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array, conjugate, multiply, to_rotation_vector
from sim.physics.falls.fallen import FALLEN_HEIGHT, FALLEN_TILT
from sim.physics.played_motions import DT
from sim.physics.rehearsal.plant import Plant, Variation
from sim.physics.rehearsal.wanted_motion import WantedMotion
from sim.robots.robot import Robot

# What a course costs, mean over time: a radian (rms) of the joints, a radian of the root, a height of the root up or
# down and along the ground, and a radian (rms) of what is added to the targets; squared.
POSE, TILT, HEIGHT, PLACE, EFFORT = 0.5, 3.0, 20.0, 1.0, 0.02
# What it costs besides to be as low, or to lean as far, as who has fallen.
FALLEN = 5.0
# How much the worst variation counts beside the mean of all.
WORST = 0.5
# From knot to knot, s, and how far targets are changed at first, rad.
KNOT, SPREAD = 0.25, 0.1
# The share of the courses that the next ones follow, and how fast their spread does.
BEST, FOLLOWS = 0.25, 0.2


@dataclass(frozen=True)
class Rehearsed:
    """What was found, T samples DT apart.

    Attributes:
        targets: of the joints, shape (T, J), rad.
        qpos: how the robot as its files say followed them, shape (T, nq).
    """

    targets: Array
    qpos: Array


def rehearse(
    robot: Robot,
    wanted: WantedMotion,
    plant: Plant,
    courses: int,
    generations: int,
    seed: int = 0,
    told: Callable[[float], object] = lambda _: None,
) -> Rehearsed:
    """Rehearses a motion.

    Args:
        robot: who.
        wanted: the motion.
        plant: variations of it, put where the motion begins.
        courses: how many are tried in each.
        generations: how many.
        seed: of what is tried.
        told: is told the least cost so far, in each generation.
    """
    random, limits = np.random.default_rng(seed), robot.limits
    hats = _hats(len(wanted), round(KNOT / DT))
    mean = np.zeros((hats.shape[1], len(robot.joints)))
    spread = np.full_like(mean, SPREAD)
    kept = max(2, round(BEST * courses))
    weight = np.log(kept + 0.5) - np.log(np.arange(1.0, kept + 1.0))
    weight /= weight.sum()
    best = mean
    for _ in range(generations):
        tried = mean + spread * random.standard_normal((courses, *mean.shape))
        tried[0], tried[1] = mean, best
        targets = np.clip(wanted.targets + hats @ tried, limits.lower, limits.upper)
        price = cost(robot, plant.tried(targets, wanted.targets[0]), wanted.qpos).mean(axis=2)
        effort = EFFORT * np.square(targets - wanted.targets).mean(axis=(1, 2))
        total = price.mean(axis=1) + WORST * price.max(axis=1) + effort
        order = np.argsort(total)[:kept]
        best = tried[order[0]]
        change = tried[order] - mean
        spread = np.sqrt((1.0 - FOLLOWS) * spread**2 + FOLLOWS * np.einsum("n,nkj->kj", weight, change**2))
        mean = mean + np.einsum("n,nkj->kj", weight, change)
        told(float(total[order[0]]))
    targets = np.clip(wanted.targets + hats @ best, limits.lower, limits.upper)
    plant.put([Variation()])
    return Rehearsed(targets, plant.advance(targets, wanted.targets[0])[0])


def cost(robot: Robot, qpos: Array, goal: Array) -> Array:
    """What postures (..., H, nq) cost, shape (..., H), where others (H, nq) are wanted; a broken one costs 1000."""
    height = float(robot.model.body(int(robot.model.jnt_bodyid[0])).pos[2])
    layout = robot.layout
    off = qpos[..., :3] - goal[:, :3]
    tilt = to_rotation_vector(multiply(qpos[..., 3:7], conjugate(goal[:, 3:7])))
    joints = np.square(qpos[..., layout.hinge_qpos] - goal[:, layout.hinge_qpos]).sum(axis=-1)
    for ball in layout.ball_qpos:
        turn = multiply(conjugate(goal[:, ball]), qpos[..., ball])
        joints = joints + np.square(to_rotation_vector(turn)).sum(axis=-1)
    price = POSE * joints / len(robot.joints) + TILT * np.square(tilt).sum(axis=-1)
    price += (HEIGHT * np.square(off[..., 2]) + PLACE * np.square(off[..., :2]).sum(axis=-1)) / height**2
    low = qpos[..., 2] < FALLEN_HEIGHT * goal[:, 2]
    lean = np.arccos(np.clip(_up(robot, qpos), -1.0, 1.0)) - np.arccos(np.clip(_up(robot, goal), -1.0, 1.0))
    price += FALLEN * (low | (lean > FALLEN_TILT))
    return np.where(np.isfinite(price), np.minimum(price, 1e3), 1e3)


def _up(robot: Robot, qpos: Array) -> Array:
    """The height of a unit vector along the body of roots at qpos (..., nq), shape (...)."""
    turn = multiply(qpos[..., 3:7], conjugate(robot.model.qpos0[3:7]))
    return 1.0 - 2.0 * np.square(turn[..., 1:3]).sum(axis=-1)


def _hats(count: int, knot: int) -> Array:
    """The straight lines between knots, shape (count, K): the value at each sample of one of them; 0 at the first."""
    knots = np.arange(0, count + knot, knot)
    return np.stack([np.interp(np.arange(count), knots, row) for row in np.eye(len(knots))[1:]], axis=1)
