"""Geometry of a limb from the axes and places of its hinges: beginning, bend and end.

A hinge *across* a limb, its axis far from the limb's direction on both sides, bends it. One along the limb (yaw of a
thigh, roll of a forearm) turns its segment. Hips and shoulders are seldom balls: their centre is the point nearest to
the axes across the limb.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array

ACROSS = 0.7  # least sine between a limb and an axis across it
# Least distance of ankle or wrist from knee or elbow, and largest of a centre from its axes, in upper segments.
END_SHARE, CENTRE_SHARE = 0.4, 0.5


def sine(axis: Array, direction: Array) -> float:
    """The sine of the angle between a unit axis and a direction, both (3,); 0 for no direction."""
    length = float(np.linalg.norm(direction))
    return float(np.linalg.norm(np.cross(axis, direction))) / length if length > 1e-9 else 0.0


def farthest(points: Sequence[Array], start: Array) -> Array:
    """Of some points (3,) the one farthest from a start."""
    return max(points, key=lambda point: float(np.linalg.norm(point - start)))


def start_of(data: mujoco.MjData, hinges: Sequence[int], knee: Array) -> Array:
    """The beginning of a limb, shape (3,): of the points of its hinges' axes nearest to a knee (3,) the farthest."""
    # Where along its axis a file has a hinge is arbitrary.
    axes, anchors = data.xaxis[list(hinges)], data.xanchor[list(hinges)]
    along = np.einsum("hi,hi->h", knee - anchors, axes)
    return farthest([*(anchors + along[:, None] * axes)], knee)


def centre_of(data: mujoco.MjData, hinges: Sequence[int], knee: Array) -> Array:
    """The centre of a hip or shoulder, shape (3,), m, in a pose, for the hinges above the knee (elbow) at `knee`."""
    across = [j for j in hinges if sine(data.xaxis[j], knee - data.xanchor[j]) >= ACROSS] or [hinges[-1]]
    last = across[-1]
    other = next((j for j in reversed(across) if sine(data.xaxis[j], data.xaxis[last]) >= ACROSS), None)
    if other is None:
        return data.xanchor[last].copy()
    anchors = [data.xanchor[j] for j in (last, other)]
    projections = [np.eye(3) - np.outer(data.xaxis[j], data.xaxis[j]) for j in (last, other)]
    # Regularised towards the last hinge.
    matrix = np.sum(projections, axis=0) + 1e-6 * np.eye(3)
    right = sum(p @ at for p, at in zip(projections, anchors, strict=True))
    centre = np.linalg.solve(matrix, right + 1e-6 * data.xanchor[last])
    reach = CENTRE_SHARE * float(np.linalg.norm(knee - data.xanchor[last]))
    gaps = [float(np.linalg.norm(p @ (centre - at))) for p, at in zip(projections, anchors, strict=True)]
    return centre if max(gaps) <= reach else data.xanchor[last].copy()


def end_hinge(data: mujoco.MjData, hinges: Sequence[int], knee: Array, upper: float) -> int | None:
    """The distal hinge (ankle, wrist): the first across the limb below a knee (elbow) at `knee` (3,), or None.

    `hinges` are those below the knee, in order, without toes and fingers; `upper` is the length above it, m.
    """
    for hinge in hinges:
        way = data.xanchor[hinge] - knee
        if np.linalg.norm(way) >= END_SHARE * upper and sine(data.xaxis[hinge], way) >= ACROSS:
            return hinge
    return None


def bent_by(axis: Array, upper: Array, lower: Array) -> float:
    """The bend of a knee (elbow) about its axis, rad; arguments as of `folds`."""
    upper, lower = (way - (way @ axis) * axis for way in (upper, lower))
    return float(np.arctan2(axis @ np.cross(upper, lower), upper @ lower))


def folds(model: mujoco.MjModel, joint: int, axis: Array, upper: Array, lower: Array) -> int:
    """The sign of the turns of a knee (elbow) that fold the straight limb; 0 if it folds either way.

    `upper` and `lower` are the vectors (3,) from the limb's beginning to the knee and on to its end.
    """
    low, high = bent_by(axis, upper, lower) + model.jnt_range[joint]
    one_way = model.jnt_limited[joint] and min(abs(low), abs(high)) < 0.5 * max(abs(low), abs(high))
    return int(np.sign(low + high)) if one_way else 0


def level_with(point: Array, knee: Array, axis: Array) -> Array:
    """A point moved along the axis of a knee level with it, shape (3,), as offsets along it do not turn the limb."""
    # An axis along the limb moves nothing.
    aside = float((point - knee) @ axis)
    if abs(aside) > CENTRE_SHARE * float(np.linalg.norm(point - knee)):
        return point.copy()
    return point - aside * axis
