"""Pushes of a simulated body: how hard one usually is, how long it lasts, its force, and when it comes."""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np

from controller.deck.interfaces import Side
from controller.motion.rotations import Array
from sim.models.gravity import GRAVITY

# How long a push lasts, s, and where one on command drives the body, rad to the left of its own heading.
PUSH_LASTS = 0.1
PUSHES_TOWARDS: dict[Side, float] = {"back": 0.0, "right": 0.5 * np.pi, "front": np.pi, "left": -0.5 * np.pi}


def usual_push(model: mujoco.MjModel) -> float:
    """The impulse, N s, of a push that a body of this mass and height has to step against.

    0.05 m sqrt(g h), with the root's height h where the model has it: 0.24 N s for servo20, 16 N s for the mannequin.
    """
    height = float(model.body(int(model.jnt_bodyid[0])).pos[2])
    return 0.05 * float(model.body_mass.sum()) * math.sqrt(GRAVITY * height)


def push_force(impulse: float, towards: float) -> Array:
    """The force (3,), N, of a push with an impulse, N s, in a direction on the ground, rad."""
    return impulse / PUSH_LASTS * np.array([np.cos(towards), np.sin(towards), 0.0])


def one_push(impulse: float, towards: float, at: float) -> Callable[[float], Array]:
    """The force (3,), N, at a time, s, of a push as `push_force` has it that comes once, at a time, s."""
    force = push_force(impulse, towards)
    return lambda now: force if 0.0 <= now - at < PUSH_LASTS else np.zeros(3)
