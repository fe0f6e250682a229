"""Unit quaternions (w, x, y, z) on the last axis of arrays, fast enough for the loop.

All functions broadcast over the leading axes. A quaternion rotates a vector by  v' = q v q*.
"""

from collections.abc import Callable
from functools import cached_property
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])

_TINY = 1e-150  # replaces 0 in divisors
BLOCK = 2048  # frames

# Of Newton's method in `best_fit`: iterations, and the least distance between the best and the second rotation.
_MOST_ROUNDS = 50
_CERTAIN = 1e-3


def cross(a: Array, b: Array) -> Array:
    """The vector product of (..., 3) arrays, faster than numpy's general one."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def dot(a: Array, b: Array) -> Array:
    """The scalar product along the last axis, which is dropped."""
    return np.einsum("...i,...i->...", a, b)


def multiply(p: Array, q: Array) -> Array:
    """The rotation by q, then by p, shapes (..., 4)."""
    if p.ndim == 1:
        # One rotation for all of q is one matrix product, ten times faster in the loop.
        w, x, y, z = p.tolist()
        return q @ np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    out = np.empty(np.broadcast_shapes(p.shape, q.shape))
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    out[..., 0] = pw * qw - px * qx - py * qy - pz * qz
    out[..., 1] = pw * qx + px * qw + py * qz - pz * qy
    out[..., 2] = pw * qy - px * qz + py * qw + pz * qx
    out[..., 3] = pw * qz + px * qy - py * qx + pz * qw
    return out


def conjugate(q: Array) -> Array:
    """The inverse rotation of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: Array, v: Array) -> Array:
    """Vectors (..., 3) rotated by q (..., 4)."""
    t = 2.0 * cross(q[..., 1:], v)
    return v + q[..., :1] * t + cross(q[..., 1:], t)


class FixedVectors:
    """Constant vectors (n, 3) for repeated rotation, each by its own quaternion."""

    def __init__(self, vectors: Array) -> None:
        self.vectors = vectors

    def turned(self, q: Array) -> Array:
        """The vectors rotated by q (..., n, 4), as by `rotate`; for q (n, 4) and small n six times as fast."""
        if q.ndim != 2:
            return rotate(q, self.vectors)
        products = (q[:, :, None] * q[:, None, :]).reshape(len(q), 1, 16)
        return (products @ self._turned_by_products)[:, 0]

    @cached_property
    def _turned_by_products(self) -> Array:
        """The bilinear form of the rotation: coefficients of q_i q_j for each vector, shape (n, 16, 3)."""
        vectors = self.vectors
        units, made = np.eye(4), np.empty((len(vectors), 4, 4, 3))
        for i, j in np.ndindex(4, 4):
            # w w v + 2 w (u x v) + 2 (u . v) u - (u . u) v, as bilinear in q = (w, u).
            (w, u), (z, t) = ((unit[0], unit[1:]) for unit in (units[i], units[j]))
            along = (vectors @ t)[:, None] * u + (vectors @ u)[:, None] * t
            made[:, i, j] = (w * z - u @ t) * vectors + cross(w * t + z * u, vectors) + along
        return made.reshape(len(vectors), 16, 3)


def normalise(a: Array) -> Array:
    """Scales the last axis to unit length; a zero vector stays zero."""
    length = np.sqrt(np.matmul(a[..., None, :], a[..., None])[..., 0])
    length += length == 0.0
    return a / length


