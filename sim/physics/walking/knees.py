"""Knees: which hinges of the legs they are, and within which ends they stay, so that none becomes quite straight.

Where a leg is straight, no small turn of its knee brings the foot nearer to a place out of reach: the whole-body step
asks for a large one, to and fro, and pulls the root down meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from sim.models.kinematic_tree import hinges_between
from sim.models.limb_geometry import bent_by, centre_of, end_hinge

# A knee stays bent by so much, rad.
BENT = 0.15
# On either side of a knee there is at least this share of a leg.
SHARE = 0.25


def knee_of(model: mujoco.MjModel, body: int) -> tuple[int, float] | None:
    """The hinge that shortens a leg most, and the angle, rad, at which the leg is longest; None if it has no knee.

    Args:
        model: the robot.
        body: its foot.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hinges = hinges_between(model, int(model.jnt_bodyid[0]), body)
    found, most, leg = None, 0.0, 0.0
    for k in range(1, len(hinges)):
        joint, at, axis = hinges[k], data.xanchor[hinges[k]], data.xaxis[hinges[k]]
        up = centre_of(data, hinges[:k], at) - at
        ankle = end_hinge(data, hinges[k + 1 :], at, float(np.linalg.norm(up)))
        if ankle is None:
            continue
        down = data.xanchor[ankle] - at
        leg = max(leg, float(np.linalg.norm(up - down)))
        least = min(float(np.linalg.norm(way - (way @ axis) * axis)) for way in (up, down))
        if least > most:
            straight = float(model.qpos0[model.jnt_qposadr[joint]]) - bent_by(axis, -up, down)
            found, most = (joint, straight), least
    return found if most > SHARE * leg else None


def bent_knees(model: mujoco.MjModel, bodies: Sequence[int]) -> tuple[NDArray[np.int64], Array, Array]:
    """The knees of a robot, K joints of its model, and the ends between which they stay bent, rad, shape (K,) each."""
    found = [knee for knee in (knee_of(model, body) for body in bodies) if knee is not None]
    joints = np.array([joint for joint, _ in found], dtype=np.int64)
    straight = np.array([angle for _, angle in found])
    limited = model.jnt_limited[joints].astype(bool)[:, None]
    lower, upper = np.where(limited, model.jnt_range[joints], (-np.pi, np.pi)).T
    folds = upper - straight > straight - lower
    bent = np.clip(np.where(folds, straight + BENT, straight - BENT), lower, upper)
    return joints, np.where(folds, bent, lower), np.where(folds, upper, bent)
