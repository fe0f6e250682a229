"""Blends two motions that run side by side bone by bone, along the rotation that leads from one to the other.

With P and Q the rotations of a bone in the two motions and w the weight of the second, the blend shows

    exp(w log(Q P*)) P,

where the rotation vector log(Q P*) is followed from tick to tick past half a turn, so that no bone ever passes through
zero or changes sides. P and Q are seen from a heading that follows that of the hips smoothly: while a body stands on
its hands the heading of the hips flies round, but the body does not.

A bone that is a whole turn ahead has to be taken the short way round some time. That turns it by 2 pi w at once, which
then runs out smoothly (`TurnsLeft`). Near w = 0 and 1 that is little or nothing, so there the short way is taken from
half a turn on.

Where bone directions alone are known, the twist of a bone follows a rule (`mocap.orientation`) and may jump while the
bone itself does not. Then the last D = Q P* is kept, turned the shortest way so that it still leads from the direction
of the one bone to that of the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.mocap.posture import Posture
from controller.quintic import run_out
from controller.rotations import (
    Array,
    conjugate,
    from_rotation_vector,
    multiply,
    nearest_rotation_vector,
    normalise,
    rotate,
    to_rotation_vector,
    yaw,
)
from controller.rotations import between as shortest_turn

HEADING_RATE = 4.0
"""How quickly the smooth heading follows that of the hips, 1/s (a critically damped filter of second order)."""

HALF_TURN, LONGER = np.pi, 1.2 * np.pi
"""A rotation vector is taken the short way round beyond HALF_TURN + LONGER min(w, 1 - w), rad."""

LEAST_SECONDS = 0.2
"""The shortest time in which a turn runs out, s; half a turn takes a second, others its root of their share of that."""

TWIST_JUMP = 1.0
"""A relative rotation that changes by more than this (rad) in a tick is a jump of a bone's twist."""


@dataclass(slots=True)
class SmoothHeading:
    """The heading of one motion, smoothed.

    Attributes:
        offset: the heading of the hips less the smooth one, rad.
        rate: of the smooth one, rad/s.
    """

    rate: float
    offset: float = 0.0

    def advance(self, turn_rate: float, dt: float) -> None:
        """Follows a heading that turns by `turn_rate` (rad/s) for dt seconds."""
        change = HEADING_RATE**2 * self.offset + 2.0 * HEADING_RATE * (turn_rate - self.rate)
        self.rate += change * dt
        self.offset += (turn_rate - self.rate) * dt

    def seen(self, posture: Posture) -> tuple[Array, Array]:
        """The rotations (1 + B, 4) and the velocity (3,) of a posture, seen from the smooth heading."""
        back = yaw(self.offset)
        return multiply(back, posture.rotation), rotate(back, np.array([*posture.velocity, 0.0]))


class TurnsLeft:
    """Turns of bones that run out along quintics.

    Args:
        bones: how many.
    """

    def __init__(self, bones: int) -> None:
        self._turn, self._rate = np.zeros((2, bones, 3))
        self._elapsed, self._seconds = np.ones((2, bones, 1))

    @property
    def lasts(self) -> bool:
        """Whether anything is left."""
        return bool((self._elapsed < self._seconds).any())

    @property
    def now(self) -> Array:
        """What is left of each, as rotation vectors, shape (bones, 3)."""
        value, slope = run_out(np.minimum(self._elapsed / self._seconds, 1.0))
        return value * self._turn + slope * self._seconds * self._rate

    def advance(self, dt: float) -> None:
        """Goes dt seconds on."""
        self._elapsed += dt

    def begin(self, bones: NDArray[np.int64], turn: Array, rate: Array) -> None:
        """Gives some bones turns (n, 3), rad, that change at rates (n, 3), rad/s, to run out from now on."""
        share = np.linalg.norm(turn, axis=-1, keepdims=True) / np.pi
        self._turn[bones], self._rate[bones], self._elapsed[bones] = turn, rate, 0.0
        self._seconds[bones] = np.maximum(LEAST_SECONDS, np.sqrt(share))


