"""Stopping: where a joint comes to rest when it brakes as hard as jerk and acceleration allow, exactly, tick by tick.

Lengths are in rad and the unit of time is one tick: velocity v, acceleration a and jerk j are differences of positions,

    p[k+1] = p[k] + v[k+1],    v[k+1] = v[k] + a[k+1],    |a[k+1] - a[k]| <= j,    |a[k+1]| <= A.

Letting an acceleration h go, j less each tick, adds G(h) to the velocity in all; H is its inverse, both odd:

    G(h) = h + (h - j) + (h - 2j) + ... = n h - j n (n - 1) / 2,    n = ceil(h / j).

Whoever moves at v and takes the acceleration -H(v) therefore comes to v = 0 and a = 0 in the same tick, by steps of j.
The law of stopping is to take -H(v), or what jerk and acceleration allow that is nearest to it. It asks for the state
alone, so whoever follows it for a tick goes on along the very same way: a stop once found safe stays safe.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from controller.rotations import Array


class Run(NamedTuple):
    """How far a stopping joint still goes, seen from where it is (rad): its highest, lowest and last position."""

    rise: Array
    fall: Array
    rest: Array


def released(h: Array, j: Array) -> Array:
    """G(h): the velocity gained while the acceleration h, counting itself, is let go by j a tick (rad/tick)."""
    size = np.abs(h)
    n = np.ceil(size / j)
    return np.copysign(n * size - 0.5 * j * n * (n - 1.0), h)


def held_back(v: Array, j: Array) -> Array:
    """H(v), the inverse of G: the acceleration that, let go by j a tick, makes up the velocity v (rad/tick^2)."""
    size = np.abs(v)
    n = np.maximum(np.ceil(0.5 * (np.sqrt(1.0 + 8.0 * size / j) - 1.0)), 1.0)
    return np.copysign(size / n + 0.5 * j * (n - 1.0), v)


def braked(v: Array, a: Array, most: Array, j: Array) -> Array:
    """The law of stopping: the acceleration of the next tick on the way to rest, with |a| <= most (rad/tick^2)."""
    return np.clip(-held_back(v, j), np.maximum(a - j, -most), np.minimum(a + j, most))


def stopping_run(v: Array, a: Array, most: Array, j: Array) -> Run:
    """How far a joint at velocity v and acceleration a goes on under the law of stopping; arrays broadcast.

    Four stretches, each a closed sum: m ticks of full jerk, q ticks of full acceleration, then the release of h.
    """
    # Letting go of a leaves the velocity `left`; where that is negative everything happens mirrored.
    left = v + released(a, j) - a
    side = np.where(left < 0.0, -1.0, 1.0)
    v, a = side * v, side * a

    # Full jerk until the floor -most, or until one tick more would end below the curve a = -H(v).
    f = np.floor(a / j)
    curve = np.floor((a + np.sqrt(np.maximum(a * a + j * (v - (f + 1.0) * (a - 0.5 * j * f)), 0.0))) / j)
    m = np.maximum(np.minimum(np.maximum(curve, f), np.floor((a + most) / j)), 0.0)
    run = m * v + 0.5 * m * (m + 1.0) * (a - j * (m + 2.0) / 3.0)
    fast = v + m * a - 0.5 * j * m * (m + 1.0)

    # Full acceleration while the curve lies below the floor.
    q = np.maximum(np.floor((fast - released(most, j)) / most) + 1.0, 0.0)
    run += q * fast - 0.5 * most * q * (q + 1.0)

    # Along the curve to rest.
    h = held_back(fast - q * most, j)
    n = np.ceil(h / j)
    run += n * (n - 1.0) * (0.5 * (h - n * j) + j * (n + 1.0) / 6.0)

    # Who moves the other way at first dips before it rises: k ticks until the velocity turns.
    b = a - 0.5 * j
    k = np.where(v < 0.0, np.ceil((b - np.sqrt(np.maximum(b * b + 2.0 * j * v, 0.0))) / j) - 1.0, 0.0)
    dip = k * v + 0.5 * k * (k + 1.0) * (a - j * (k + 2.0) / 3.0)

    high, low, up = np.maximum(run, 0.0), np.minimum(dip, 0.0), side > 0.0
    return Run(np.where(up, high, -low), np.where(up, low, -high), side * run)


def longest_run(v: Array, a: Array, most: Array, j: Array) -> Array:
    """A bound, cheap to compute, of how far a stop goes either way: the highest velocity, kept for the longest time."""
    size = np.abs(a)
    top = np.abs(v) + 0.5 * (size + j) * (size + j) / j
    return top * (size / j + top / most + most / j + 4.0)
