"""Switching motions without a jump: the new motion starts at once, and the difference to the old one fades away.

At the switch the target motion is started where it resembles the present body most (`best_anchor`), and for each bone
the rotation that leads from the target to what was shown is kept as a rotation vector, with its rate of change. From
then on the target is shown turned by that vector while it runs out along a quintic that starts with the same value and
slope and ends with neither (inertialisation, Bollo 2018). Since bones are turned and never mixed, they keep their
length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.mocap.posture import Posture
from controller.quintic import run_out
from controller.rotations import Array, conjugate, from_rotation_vector, multiply, to_rotation_vector

SHORTEST, LONGEST = 0.2, 1.6

# The largest derivatives on [0, 1] of the quintics that start with value 1 or with slope 1.
_VALUE_SLOPE, _VALUE_CURVE, _SLOPE_CURVE = 1.875, 5.7735, 3.9419


@dataclass(frozen=True)
class Briskness:
    """How briskly joints may move while a difference fades, and how fast the target moves them.

    Attributes:
        acceleration: of any joint, m/s^2.
        speed: of the root and of each joint relative to the root, shape (1 + B,), m/s.
    """

    acceleration: float
    speed: Array


@dataclass(frozen=True)
class Fade:
    """A difference that runs out.

    Attributes:
        duration: how long it takes, s.
        turn, turn_rate: of the root and of each bone, shape (1 + B, 3), rad and rad/s.
        drift, drift_rate: of height, velocity and turn rate, shape (4,).
    """

    duration: float
    turn: Array
    turn_rate: Array
    drift: Array
    drift_rate: Array

    def apply(self, target: Posture, elapsed: float) -> Posture:
        """The target with what is left of the difference after some seconds."""
        s = elapsed / self.duration
        if s >= 1.0:
            return target
        value, slope = run_out(s)
        slope *= self.duration
        left = value * self.turn + slope * self.turn_rate
        drift = value * self.drift + slope * self.drift_rate
        return Posture(
            height=target.height + drift[0],
            velocity=target.velocity + drift[1:3],
            turn_rate=target.turn_rate + drift[3],
            rotation=multiply(from_rotation_vector(left), target.rotation),
        )

    def onset(self, elapsed: float) -> float:
        """The share of the tempo at which a motion that happens once gets going.

        At full tempo half of it would be over before it can be seen.
        """
        return min(1.0, elapsed / self.duration) ** 2

    def lasts(self, elapsed: float) -> bool:
        """Whether anything is left of the difference."""
        return elapsed < self.duration


class GoingOver(Protocol):
    """What goes over from one motion to another by itself."""

    @property
    def crossing(self) -> bool:
        """Whether it is on its way."""
        ...


@dataclass(frozen=True)
class Crossing:
    """A switch that the network carries out by itself: nothing is left to fade, and both motions keep their tempo."""

    network: GoingOver

    def apply(self, target: Posture, elapsed: float) -> Posture:
        """The target as it is."""
        return target

    def onset(self, elapsed: float) -> float:
        """The whole tempo: the motion that is left would stand still with it."""
        return 1.0

    def lasts(self, elapsed: float) -> bool:
        """Whether the network is on its way."""
        return self.network.crossing


def difference(
    shown: tuple[Posture, Posture],
    target: tuple[Posture, Posture],
    dt: float,
    joints: Callable[[Posture], Array],
    bound: Briskness,
) -> Fade:
    """The fade that leads from what is shown to a target.

    Args:
        shown, target: each the postures dt seconds ago and now.
        dt: s.
        joints: positions of root and joints in a posture, from the ground below the root, shape (1 + B, 3), m.
        bound: decides how long the fade takes.
    """
    turn = _turn(shown[1], target[1])
    rate = (turn - _nearest(_turn(shown[0], target[0]), turn)) / dt
    drift = _drift(shown[1]) - _drift(target[1])
    drift_rate = (drift - _drift(shown[0]) + _drift(target[0])) / dt
    apart = joints(shown[1]) - joints(target[1])
    parting = (apart - joints(shown[0]) + joints(target[0])) / dt
    length = duration(apart, parting, np.linalg.norm(turn, axis=-1), float(np.hypot(*drift[1:3])), bound)
    return Fade(length, turn, rate, drift, drift_rate)


def duration(apart: Array, parting: Array, angle: Array, drift: float, bound: Briskness) -> float:
    """The time in which a difference can fade with no joint accelerated beyond the bound, within SHORTEST and LONGEST.

    In a time T a joint that is d away, with a rate of v, is brought in at up to 5.77 d / T^2 + 3.94 v / T, and the root
    changes its own velocity at up to 1.875 drift / T. Since the bone turns by an angle meanwhile, at up to
    w = 1.875 angle / T, and the target moves the joint at a speed u, w^2 d / angle and 2 w u come on top (centripetal,
    Coriolis); of these half is taken, for their peaks come at another moment. The sum is set equal to the bound.

    Args:
        apart, parting: how far the joints are from the target and the rate of that, shape (1 + B, 3), m and m/s.
        angle: by which the bones are turned, shape (1 + B,), rad.
        drift: by how much the root's velocity differs, m/s.
        bound: see there.

    Returns:
        s.
    """
    far, rate = np.linalg.norm(apart, axis=-1), np.linalg.norm(parting, axis=-1)
    square = (_VALUE_CURVE + 0.5 * _VALUE_SLOPE**2 * angle) * far
    slope = _SLOPE_CURVE * rate + _VALUE_SLOPE * (drift + angle * bound.speed)
    needed = (slope + np.sqrt(slope * slope + 4.0 * bound.acceleration * square)) / (2.0 * bound.acceleration)
    return float(np.clip(needed.max(), SHORTEST, LONGEST))


def best_anchor(place: Array, velocity: Array, places: Array, velocities: Array, reach: float) -> int:
    """Which anchor of a motion resembles a body most.

    Args:
        place, velocity: joint positions in the heading frame and their rates, shape (F,), m and m/s.
        places, velocities: the same at the anchors, shape (A, F).
        reach: how much a difference in velocity counts, s.
    """
    cost = np.square(places - place).sum(1) + reach**2 * np.square(velocities - velocity).sum(1)
    return int(cost.argmin())


def _turn(shown: Posture, target: Posture) -> Array:
    return to_rotation_vector(multiply(shown.rotation, conjugate(target.rotation)))


def _nearest(vector: Array, other: Array) -> Array:
    """Of the two rotation vectors that mean the same rotation the one nearer to another, shapes (..., 3).

    Between two instants a difference may pass half a turn, where the short way round changes sides.
    """
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    around = vector * (1.0 - 2.0 * np.pi / np.maximum(angle, 1e-9))
    far = np.linalg.norm(vector - other, axis=-1, keepdims=True)
    return np.where(np.linalg.norm(around - other, axis=-1, keepdims=True) < far, around, vector)


def _drift(posture: Posture) -> Array:
    return np.array([posture.height, posture.velocity[0], posture.velocity[1], posture.turn_rate])
