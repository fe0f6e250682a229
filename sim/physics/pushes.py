"""Pushes of a simulated body: usual impulse, duration, direction and force."""

import math

import mujoco
import numpy as np

from controller.deck.interfaces import Side
from controller.motion.rotations import Array
from sim.models.gravity import GRAVITY

# Duration of a push, s, and its direction by the side it comes from, rad to the left of the heading.
PUSH_LASTS = 0.1
PUSHES_TOWARDS: dict[Side, float] = {"back": 0.0, "right": 0.5 * np.pi, "front": np.pi, "left": -0.5 * np.pi}


def usual_push(model: mujoco.MjModel) -> float:
    """0.05 m sqrt(g h), N s, which demands a step, with the root's height h: 0.24 for servo20, 16 for the mannequin."""
    height = float(model.body(int(model.jnt_bodyid[0])).pos[2])
    return 0.05 * float(model.body_mass.sum()) * math.sqrt(GRAVITY * height)


def push_force(impulse: float, towards: float) -> Array:
    """The force (3,), N, of a push with an impulse, N s, in a direction on the ground, rad."""
    return impulse / PUSH_LASTS * np.array([np.cos(towards), np.sin(towards), 0.0])
