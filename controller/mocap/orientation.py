"""From bone directions to bone rotations: what marker positions leave open is settled the same way every time.

A direction fixes two of a bone's three angles. The third, the twist, follows this rule:

- the root is turned so that the bones that hang from it fit best;
- a bone swings the shortest way from where its parent carries it;
- a bone with several children is then twisted about itself so that they fit best (a chest follows the shoulders).

The loop asks for one frame at a time, and there numpy's calls on arrays of three numbers would cost ten times more than
the arithmetic. So the walk along the bones is written component by component: for one frame the components are plain
numbers, for many frames they are arrays, and the same lines serve both.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np

from controller.mocap.skeleton import Skeleton
from controller.rotations import Array, best_fit, between

Vector: TypeAlias = Iterable[Any]  # x, y, z: each a float, or an array over the frames
Quaternion: TypeAlias = Iterable[Any]  # w, x, y, z


def orient(skeleton: Skeleton, direction: Array) -> Array:
    """Rotations of the root and of each bone that turn the rest pose into the given directions.

    Args:
        skeleton: with B bones.
        direction: unit vectors of the bones, shape (..., B, 3), finite.

    Returns:
        Unit quaternions, shape (..., 1 + B, 4), with rotate(result[..., 1:, :], rest_direction) == direction.
    """
    first = skeleton.first
    root = best_fit(np.swapaxes(direction[..., first, :], -1, -2) @ skeleton.rest_direction[first])
    one_frame = direction.ndim == 2
    goal: Any = direction.tolist() if one_frame else np.ascontiguousarray(np.moveaxis(direction, (-2, -1), (0, 1)))
    rotation: list[Quaternion] = [root.tolist() if one_frame else np.moveaxis(root, -1, 0)]
    for (parent, rest, children), target in zip(skeleton.walk, goal, strict=True):
        # Where the parent carries the bone; all in one piece: the loop does nothing more often, and calls would cost as
        # much as what they do.
        w, x, y, z = rotation[parent + 1]
        vx, vy, vz = rest
        tx = 2.0 * (y * vz - z * vy)
        ty = 2.0 * (z * vx - x * vz)
        tz = 2.0 * (x * vy - y * vx)
        ax, ay, az = vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx

        # The least rotation that turns it onto its goal.
        bx, by, bz = target
        pw = 1.0 + ax * bx + ay * by + az * bz
        opposite = pw < 0.01
        if opposite is not False and np.any(opposite):  # the first half spares a plain number the call
            q = between(np.stack([ax, ay, az], axis=-1), np.stack([bx, by, bz], axis=-1))
            pw, px, py, pz = q.tolist() if q.ndim == 1 else np.moveaxis(q, -1, 0)
        else:
            px, py, pz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            scale = (pw * pw + px * px + py * py + pz * pz) ** -0.5
            pw, px, py, pz = pw * scale, px * scale, py * scale, pz * scale
        turned = (
            pw * w - px * x - py * y - pz * z,
            pw * x + px * w + py * z - pz * y,
            pw * y - px * z + py * w + pz * x,
            pw * z + px * y - py * x + pz * w,
        )
        if len(children) > 1:
            start = [_rotate(turned, skeleton.walk[child][1]) for child in children]
            turned = _multiply(_twist(target, start, [goal[child] for child in children]), turned)
        rotation.append(turned)
    out = np.array(rotation)
    return out if one_frame else np.ascontiguousarray(np.moveaxis(out, (0, 1), (-2, -1)))


def _rotate(q: Quaternion, v: Vector) -> Vector:
    """The vector v turned by q."""
    w, x, y, z = q
    vx, vy, vz = v
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


def _multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """The rotation that turns by q first and by p then."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def _twist(axis: Vector, start: list[Vector], goal: list[Vector]) -> Quaternion:
    """The rotation about a unit axis that best turns the vectors start onto the vectors goal."""
    ax, ay, az = axis
    cosine = sine = 0.0
    for (sx, sy, sz), (gx, gy, gz) in zip(start, goal, strict=True):
        along = sx * ax + sy * ay + sz * az
        sx, sy, sz = sx - along * ax, sy - along * ay, sz - along * az
        cosine += sx * gx + sy * gy + sz * gz
        sine += (ay * sz - az * sy) * gx + (az * sx - ax * sz) * gy + (ax * sy - ay * sx) * gz
    turn = cosine + 1j * sine
    half = (
        turn + (turn == 0.0)
    ) ** 0.5  # the root of a complex number has half its angle; no turn where none is better
    half = half / abs(half)
    return half.real, half.imag * ax, half.imag * ay, half.imag * az
