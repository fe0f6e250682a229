"""The course of a motion: where its bones lead and how the body moves along, all that a fade must know of a target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.motion.posture import Posture
from controller.motion.rotations import Array, rotate
from controller.motion.skeleton import Skeleton


@dataclass(frozen=True)
class BodyCourse:
    """A body at S moments, seen from its own heading, in one array, so that times between them are found at once.

    Attributes:
        rows: of each moment the vector along each bone, m, the height, m, the velocity, m/s, and the turn rate, rad/s,
            shape (S, 3 B + 4).
    """

    rows: Array

    @classmethod
    def of(cls, posture: Posture, skeleton: Skeleton) -> BodyCourse:
        """The course of postures (S, ...)."""
        bones = rotate(posture.rotation[:, 1:], skeleton.rest_direction * skeleton.length[:, None])
        moving = np.column_stack([posture.height, posture.velocity, posture.turn_rate])
        return cls(np.concatenate([bones.reshape(len(bones), -1), moving], axis=1))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def bones(self) -> Array:
        """The vectors along the bones, shape (S, B, 3), m."""
        return self.rows[:, :-4].reshape(len(self.rows), -1, 3)

    @property
    def height(self) -> Array:
        """Of the root above the ground, shape (S,), m."""
        return self.rows[:, -4]

    @property
    def velocity(self) -> Array:
        """Of the root along the ground, forward and left, shape (S, 2), m/s."""
        return self.rows[:, -3:-1]

    @property
    def turn_rate(self) -> Array:
        """Of the heading, about the vertical, shape (S,), rad/s."""
        return self.rows[:, -1]

    def at(self, place: Array, rate: Array, *, loop: bool) -> BodyCourse:
        """The course at places (S,) counted in moments, played at these rates (S,), 1 being its own.

        A loop goes round, any other stays at its ends.
        """
        low = np.floor(place).astype(np.int64)
        mode = "wrap" if loop else "clip"
        first, second = self.rows.take(low, 0, mode=mode), self.rows.take(low + 1, 0, mode=mode)
        rows = first + (place - low)[:, None] * (second - first)
        rows[:, -3:] *= rate[:, None]
        return BodyCourse(rows)
