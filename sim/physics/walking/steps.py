"""Steps: where the feet of the robot stand and will stand, and so where its centre of pressure is to be when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array

# For so long the centre of pressure moves to the middle between the feet, or from there, s.
SHIFT = 0.25
# The weight begins to go over to a foot so long before its step ends, s: legs yield, so it meets the floor early.
MEETS = 0.03
# In this share of its time a swinging foot speeds up, and in the last one it slows down.
RAMP = 0.25
# A foot is lifted by at most so many heights of the root for each second of its swing: a quick one would hit the floor.
RISES = 0.3

Knot = tuple[float, float, float]
"""Where the centre of pressure is, m, and how much of it goes along when the step under way gets longer."""


@dataclass(slots=True)
class Step:
    """One step of the robot.

    Attributes:
        foot: 0 or 1.
        start: when the foot leaves the floor, s.
        end: when it lands, s.
        place: where the middle of its sole lands, shape (2,), m.
        yaw: which way it points then, rad.
        heading: of the robot then, rad.
        astray: how far that is from the heading of the motion, rad.
        direction: in which its length and width are measured: midway from the heading before the step, rad.
        leaves: how far the motion's sole is turned over its toes when it leaves the floor, rad.
        lands: how far it is turned over its heel when it lands, rad.
    """

    foot: int
    start: float
    end: float
    place: Array
    yaw: float
    heading: float
    astray: float
    direction: float
    leaves: float
    lands: float


def pressure_course(
    now: float, last: tuple[float, Array] | None, places: Array, yaws: Array, steps: Sequence[Step], roll: float
) -> tuple[Array, Array]:
    """Where the centre of pressure is to be when.

    Under a foot that stands alone it goes from `roll` behind the middle of the sole to as much before it; while both
    stand, and MEETS before, to where it is to be in the next step, and on the way there towards the middle between
    them: all the way if both stand for two SHIFTs, else as far as there is time. So who takes two steps with the same
    foot does not balance on the other one meanwhile.

    Args:
        now: s.
        last: when the centre of pressure began to leave the foot that stood during the last step, s, and where it was
            then, m; None if there was none.
        places: of the middles of the soles, shape (2, 2), m.
        yaws: which way they point, shape (2,), rad.
        steps: what is to come, in order; the first one may be under way.
        roll: m.

    Returns:
        the times of K knots, shape (K,), s; and at each, shape (K, 3), the centre of pressure, m, and how much of it
        goes along when the first step gets longer.
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
        # All that comes later goes along with the first step.
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
    """How far a swinging foot is along its way, and how high of its lift, at a share of its time.

    It speeds up, goes evenly and slows down, because its joints have hardly any speed to spare.
    """
    u = min(max(share, 0.0), 1.0)
    near = min(u, 1.0 - u)
    way = near**2 / (2.0 * RAMP * (1.0 - RAMP)) if near < RAMP else (near - 0.5 * RAMP) / (1.0 - RAMP)
    return way if u < 0.5 else 1.0 - way, 16.0 * (u * (1.0 - u)) ** 2


def swing_ramps(start: float, end: float) -> tuple[tuple[float, float, float, float], float]:
    """When a foot on that path speeds up and slows down, and how quickly.

    Args:
        start: when it leaves the floor, s.
        end: when it lands, s.

    Returns:
        when it begins and ends to speed up, and begins and ends to slow down, s; and what its way is divided by to give
        its acceleration meanwhile, s^2.
    """
    lasts = end - start
    ramp = RAMP * lasts
    return (start, start + ramp, end - ramp, end), ramp * (lasts - ramp)


def highest(lift: float, seconds: float) -> float:
    """How high a foot is lifted whose swing takes so long, at most `lift`; heights of the root."""
    return min(lift, RISES * seconds)
