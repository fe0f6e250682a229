"""Bone rotations from bone directions, with one rule for the twist.

A direction fixes two of a bone's three angles. The third, the twist, follows this rule:

- the root has the rotation that best fits the bones at the root;
- a bone swings by the least rotation from where its parent carries it;
- a bone with several children is then twisted about itself to fit them best (a chest follows the shoulders).

The quaternions q that rotate a rest direction r onto a goal g, q r = g q, fill a plane of four-dimensional space. Two
orthogonal vectors of equal length span it, for any quaternion u whose e is not zero:

    e = u - g u r,    f = g e

Of its unit quaternions the one with the largest <q, p> is the least rotation from where the parent's p carries the
bone: the projection of p,  q ~ <e, p> e + <f, p> f. Lengths are normalised at the end.

The walk along the bones is written by components, plain numbers for one frame and arrays for many: in the loop, numpy's
calls on arrays of three numbers would cost ten times more than the arithmetic.
"""

from collections.abc import Iterable
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from controller.motion.rotations import BLOCK, Array, best_fit, by_blocks, dot, multiply, normalise
from controller.motion.skeleton import Skeleton

Vector: TypeAlias = Iterable[Any]  # x, y, z: each a float, or an array over the frames
Quaternion: TypeAlias = Iterable[Any]  # w, x, y, z

# With u = 1 the squared length of e is 2 (1 + g . r); below half of this it is inaccurate.
_OPPOSITE = 0.01


def orient(skeleton: Skeleton, direction: Array) -> Array:
    """Rotations of the root and of each bone that rotate the rest pose into the given directions.

    Directions are finite unit vectors, shape (..., B, 3); a bone with a zero vector moves with its parent. The result
    has the shape (..., 1 + B, 4), with rotate(result[..., 1:, :], rest_direction) == direction.
    """
    if direction.ndim == 3 and len(direction) > BLOCK:
        return by_blocks(partial(orient, skeleton), direction)
    first = skeleton.first
    hanging = direction.take(first, axis=-2).swapaxes(-1, -2)
    root = best_fit(hanging @ skeleton.rest_direction[first])
    one_frame = direction.ndim == 2
    goal: Any = direction.tolist() if one_frame else np.ascontiguousarray(np.moveaxis(direction, (-2, -1), (0, 1)))
    rotation: list[Quaternion] = [root.tolist() if one_frame else np.moveaxis(root, -1, 0)]
    for (parent, (rx, ry, rz), children), target in zip(skeleton.walk, goal, strict=True):
        # In one piece: this is the hottest code of the loop, and calls would double its cost.
        pw, px, py, pz = rotation[parent + 1]
        gx, gy, gz = target
        w = 1.0 + gx * rx + gy * ry + gz * rz  # e with u = 1; the real part of f is zero
        x, y, z = ry * gz - rz * gy, rz * gx - rx * gz, rx * gy - ry * gx
        fx, fy, fz = gx + rx, gy + ry, gz + rz
        s, t = w * pw + x * px + y * py + z * pz, fx * px + fy * py + fz * pz
        rare = (w < _OPPOSITE) | ((w == 1.0) & (gx == 0.0)) | ((s == 0.0) & (t == 0.0))
        if rare is not False and np.any(rare):  # the first half spares a plain number the call
            turned = _swung(rotation[parent + 1], (rx, ry, rz), target)
        else:
            turned = s * w, s * x + t * fx, s * y + t * fy, s * z + t * fz
        if len(children) > 1:
            turned = _twisted(turned, target, skeleton, children, goal)
        rotation.append(turned)
    out = np.array(rotation) if one_frame else np.ascontiguousarray(np.moveaxis(np.array(rotation), (0, 1), (-2, -1)))
    out /= np.sqrt(np.matmul(out[..., None, :], out[..., None])[..., 0])
    return out


def _swung(carried: Any, rest: Any, goal: Any) -> Any:
    """The least rotation from where a bone is carried to its goal, also for half turns and zero goals."""
    p, r, g = (np.stack(np.broadcast_arrays(*of), axis=-1) for of in (carried, (0.0, *rest), (0.0, *goal)))
    across = np.zeros(4)
    across[1:] = np.cross(rest, np.eye(3)[np.abs(rest).argmin()])
    u = np.where(dot(g, r)[..., None] < _OPPOSITE - 1.0, normalise(across), np.array([1.0, 0.0, 0.0, 0.0]))
    e = u - multiply(multiply(g, u), r)
    f = multiply(g, e)
    q = dot(e, p)[..., None] * e + dot(f, p)[..., None] * f
    q = normalise(np.where(q.any(axis=-1, keepdims=True), q, e))  # after half a turn any axis is right
    q = np.where(g.any(axis=-1, keepdims=True), q, p)
    return q.tolist() if q.ndim == 1 else np.moveaxis(q, -1, 0)


def _twisted(swung: Quaternion, axis: Vector, skeleton: Skeleton, children: list[int], goal: Any) -> Quaternion:
    """A bone's rotation, of any length, twisted about the bone so that its children come nearest to their goals."""
    w, x, y, z = swung
    ax, ay, az = axis
    cosine = sine = 0.0
    for child in children:
        (vx, vy, vz), (gx, gy, gz) = skeleton.walk[child][1], goal[child]
        # The carried child, projected across the axis, and its angle to the goal.
        own, twice = w * w - x * x - y * y - z * z, 2.0 * (x * vx + y * vy + z * vz)
        sx = own * vx + twice * x + 2.0 * w * (y * vz - z * vy)
        sy = own * vy + twice * y + 2.0 * w * (z * vx - x * vz)
        sz = own * vz + twice * z + 2.0 * w * (x * vy - y * vx)
        along = sx * ax + sy * ay + sz * az
        sx, sy, sz = sx - along * ax, sy - along * ay, sz - along * az
        cosine += sx * gx + sy * gy + sz * gz
        sine += (ay * sz - az * sy) * gx + (az * sx - ax * sz) * gy + (ax * sy - ay * sx) * gz
    turn = cosine + 1j * sine
    # The root of a complex number has half its angle; no twist if none is better.
    half = (turn + (turn == 0.0)) ** 0.5
    half = half / abs(half)
    c, s = half.real, half.imag
    ax, ay, az = s * ax, s * ay, s * az
    return (
        c * w - ax * x - ay * y - az * z,
        c * x + ax * w + ay * z - az * y,
        c * y - ax * z + ay * w + az * x,
        c * z + ax * y - ay * x + az * w,
    )
