"""Stopping: where a joint comes to rest when it brakes as hard as jerk and acceleration allow, exactly, tick by tick.

Lengths are in rad and the unit of time is one tick: velocity v, acceleration a and jerk j are differences of positions,

    p[k+1] = p[k] + v[k+1],    v[k+1] = v[k] + a[k+1],    |a[k+1] - a[k]| <= j,    |a[k+1]| <= A.

Letting an acceleration h go, j less each tick, adds G(h) to the velocity in all; H is its inverse, both odd:

    G(h) = h + (h - j) + (h - 2j) + ... = n h - j n (n - 1) / 2,    n = ceil(h / j).

A joint at velocity v that takes the acceleration -H(v) therefore reaches v = 0 and a = 0 in the same tick, by steps of
j. The law of stopping is to take -H(v), or the nearest acceleration that the limits allow. It depends on the state
alone, so a joint that has followed it for a tick continues along the same path: a stop once found safe stays safe.

One joint at a time, in plain numbers: for the few joints that need it in a tick that is faster than numpy. G and H are
written out where a stop is computed: calls would cost as much as what they do.
"""

from math import ceil, copysign, floor, sqrt

Run = tuple[float, float, float]
"""How far a stopping joint still moves, relative to where it is (rad): its highest, lowest and last position."""


def held_back(v: float, j: float) -> float:
    """H(v), the inverse of G: the acceleration that, let go by j a tick, makes up the velocity v (rad/tick^2)."""
    size = abs(v)
    n = ceil(0.5 * (sqrt(1.0 + 8.0 * size / j) - 1.0)) or 1
    return copysign(size / n + 0.5 * j * (n - 1), v)


def braked(v: float, a: float, most: float, j: float) -> float:
    """The law of stopping: the acceleration of the next tick on the way to rest, with |a| <= most (rad/tick^2)."""
    size = abs(v)
    n = ceil(0.5 * (sqrt(1.0 + 8.0 * size / j) - 1.0)) or 1
    return min(max(-copysign(size / n + 0.5 * j * (n - 1), v), a - j, -most), a + j, most)  # -H(v)


def stopping_run(v: float, a: float, most: float, j: float) -> Run:
    """How far a joint at velocity v and acceleration a still moves under the law of stopping."""
    # Four stretches, each a closed sum: m ticks of full jerk, q ticks of full acceleration, then the release of h.
    # Letting go of a leaves the velocity v + G(a) - a; where that is negative everything happens mirrored.
    size = abs(a)
    n = ceil(size / j)
    mirrored = v + copysign(n * size - 0.5 * j * n * (n - 1), a) - a < 0.0
    if mirrored:
        v, a = -v, -a

    # Full jerk until the floor -most, or until one tick more would end below the curve a = -H(v).
    f = floor(a / j)
    square = a * a + j * (v - (f + 1) * (a - 0.5 * j * f))
    curve = floor((a + (sqrt(square) if square > 0.0 else 0.0)) / j)
    m = curve if curve > f else f
    floored = floor((a + most) / j)
    m = floored if m > floored else m
    m = m if m > 0 else 0
    run = m * v + 0.5 * m * (m + 1) * (a - j * (m + 2) / 3.0)
    fast = v + m * a - 0.5 * j * m * (m + 1)

    # Full acceleration while the curve lies below the floor.
    n = ceil(most / j)
    q = floor((fast - (n * most - 0.5 * j * n * (n - 1))) / most) + 1
    if q > 0:
        run += q * fast - 0.5 * most * q * (q + 1)
        fast -= q * most

    # Along the curve to rest: h = H(fast).
    size = abs(fast)
    n = ceil(0.5 * (sqrt(1.0 + 8.0 * size / j) - 1.0)) or 1
    h = copysign(size / n + 0.5 * j * (n - 1), fast)
    n = ceil(h / j)
    run += n * (n - 1) * (0.5 * (h - n * j) + j * (n + 1) / 6.0)

    # A joint that first moves the other way dips before it rises: k ticks until the velocity turns.
    dip = 0.0
    if v < 0.0:
        b = a - 0.5 * j
        k = ceil((b - sqrt(max(b * b + 2.0 * j * v, 0.0))) / j) - 1
        dip = k * v + 0.5 * k * (k + 1) * (a - j * (k + 2) / 3.0)

    high, low = run if run > 0.0 else 0.0, dip if dip < 0.0 else 0.0
    return (-low, -high, -run) if mirrored else (high, low, run)


def longest_run(speed: float, size: float, most: float, j: float) -> float:
    """An upper bound of the distance in which a joint stops, cheap to compute: the highest velocity, kept longest.

    From an absolute velocity and acceleration (`size`), with limits of acceleration (`most`) and jerk.
    """
    top = speed + 0.5 * ((size + j) * (size + j)) / j
    return top * (size / j + top / most + most / j + 4.0)