def from_rotation_vector(v: Array) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3): axis times angle, rad."""
    half = 0.5 * np.sqrt(dot(v, v))[..., None]
    some = np.maximum(half, _TINY)
    return np.concatenate([np.cos(half), 0.5 * np.sin(some) / some * v], axis=-1)


def to_rotation_vector(q: Array) -> Array:
    """Rotation vectors (..., 3) of quaternions (..., 4), with |angle| <= pi."""
    cosine, axis = q[..., :1], q[..., 1:]
    sine = np.sqrt(dot(axis, axis))[..., None]
    # q and -q are one rotation: the one with a positive cosine has the smaller angle.
    around = 2.0 * np.arctan2(sine, np.abs(cosine)) / np.maximum(sine, _TINY)
    return np.where(cosine < 0.0, -around, around) * axis


def nearest_rotation_vector(vector: Array, other: Array) -> Array:
    """Of the two rotation vectors (|angle| < 2 pi) of one rotation the one nearer to another, shapes (..., 3)."""
    # Keeps differences continuous when they pass half a turn, where the smaller angle changes sign.
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    around = vector * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))
    far = np.linalg.norm(vector - other, axis=-1, keepdims=True)
    return np.where(np.linalg.norm(around - other, axis=-1, keepdims=True) < far, around, vector)


def about(axis: Array, angle: Array | float) -> Array:
    """Quaternions (..., 4) of rotations by angle (...) rad about unit axes (..., 3)."""
    half = 0.5 * np.asarray(angle)[..., None]
    vector = np.sin(half) * axis
    return np.concatenate([np.broadcast_to(np.cos(half), (*vector.shape[:-1], 1)), vector], axis=-1)


def between(a: Array, b: Array) -> Array:
    """The least rotation (..., 4) of unit vectors a onto unit vectors b, shapes (..., 3); for b = -a any of them."""
    cosine = dot(a, b)
    q = np.concatenate([1.0 + cosine[..., None], cross(a, b)], axis=-1)
    opposite = cosine < -0.99
    if np.any(opposite):
        a, b = np.broadcast_arrays(a, b)
        q[opposite] = _nearly_opposite(a[opposite], b[opposite])
    return normalise(q)


def _nearly_opposite(a: Array, b: Array) -> Array:
    """As `between`, for b near -a, where 1 + a . b and a x b are inaccurate."""
    # With p a unit vector across a such that b = cos t a + sin t p, rotating by t about a x p gives b to the last digit
    # even if p itself is inaccurate.
    cosine = dot(a, b)
    across = b - cosine[..., None] * a
    sine = np.sqrt(dot(across, across))
    any_other = np.where(np.abs(a[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    across = normalise(np.where(sine[..., None] > 1e-14, across, any_other))
    across = normalise(across - dot(across, a)[..., None] * a)
    half = 0.5 * np.arctan2(sine, cosine)[..., None]
    return np.concatenate([np.cos(half), np.sin(half) * cross(a, across)], axis=-1)


def _davenport(m: Array) -> Array:
    """Davenport's symmetric matrices (..., 4, 4) of m (..., 3, 3)."""
    k = np.empty((*m.shape[:-2], 4, 4))
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    k[..., 0, 0] = trace
    k[..., 1:, 1:] = m + np.swapaxes(m, -1, -2) - trace[..., None, None] * np.eye(3)
    k[..., 0, 1] = k[..., 1, 0] = m[..., 2, 1] - m[..., 1, 2]
    k[..., 0, 2] = k[..., 2, 0] = m[..., 0, 2] - m[..., 2, 0]
    k[..., 0, 3] = k[..., 3, 0] = m[..., 1, 0] - m[..., 0, 1]
    return k


# It is linear in m, so its values for the nine unit matrices make it one product in the loop.
_DAVENPORT = _davenport(np.eye(9).reshape(9, 3, 3)).reshape(9, 16)


def best_fit(m: Array) -> Array:
    """Quaternions (..., 4), w >= 0, that maximise trace(R' m) for matrices m (..., 3, 3)."""
    # With m = sum_i d_i r_i' this is the best rotation of directions r_i onto d_i (Wahba's problem, solved by
    # Davenport's q-method: the largest eigenvector of a symmetric 4 x 4 matrix). No division: half turns are safe.
    if m.ndim == 2 and (found := _best_fit_of_one(m)) is not None:
        return found
    k = (m.reshape(*m.shape[:-2], 9) @ _DAVENPORT).reshape(*m.shape[:-2], 4, 4)
    q = np.linalg.eigh(k)[1][..., -1]
    return np.where(q[..., :1] < 0.0, -q, q)


