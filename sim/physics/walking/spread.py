"""Spread: how far to its side a foot may land so that it lands flat.

Ankles turn sideways only so far. A sole that lands on its inner edge tips the robot over the other foot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.motion.rotations import Array, conjugate, multiply, rotate
from sim.physics.walking.whole_body import WholeBody

# A foot that lands is flat if it is turned by less than this, rad, and in place within so many heights of the root.
FLAT, THERE = 0.05, 0.01
# Where the centre of mass is when a foot lands at its side, as a share of the way to that foot.
SHIFTED = 0.35
UP = np.array([0.0, 0.0, 1.0])
# How often the range that the answer is in is halved.
HALVINGS = 6


def widest(body: WholeBody, goal: Array, flat: Sequence[Array], sides: Array, least: float, most: float) -> float:
    """How far apart the soles of a robot may be, side by side, m, so that either lands flat.

    Args:
        body: that solves for its posture; its last solution is lost.
        goal: the posture it stands in, facing x, shape (nq,).
        flat: the rotations of the feet's bodies when their soles are flat and point to x, two quaternions.
        sides: which side each foot is on, 1 for left, shape (2,).
        least: how far apart the soles are in any case, m.
        most: how far at most, m.
    """
    if all(_lands_flat(body, goal, flat, sides, most, foot) for foot in range(2)):
        return most
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        if all(_lands_flat(body, goal, flat, sides, middle, foot) for foot in range(2)):
            least = middle
        else:
            most = middle
    return least


def _lands_flat(body: WholeBody, goal: Array, flat: Sequence[Array], sides: Array, apart: float, foot: int) -> bool:
    places = [np.array([goal[0], goal[1] + 0.5 * side * apart, 0.0]) for side in sides]
    stands = places[1 - foot]
    body.plan.qpos[:] = goal
    body.settle(goal, places, flat, (stands + SHIFTED * (places[foot] - stands))[:2])
    turned = multiply(body.plan.xquat[body.bodies[foot]], conjugate(flat[foot]))
    off_level = float(np.arccos(min(rotate(turned, UP)[2], 1.0)))
    off_place = float(np.linalg.norm(body.sole(body.plan, foot) - places[foot]))
    return off_level < FLAT and off_place < THERE * goal[2]
