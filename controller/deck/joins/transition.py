"""Switching motions without a jump: the new motion starts at once, and the difference to the old one fades away.

At the switch the target motion is started where it resembles the present body most (`best_anchor`), and for each bone
the rotation that leads from the target to what was shown is kept as a rotation vector, with its rate of change. From
then on the target is shown turned by that vector while it runs out along a quintic that starts with the same value and
slope and ends with neither (inertialisation, Bollo 2018). What slope it starts with may run out sooner than the
difference in place, where a body would swing too far otherwise. Since bones are turned and never mixed, they keep their
length.

The vectors stay fixed in the world. The heading would be no frame for them: it is that of the hips, and flies round
while a body stands on its hands.

Where bone directions alone are known, how a bone twists about itself follows a rule (`mocap.orientation`), often faster
than the bone moves. A rate that held this twist would turn the bone with it once the bone points elsewhere, so it runs
out beside the vector, about the bone itself.
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
from controller.rotations import between as shortest_turn

SHORTEST, LONGEST = 0.2, 1.6

# The part of the bounds that a fade may use: it is looked at at some moments only.
PLANNED_SHARE = 0.8

# What a body was doing is slowed down as long as the difference fades, or within these shares of that time, which lets
# it swing less far but accelerates it more.
_SLOWED_WITHIN = (1.0, 0.5, 0.25)

# At how many moments until its rate has run out a fade's speed and acceleration are computed, and by which factor it is
# lengthened at least.
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
        slowing: how long until nothing is left of its rate, s, at most the duration.
        turn, turn_rate: of the root and of each bone, seen from the heading at the switch, shape (1 + B, 3), rad and
            rad/s.
        drift, drift_rate: of height and velocity, seen from there too, shape (3,).
        twist_rate: of each bone about itself in the rest pose, shape (B, 3), rad/s; None where `turn_rate` holds it.
    """

    duration: float
    slowing: float
    turn: Array
    turn_rate: Array
    drift: Array
    drift_rate: Array
    twist_rate: Array | None = None

    def apply(self, target: Posture, elapsed: float, turned: float) -> Posture:
        """The target with what is left of the difference after some seconds, its heading turned by some rad since."""
        if elapsed >= self.duration:
            return target
        value, slope = self.left(np.array(elapsed))
        back = yaw(-turned)
        left = rotate(back, value * self.turn + slope * self.turn_rate)
        height, *velocity = value * self.drift + slope * self.drift_rate
        rotation = multiply(from_rotation_vector(left), target.rotation)
        if self.twist_rate is not None:
            rotation[1:] = multiply(rotation[1:], from_rotation_vector(slope * self.twist_rate))
        return replace(
            target,
            height=target.height + height,
            velocity=target.velocity + rotate(back, np.array([*velocity, 0.0]))[:2],
            rotation=rotation,
        )

    def left(self, elapsed: Array) -> tuple[Array, Array]:
        """What is left of the difference after some seconds, and of the way on which its rate leads until then, s."""
        value, _ = run_out(elapsed / self.duration)
        _, slope = run_out(np.minimum(elapsed / self.slowing, 1.0))
        return value, self.slowing * slope

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
    rest_direction: Array | None = None,
) -> Fade:
    """The fade that leads from what is shown to a target, in the shortest time that keeps joints in bounds.

    Speed and acceleration are found by looking at the fade over what the target does next: from SHORTEST on it is made
    longer until it is in bounds. If none up to LONGEST is, its rate runs out in half of the time, and then in a
    quarter. If none of these is, it is the one that comes nearest.

    Args:
        shown, target: each the postures dt seconds ago and now.
        dt: s.
        ahead: the target's postures after so many seconds (S,), from 0 on.
        limbs: joint positions relative to the root of rotations (..., 1 + B, 4), shape (..., J, 3), m.
        bounds: what no joint may exceed.
        rest_direction: of the bones in the rest pose, shape (B, 3), where their twist follows a rule.
    """
    before, aim = _from_now(shown, dt), _from_now(target, dt)
    twist_rate: Array | None = None
    if rest_direction is not None:
        before, shown_twist = _untwisted(before, shown[1], rest_direction)
        aim, target_twist = _untwisted(aim, target[1], rest_direction)
        twist_rate = (shown_twist - target_twist) / dt
    turn = _turn(shown[1].rotation, target[1].rotation)
    turn_rate = (turn - nearest_rotation_vector(_turn(before.rotation, aim.rotation), turn)) / dt
    drift = _drift(shown[1]) - _drift(target[1])
    drift_rate = (drift - _drift(before) + _drift(aim)) / dt
    best, least, already = Fade(SHORTEST, SHORTEST, turn, turn_rate, drift, drift_rate, twist_rate), np.inf, 0.0
    for share in _SLOWED_WITHIN:
        fade = replace(best, duration=SHORTEST, slowing=share * SHORTEST)
        while True:
            speeds, acceleration = peaks(fade, ahead, limbs)
            # A body that is already faster than that is slowed down by no choice of the duration.
            already = already or float(speeds[0])
            fastest = max(PLANNED_SHARE * bounds.speed, already)
            # What a difference in place costs goes with 1 / T in speed and 1 / T^2 in acceleration, one in speed goes
            # with 1 and 1 / T: the former never overshoots. But what moves fast away from the target goes the farther
            # the longer it is given.
            beyond = max(acceleration / (PLANNED_SHARE * bounds.acceleration), (float(speeds.max()) / fastest) ** 2)
            if beyond < least:
                best, least = fade, beyond
            if beyond <= 1.0:
                return best
            if fade.duration >= LONGEST:
                break
            longer = min(LONGEST, fade.duration * max(_LONGER, float(np.sqrt(beyond))))
            fade = replace(fade, duration=longer, slowing=share * longer)
    return best


def extrapolated(before: Posture, now: Posture, dt: float, rest_direction: Array | None = None) -> Posture:
    """The posture dt seconds after two others, if every bone turns and the root moves on as they did.

    With rest directions, as for `difference`, bones twist no further.
    """
    earlier = _from_now((before, now), dt)
    if rest_direction is not None:
        earlier, _ = _untwisted(earlier, now, rest_direction)
    step = _turn(now.rotation, earlier.rotation)
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
        The speed of the fastest joint in each part of the fade, shape (parts,), m/s; the largest acceleration beyond
        the target's own, m/s^2.
    """
    samples = round(_SAMPLES * fade.duration / fade.slowing)
    step = fade.duration / samples
    time: Array = step * np.arange(samples + 1.0)
    value, slope = (left[:, None, None] for left in fade.left(time))
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


def _untwisted(before: Posture, now: Posture, rest_direction: Array) -> tuple[Posture, Array]:
    """A posture whose bones lead to the present one the shortest way, and by how much they twist on that way.

    Returns:
        The posture; rotation vectors about the bones in the rest pose, shape (B, 3), rad.
    """
    was, here = (rotate(posture.rotation[1:], rest_direction) for posture in (before, now))
    bones = multiply(shortest_turn(here, was), now.rotation[1:])
    twist = to_rotation_vector(multiply(conjugate(before.rotation[1:]), bones))
    return replace(before, rotation=np.concatenate([before.rotation[:1], bones])), twist


def _turn(shown: Array, target: Array) -> Array:
    return to_rotation_vector(multiply(shown, conjugate(target)))


def _drift(posture: Posture) -> Array:
    return np.array([posture.height, posture.velocity[0], posture.velocity[1]])
