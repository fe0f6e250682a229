"""Switching motions without a jump: the new motion starts at once, and the difference to the old one fades away.

At the switch the target motion is started where it resembles the present body most (`best_anchor`), and for each bone
the rotation that leads from the target to what was shown is kept as a rotation vector, with its rate of change. From
then on the target is shown turned by that vector while it runs out along a quintic that starts with the same value and
slope and ends with neither (inertialisation, Bollo 2018). Since bones are turned and never mixed, they keep their
length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.generators.base import CrossingNetwork
from controller.mocap.posture import Posture
from controller.quintic import run_out
from controller.rotations import Array, conjugate, from_rotation_vector, multiply, to_rotation_vector

SHORTEST, LONGEST = 0.2, 1.6

# The largest second derivatives on [0, 1] of the quintics that start with value 1 or with slope 1.
_VALUE_CURVE, _SLOPE_CURVE = 5.7735, 3.9419


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


@dataclass(frozen=True)
class Crossing:
    """A switch that the network carries out by itself: nothing is left to fade, and both motions keep their tempo."""

    network: CrossingNetwork

    def apply(self, target: Posture, elapsed: float) -> Posture:
        """The target as it is."""
        return target

    def onset(self, elapsed: float) -> float:
        """The whole tempo: the motion that is left would stand still with it."""
        return 1.0

    def lasts(self, elapsed: float) -> bool:
        """Whether the network is on its way."""
        return self.network.crossing


def difference(shown: tuple[Posture, Posture], target: tuple[Posture, Posture], dt: float, bound: Array) -> Fade:
    """The fade that leads from what is shown to a target.

    Args:
        shown, target: each the postures dt seconds ago and now.
        dt: s.
        bound: angular acceleration that the fade may add to the root and to each bone, shape (1 + B,), rad/s^2; it
            decides how long the fade takes.
    """
    turn = _turn(shown[1], target[1])
    rate = (turn - _nearest(_turn(shown[0], target[0]), turn)) / dt
    drift = _drift(shown[1]) - _drift(target[1])
    drift_rate = (drift - _drift(shown[0]) + _drift(target[0])) / dt
    return Fade(duration(turn, rate, bound), turn, rate, drift, drift_rate)


def duration(turn: Array, rate: Array, bound: Array) -> float:
    """The time in which a difference can fade with no bone accelerated beyond its bound, within SHORTEST and LONGEST,
    s.

    The fade's acceleration is at most  5.77 |turn| / T^2 + 3.94 |rate| / T;  set equal to the bound and solved for T.
    """
    value = _VALUE_CURVE * np.linalg.norm(turn, axis=-1)
    slope = _SLOPE_CURVE * np.linalg.norm(rate, axis=-1)
    needed = (slope + np.sqrt(slope * slope + 4.0 * bound * value)) / (2.0 * bound)
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