def _best_fit_of_one(m: Array) -> Array | None:
    """As `best_fit` for one matrix, in plain numbers, twice as fast; None where that is inexact."""
    # Newton's method from above on the characteristic polynomial of Davenport's matrix K, without a cubic term, finds
    # its largest eigenvalue (Theobald 2005); the eigenvector is the first column of the adjugate of K - lambda.
    a, b, c, d, e, f, g, h, i = m.ravel().tolist()
    ca, cb, cc = e * i - f * h, f * g - d * i, d * h - e * g
    cd, ce, cf = c * h - b * i, a * i - c * g, b * g - a * h
    cg, ch, ci = b * f - c * e, c * d - a * f, a * e - b * d
    square = a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
    cofactors = ca * ca + cb * cb + cc * cc + cd * cd + ce * ce + cf * cf + cg * cg + ch * ch + ci * ci
    c2, c1 = -2.0 * square, -8.0 * (a * ca + b * cb + c * cc)
    c0 = square * square - 4.0 * cofactors
    top = sqrt(3.0 * square)
    for _ in range(_MOST_ROUNDS):
        slope = (4.0 * top * top + 2.0 * c2) * top + c1
        if slope <= _CERTAIN * top**3:
            return None  # two rotations fit nearly as well
        step = (((top * top + c2) * top + c1) * top + c0) / slope
        top -= step
        if step <= 1e-15 * top:
            break
    else:
        return None
    x, y, z = h - f, c - g, d - b
    xx, yy, zz = a - e - i - top, e - a - i - top, i - a - e - top
    xy, xz, yz = b + d, c + g, f + h
    mx, my, mz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - yy * xz
    w = xx * mx + xy * my + xz * mz
    qx = -(x * mx + y * my + z * mz)
    qy = -(x * my + y * (xx * zz - xz * xz) + z * (xy * xz - xx * yz))
    qz = -(x * mz + y * (xy * xz - xx * yz) + z * (xx * yy - xy * xy))
    length = sqrt(w * w + qx * qx + qy * qy + qz * qz)
    # The adjugate's trace is the slope, a bound on the first column.
    if not abs(w) > 0.1 * slope:
        return None
    scale = 1.0 / length if w > 0.0 else -1.0 / length
    return np.array([w * scale, qx * scale, qy * scale, qz * scale])


def from_matrix(m: Array) -> Array:
    """Quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3)."""
    return best_fit(m)


def by_blocks(of: Callable[..., Array], *frames: Array) -> Array:
    """The result (T, ...) of a function of single frames (T, ...), computed in blocks to keep intermediates small."""
    first = of(*(values[:BLOCK] for values in frames))
    if len(frames[0]) <= BLOCK:
        return first
    out = np.empty((len(frames[0]), *first.shape[1:]))
    out[:BLOCK] = first
    for start in range(BLOCK, len(out), BLOCK):
        out[start : start + BLOCK] = of(*(values[start : start + BLOCK] for values in frames))
    return out


def yaw(angle: Array | float) -> Array:
    """Quaternions (..., 4) of rotations by angle (...) rad about z, the vertical."""
    if np.ndim(angle) == 0:  # plain numbers are faster in the loop
        half_angle = 0.5 * float(angle)
        return np.array([cos(half_angle), 0.0, 0.0, sin(half_angle)])
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def continuous(q: Array, *, own: bool = False) -> Array:
    """Flips signs along the first axis, time, so that neighbours agree (q and -q are one rotation); `own`, in place."""
    flips = dot(q[1:], q[:-1]) < 0.0
    if not flips.any():
        return q
    out = q if own else q.copy()
    np.negative(out[1:], out=out[1:], where=np.logical_xor.accumulate(flips)[..., None])
    return out
