"""Blends two motions that run side by side bone by bone, along the rotation that leads from one to the other.

With P and Q the rotations of a bone in the two motions and w the weight of the second, the blend shows

    exp(w log(Q P*)) P,

where the rotation vector log(Q P*) is followed from tick to tick past half a turn, so that no bone ever passes through
zero or changes sides. P and Q are seen from a heading that follows that of the hips smoothly: while a body stands on
its hands the heading of the hips flies round, but the body does not.

Where bone directions alone are known, the twist of a bone follows a rule (`mocap.orientation`) and may jump while the
bone itself does not. Then the last D = Q P* is kept, turned the shortest way so that it still leads from the direction
of the one bone to that of the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from controller.mocap.posture import Posture
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

HEADING_RATE = 4.0
"""How quickly the smooth heading follows that of the hips, 1/s (a critically damped filter of second order)."""

FARTHEST_TURN = 1.6 * np.pi
"""Beyond this angle (rad) a rotation vector is taken the short way round again."""

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
        self._offset = 0.0

    def advance(self, first: Posture, second: Posture, weight: float, dt: float) -> Posture:
        """The blend dt seconds later, with the weight of the second motion in it.

        At a weight of 0 and 1 it is the posture of one of them, unchanged.
        """
        for heading, posture in zip(self._headings, (first, second), strict=True):
            heading.advance(float(posture.turn_rate), dt)
        a, b = self._headings
        (p, p_velocity), (q, q_velocity) = a.seen(first), b.seen(second)
        self._turn = self._followed(p, q)
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
            rotation=multiply(forth, multiply(from_rotation_vector(weight * self._turn), p)),
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
        turn = to_rotation_vector(relative)
        followed = nearest_rotation_vector(turn, self._turn)
        far = np.linalg.norm(followed, axis=-1, keepdims=True) > FARTHEST_TURN
        return np.where(far, turn, followed)
