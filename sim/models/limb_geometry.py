"""Where a limb begins, bends and ends, from the axes and places of its hinges.

A hinge lies *across* a limb if its axis is far from the limb's direction on both of its sides; it bends the limb there.
A hinge whose axis runs along the limb (yaw of a thigh, roll of a forearm) turns the segment that it is part of. Hips
and shoulders are seldom balls: their centre is the point nearest to the axes that lie across the limb.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array

# The least sine of the angle between a limb and an axis that lies across it.
ACROSS = 0.7
# An ankle or a wrist is at least this share of the upper segment's length away from knee or elbow.
END_SHARE = 0.4
# Two axes meet in a centre if it is at most this share of the segment away from each of them.
CENTRE_SHARE = 0.5


def sine(axis: Array, direction: Array) -> float:
    """The sine of the angle between a unit axis and a direction, both (3,); 0 for no direction."""
    length = float(np.linalg.norm(direction))
    return float(np.linalg.norm(np.cross(axis, direction))) / length if length > 1e-9 else 0.0


def farthest(points: Sequence[Array], start: Array) -> Array:
    """Of some points (3,) the one farthest from a start."""
    return max(points, key=lambda point: float(np.linalg.norm(point - start)))


def centre_of(data: mujoco.MjData, hinges: Sequence[int], knee: Array) -> Array:
    """The centre of a hip or a shoulder, shape (3,), m.

    Args:
        data: with the kinematics of a pose in which the limb is seen.
        hinges: above the knee, from the trunk on; at least one.
        knee: where the knee (elbow) is, shape (3,).
    """
    across = [j for j in hinges if sine(data.xaxis[j], knee - data.xanchor[j]) >= ACROSS] or [hinges[-1]]
    last = across[-1]
    other = next((j for j in reversed(across) if sine(data.xaxis[j], data.xaxis[last]) >= ACROSS), None)
    if other is None:
        return data.xanchor[last].copy()
    anchors = [data.xanchor[j] for j in (last, other)]
    projections = [np.eye(3) - np.outer(data.xaxis[j], data.xaxis[j]) for j in (last, other)]
    # Where the axes leave a direction open, the centre stays near the last hinge.
    matrix = np.sum(projections, axis=0) + 1e-6 * np.eye(3)
    right = sum(p @ at for p, at in zip(projections, anchors, strict=True))
    centre = np.linalg.solve(matrix, right + 1e-6 * data.xanchor[last])
    reach = CENTRE_SHARE * float(np.linalg.norm(knee - data.xanchor[last]))
    gaps = [
        float(np.linalg.norm(p @ (centre - data.xanchor[j]))) for p, j in zip(projections, (last, other), strict=True)
    ]
    return centre if max(gaps) <= reach else data.xanchor[last].copy()


def end_hinge(data: mujoco.MjData, hinges: Sequence[int], knee: Array, upper: float) -> int | None:
    """The first hinge below a knee (elbow) that bends what follows: that of the ankle (wrist); none if there is none.

    Args:
        data: with the kinematics of a pose in which the limb is seen.
        hinges: below the knee, in order, those of toes and fingers left out.
        knee: where it is, shape (3,).
        upper: length of the segment above the knee, m.
    """
    for hinge in hinges:
        way = data.xanchor[hinge] - knee
        if np.linalg.norm(way) >= END_SHARE * upper and sine(data.xaxis[hinge], way) >= ACROSS:
            return hinge
    return None


def bent_by(axis: Array, upper: Array, lower: Array) -> float:
    """By what turn about its axis a knee (elbow) is bent, rad; 0 where the limb is straight; arguments as `folds`."""
    upper, lower = (way - (way @ axis) * axis for way in (upper, lower))
    return float(np.arctan2(axis @ np.cross(upper, lower), upper @ lower))


def folds(model: mujoco.MjModel, joint: int, axis: Array, upper: Array, lower: Array) -> int:
    """The sign of a knee's (elbow's) turns that fold a limb, seen from where it is straight; 0 if it folds either way.

    Args:
        model: the robot.
        joint: the knee.
        axis: its axis, shape (3,).
        upper, lower: the ways from the beginning of the limb to the knee and on to its end, shape (3,) each.
    """
    bent = bent_by(axis, upper, lower)
    low, high = bent + model.jnt_range[joint]
    one_way = model.jnt_limited[joint] and min(abs(low), abs(high)) < 0.5 * max(abs(low), abs(high))
    return int(np.sign(low + high)) if one_way else 0


def level_with(point: Array, knee: Array, axis: Array) -> Array:
    """A point moved along the axis of a knee until it is level with the knee, shape (3,).

    How far servos are set aside along that axis is no matter of where the limb points. An axis along the limb
    itself moves nothing.
    """
    aside = float((point - knee) @ axis)
    if abs(aside) > CENTRE_SHARE * float(np.linalg.norm(point - knee)):
        return point.copy()
    return point - aside * axis
