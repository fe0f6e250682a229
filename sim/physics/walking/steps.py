"""Steps: the coming places of the feet, and the course of the centre of pressure that follows from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from controller.motion.rotations import Array

SHIFT = 0.25  # time of the centre of pressure from a foot to the middle between both, or back, s
MEETS = 0.03  # time before the end of a step at which the foot takes weight, s: legs yield, so it meets the floor early
RAMP = 0.25  # share of a swing in which the foot accelerates, and that in which it decelerates
RISES = 0.3  # largest lift, heights of the root for each second of the swing: a quick foot would hit the floor

Angles = TypeVar("Angles", float, Array)
Knot = tuple[float, float, float]  # centre of pressure, m, and its change by the present step's length


@dataclass(slots=True)
class Step:
    """One step of the robot."""

    foot: int  # 0 or 1
    start: float  # time of leaving the floor, s
    end: float  # time of landing, s
    place: Array  # of the landed sole, shape (2,), m
    yaw: float  # of the landed sole, rad
    heading: float  # of the robot then, rad
    astray: float  # that heading relative to the motion's, rad
    direction: float  # of the step's length: midway from the heading before the step, rad
    leaves: float  # pitch of the motion's sole over its toes at leaving, rad
    lands: float  # pitch of the motion's sole over its heel at landing, rad


def pressure_course(
    now: float, last: tuple[float, Array] | None, places: Array, yaws: Array, steps: Sequence[Step], roll: float
) -> tuple[Array, Array]:
    """The course of the centre of pressure.

    Under a single standing foot it goes from `roll` behind the middle of the sole to `roll` before it. While both
    stand, and MEETS before, it goes to its place in the next step by way of the middle between the feet: all the way
    if both stand for two SHIFTs, else as far as time allows, so that two steps of one foot do not balance on the other.

    Args:
        now, roll: s, m.
        last: time, s, and place, m, at which it began to leave the foot of the last step; None before the first.
        places, yaws: of the soles, shape (2, 2), m, and (2,), rad.
        steps: the present one, if any, and those to come.

    Returns:
        times of K knots, shape (K,), s; the `Knot` at each, shape (K, 3).
    """
    at: list[Knot] = [(float(x), float(y), 0.0) for x, y in places]
    toes = [(roll * np.cos(yaw), roll * np.sin(yaw)) for yaw in yaws]
    landed = None if last is None else last[0]
    times: list[float] = [] if last is None else [last[0]]
    knots: list[Knot] = [] if last is None else [(float(last[1][0]), float(last[1][1]), 0.0)]

    def stand(begin: float | None, then: tuple[float, Knot] | None) -> None:
        middle, end = _between(at[0], at[1], 0.5), None if then is None else then[0]
        if begin is not None and then is not None and then[0] - begin <= 2.0 * SHIFT:
            straight, share = _between(knots[-1], then[1], 0.5), (then[0] - begin) / (2.0 * SHIFT)
            times.append(0.5 * (begin + then[0]))
            knots.append(_between(straight, middle, share))
            return
        times.append(min(now, (now if end is None else end) - SHIFT) - 1.0 if begin is None else begin + SHIFT)
        knots.append(middle)
        if end is not None:
            times.append(end - SHIFT)
            knots.append(middle)

    for number, step in enumerate(steps):
        other = 1 - step.foot
        (x, y, share), (u, v) = at[other], toes[other]
        heel = x - u, y - v, share
        stand(landed, (step.start, heel))
        landed = step.end - MEETS
        times += [step.start, landed]
        knots += [heel, (x + u, y + v, share)]
        # All later places move with the first step.
        at[step.foot] = (float(step.place[0]), float(step.place[1]), 1.0)
        toes[step.foot] = (roll * np.cos(step.yaw), roll * np.sin(step.yaw))
        if number > 0:
            at = [(x, y, 1.0) for x, y, _ in at]
    stand(landed, None)
    return np.array(times), np.array(knots)


def _between(one: Knot, other: Knot, share: float) -> Knot:
    (a, b, c), (d, e, f) = one, other
    return a + share * (d - a), b + share * (e - b), c + share * (f - c)


def swing_path(share: float) -> tuple[float, float]:
    """Share of a swinging foot's way and of its lift, at a share of its time."""
    # The speed is a trapezoid, because its joints have hardly any speed to spare.
    u = min(max(share, 0.0), 1.0)
    near = min(u, 1.0 - u)
    way = near**2 / (2.0 * RAMP * (1.0 - RAMP)) if near < RAMP else (near - 0.5 * RAMP) / (1.0 - RAMP)
    return way if u < 0.5 else 1.0 - way, 16.0 * (u * (1.0 - u)) ** 2


def swing_ramps(start: float, end: float) -> tuple[tuple[float, float, float, float], float]:
    """The corners of that trapezoid from start to end, s, and the ratio of way and acceleration in its ramps, s^2."""
    lasts = end - start
    ramp = RAMP * lasts
    return (start, start + ramp, end - ramp, end), ramp * (lasts - ramp)


def highest(lift: float, seconds: float) -> float:
    """Lift of a foot whose swing takes some seconds, at most `lift`; heights of the root."""
    return min(lift, RISES * seconds)


def rotated(vector: Array | tuple[float, float], angle: float) -> Array:
    """A vector (2,) turned to the left by an angle, rad."""
    (x, y), cos, sin = vector, np.cos(angle), np.sin(angle)
    return np.array([cos * x - sin * y, sin * x + cos * y])


def azimuth(direction: Array) -> float:
    """Azimuth of a direction (3,), rad."""
    return float(np.arctan2(direction[1], direction[0]))


def wrapped(angle: Angles) -> Angles:
    """Angles, rad, wrapped to half a turn either way."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