class PostureBlend:
    """Two motions, each a posture per tick, that begin with the same heading.

    Args:
        first, second: their present postures.
        rest_direction: the directions of the bones in the rest pose, shape (B, 3), where their twist follows a rule.
    """

    def __init__(self, first: Posture, second: Posture, rest_direction: Array | None = None) -> None:
        self._rest_direction = rest_direction
        self._headings = SmoothHeading(float(first.turn_rate)), SmoothHeading(float(second.turn_rate))
        self._turn = to_rotation_vector(multiply(second.rotation, conjugate(first.rotation)))
        self._offset = self._weight = 0.0
        self._left = TurnsLeft(len(self._turn))

    @property
    def settling(self) -> bool:
        """Whether a bone is still on its way from the long way round to the short one."""
        return self._left.lasts

    def advance(self, first: Posture, second: Posture, weight: float, dt: float) -> Posture:
        """The blend dt seconds later, with the weight of the second motion in it.

        At a weight of 0 and 1 it is the posture of one of them, unchanged, unless it is `settling`.
        """
        for heading, posture in zip(self._headings, (first, second), strict=True):
            heading.advance(float(posture.turn_rate), dt)
        a, b = self._headings
        (p, p_velocity), (q, q_velocity) = a.seen(first), b.seen(second)
        self._turn = self._shortened(self._followed(p, q), weight, dt)
        self._weight = weight
        shown = multiply(from_rotation_vector(weight * self._turn), p)
        if self._left.lasts:
            shown = multiply(from_rotation_vector(self._left.now), shown)
        # Seen from a heading again that is the hips' own when one motion is left.
        offset = (1.0 - weight) * a.offset + weight * b.offset
        turn_rate = (1.0 - weight) * a.rate + weight * b.rate + (offset - self._offset) / max(dt, 1e-9)
        self._offset = offset
        forth = yaw(-offset)
        velocity = rotate(forth, (1.0 - weight) * p_velocity + weight * q_velocity)
        return replace(
            first,
            height=(1.0 - weight) * first.height + weight * second.height,
            velocity=velocity[:2],
            turn_rate=np.array(turn_rate),
            rotation=multiply(forth, shown),
        )

    def _followed(self, p: Array, q: Array) -> Array:
        """The rotation vectors from p to q, shapes (1 + B, 4), nearest to the last ones, shape (1 + B, 3)."""
        relative, last = multiply(q, conjugate(p)), from_rotation_vector(self._turn)
        if self._rest_direction is not None:
            jump = to_rotation_vector(multiply(relative, conjugate(last)))[1:]
            jumped = np.flatnonzero(np.square(jump).sum(-1) > TWIST_JUMP**2)
            if len(jumped):
                rest, bones = self._rest_direction[jumped], jumped + 1
                reached = rotate(multiply(last[bones], p[bones]), rest)
                relative[bones] = multiply(shortest_turn(reached, rotate(q[bones], rest)), last[bones])
        return nearest_rotation_vector(to_rotation_vector(relative), self._turn)

    def _shortened(self, turn: Array, weight: float, dt: float) -> Array:
        """The rotation vectors, too long ones taken the short way round; what that turns a bone by runs out."""
        angle = np.linalg.norm(turn, axis=-1)
        long = np.flatnonzero(angle > HALF_TURN + LONGER * abs(weight - round(weight)))
        before = self._left.now[long] if len(long) else turn[long]
        self._left.advance(dt)
        if len(long):
            was = _one_turn(before, 2.0 * np.pi * self._weight * normalise(self._turn[long]))
            left = _one_turn(self._left.now[long], 2.0 * np.pi * weight * normalise(turn[long]))
            self._left.begin(long, left, (left - nearest_rotation_vector(was, left)) / max(dt, 1e-9))
            turn[long] *= 1.0 - 2.0 * np.pi / angle[long, None]
        return turn


def _one_turn(last: Array, first: Array) -> Array:
    """The rotation vectors, the short way round, of turning by some first and then by others, shape (n, 3)."""
    return to_rotation_vector(multiply(from_rotation_vector(last), from_rotation_vector(first)))
