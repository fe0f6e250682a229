"""Switching motions without a jump: the new motion starts at once, and the difference to the old one fades away.

At the switch the target motion is started where it resembles the present body most (`best_anchor`), and for each bone
the rotation that leads from the target to what was shown is kept as a rotation vector, with its rate of change. From
then on the target is shown turned by that vector while it runs out along a quintic that starts with the same value and
slope and ends with neither (inertialisation, Bollo 2018). Since bones are turned and never mixed, they keep their
length.

The vectors stay fixed in the world. The heading would be no frame for them: it is that of the hips, and flies round
while a body stands on its hands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller.mocap.posture import Posture
from controller.quintic import run_out
from controller.rotations import (
    Array,
    conjugate,
    from_rotation_vector,
    multiply,
    nearest_rotation_vector,
    rotate,
    to_rotation_vector,
    yaw,
)

SHORTEST, LONGEST = 0.2, 1.6

# The part of the bounds that a fade may use: it is looked at at some moments only.
_SHARE = 0.8

# At how many moments speed and acceleration of a fade are computed, and the least factor by which it is lengthened.
_SAMPLES = 16
_LONGER = 1.1


@dataclass(frozen=True)
class Bounds:
    """What no joint may exceed while a difference fades.

    Attributes:
        speed: in the world, m/s.
        acceleration: in the world, beyond the target's own, m/s^2.
    """

    speed: float
    acceleration: float


@dataclass(frozen=True)
class Fade:
    """A difference that runs out.

    Attributes:
        duration: how long it takes, s.
        turn, turn_rate: of the root and of each bone, seen from the heading at the switch, shape (1 + B, 3), rad and
            rad/s.
        drift, drift_rate: of height and velocity, seen from there too, shape (3,).
    """

    duration: float
    turn: Array
    turn_rate: Array
    drift: Array
    drift_rate: Array

    def apply(self, target: Posture, elapsed: float, turned: float) -> Posture:
        """The target with what is left of the difference after some seconds, its heading turned by some rad since."""
        if elapsed >= self.duration:
            return target
        value, slope = run_out(elapsed / self.duration)
        slope *= self.duration
        back = yaw(-turned)
        left = rotate(back, value * self.turn + slope * self.turn_rate)
        height, *velocity = value * self.drift + slope * self.drift_rate
        return replace(
            target,
            height=target.height + height,
            velocity=target.velocity + rotate(back, np.array([*velocity, 0.0]))[:2],
            rotation=multiply(from_rotation_vector(left), target.rotation),
        )

    def onset(self, elapsed: float) -> float:
        """The share of the tempo at which a one-shot gets going.

        At full tempo half of it would be over before it can be seen.
        """
        return min(1.0, elapsed / self.duration) ** 2

    def lasts(self, elapsed: float) -> bool:
        """Whether anything is left of the difference."""
        return elapsed < self.duration


def difference(
    shown: tuple[Posture, Posture],
    target: tuple[Posture, Posture],
    dt: float,
    ahead: Callable[[Array], Posture],
    limbs: Callable[[Array], Array],
    bounds: Bounds,
) -> Fade:
    """The fade that leads from what is shown to a target, in the shortest time that keeps joints in bounds.

    Speed and acceleration are found by looking at the fade over what the target does next: from SHORTEST on it is made
    longer until it is in bounds. If none up to LONGEST is, it is the one that comes nearest.

    Args:
        shown, target: each the postures dt seconds ago and now.
        dt: s.
        ahead: the target's postures after so many seconds (S,), from 0 on.
        limbs: joint positions relative to the root of rotations (..., 1 + B, 4), shape (..., J, 3), m.
        bounds: what no joint may exceed.
    """
    before, aim = _from_now(shown, dt), _from_now(target, dt)
    turn = _turn(shown[1].rotation, target[1].rotation)
    turn_rate = (turn - nearest_rotation_vector(_turn(before.rotation, aim.rotation), turn)) / dt
    drift = _drift(shown[1]) - _drift(target[1])
    drift_rate = (drift - _drift(before) + _drift(aim)) / dt
    fade = Fade(SHORTEST, turn, turn_rate, drift, drift_rate)
    best, least = fade, np.inf
    while True:
        speeds, acceleration = peaks(fade, ahead, limbs)
        # A body that is already faster than that is slowed down by no choice of the duration.
        fastest = max(_SHARE * bounds.speed, float(speeds[0]))
        # What a difference in place costs goes with 1 / T in speed and 1 / T^2 in acceleration, one in speed goes with
        # 1 and 1 / T: the former never overshoots. But what moves fast away from the target goes the farther the
        # longer it is given.
        beyond = max(acceleration / (_SHARE * bounds.acceleration), (float(speeds.max()) / fastest) ** 2)
        if beyond < least:
            best, least = fade, beyond
        if beyond <= 1.0 or fade.duration >= LONGEST:
            return best
        longer = fade.duration * max(_LONGER, np.sqrt(beyond))
        fade = replace(fade, duration=float(min(LONGEST, longer)))


def extrapolated(before: Posture, now: Posture, dt: float) -> Posture:
    """The posture dt seconds after two others, if every bone turns and the root moves on as they did."""
    step = _turn(now.rotation, _from_now((before, now), dt).rotation)
    turned = float(now.turn_rate) * dt
    back = yaw(-turned)
    return replace(
        now,
        height=2.0 * now.height - before.height,
        velocity=rotate(back, np.append(now.velocity, 0.0))[:2],
        rotation=multiply(back, multiply(from_rotation_vector(step), now.rotation)),
    )


def peaks(fade: Fade, ahead: Callable[[Array], Posture], limbs: Callable[[Array], Array]) -> tuple[Array, float]:
    """How fast joints are during a fade, and how much they are accelerated beyond its target's own motion.

    Args:
        fade: which.
        ahead, limbs: as for `difference`.

    Returns:
        The speed of the fastest joint in each part of the fade, shape (_SAMPLES,), m/s; the largest acceleration beyond
        the target's own, m/s^2.
    """
    step = fade.duration / _SAMPLES
    time: Array = step * np.arange(_SAMPLES + 1.0)
    value, slope = run_out((time / fade.duration)[:, None, None])
    slope = slope * fade.duration
    target = ahead(time)
    heading = step * (np.cumsum(target.turn_rate) - 0.5 * (target.turn_rate + target.turn_rate[0]))
    facing = yaw(heading)
    aim = multiply(facing[:, None], target.rotation)
    shown = multiply(from_rotation_vector(value * fade.turn + slope * fade.turn_rate), aim)
    drift = value * fade.drift + slope * fade.drift_rate
    height, along = drift[..., :1], drift[..., 1:]
    walked = rotate(facing, np.column_stack([target.velocity, np.zeros(len(time))]))[:, None, :2] + along
    places, beside = limbs(shown), limbs(aim)
    moved = np.diff(places, axis=0) / step
    moved[..., :2] += 0.5 * (walked[1:] + walked[:-1])
    moved[..., 2:] += np.diff(height + target.height[:, None, None], axis=0) / step
    beyond = np.diff(places - beside, n=2, axis=0) / step**2
    beyond[..., :2] += (along[2:] - along[:-2]) / (2.0 * step)
    beyond[..., 2:] += np.diff(height, n=2, axis=0) / step**2
    return np.sqrt(np.square(moved).sum(-1).max(-1)), float(np.sqrt(np.square(beyond).sum(-1).max()))


def best_anchor(place: Array, velocity: Array, places: Array, velocities: Array, reach: float) -> int:
    """Which anchor of a motion resembles a body most.

    Args:
        place, velocity: joint positions in the heading frame and their rates, shape (F,), m and m/s.
        places, velocities: the same at the anchors, shape (A, F).
        reach: how much a difference in velocity counts, s.
    """
    cost = np.square(places - place).sum(1) + reach**2 * np.square(velocities - velocity).sum(1)
    return int(cost.argmin())


def _from_now(postures: tuple[Posture, Posture], dt: float) -> Posture:
    """The first of two postures, seen from the heading of the second."""
    before, now = postures
    back = yaw(-float(now.turn_rate) * dt)
    velocity = rotate(back, np.append(before.velocity, 0.0))[:2]
    return replace(before, velocity=velocity, rotation=multiply(back, before.rotation))


def _turn(shown: Array, target: Array) -> Array:
    return to_rotation_vector(multiply(shown, conjugate(target)))


def _drift(posture: Posture) -> Array:
    return np.array([posture.height, posture.velocity[0], posture.velocity[1]])
