"""Arms of three servos: pitch, roll and elbow that best match the directions of a human's upper arm and forearm.

    upper arm = Ry(pitch) Rx(roll) (0, 0, -1),   forearm = Ry(pitch) Rx(roll) (sin elbow, 0, -cos elbow)

Three servos cannot give four angles of directions: without a turn about the upper arm, the forearm bends ahead only.
The angles, within their ranges, maximise

    upper . Ry(pitch) Rx(roll) (0, 0, -1) + FOREARM fore . Ry(pitch) Rx(roll) (sin elbow, 0, -cos elbow)

One angle after another has a closed form (coordinate ascent); far from the maximum, other pitches are tried.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin, sqrt

Vector = Sequence[float]

FOREARM, ROUNDS, FIRST_ROUNDS = 0.85, 3, 40  # weight of the forearm beside the upper arm; rounds in a tick and at first
UNCERTAIN = 1e-3  # an arm stretched out sideways has no pitch
# Missing part of the maximum from which other pitches are tried, and the share of it that is better.
FAR_OFF, BETTER = 0.1, 0.5


class ThreeServoArm:
    """One arm whose angles have ranges; pitch, roll and elbow in this order, rad."""

    def __init__(self, lower: Vector, upper: Vector) -> None:
        """Args: the ends of their ranges."""
        self._pitch, self._roll, self._elbow = [(low, high) for low, high in zip(lower, upper, strict=True)]

    def first(self, upper: Vector, fore: Vector) -> tuple[float, float, float]:
        """As `fit`, from the plane of the bent arm, which faces ahead along Ry(pitch) (1, 0, 0)."""
        (x, y, z), (fx, fy, fz) = upper, fore
        along = x * fx + y * fy + z * fz
        pitch = atan2(-x - FOREARM * (fz - along * z), -z + FOREARM * (fx - along * x))
        ax, ay, az = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
        return self.fit(upper, fore, pitch, atan2(sqrt(ax * ax + ay * ay + az * az), along), FIRST_ROUNDS)

    def fit(
        self, upper: Vector, fore: Vector, pitch: float, elbow: float, rounds: int = ROUNDS
    ) -> tuple[float, float, float]:
        """The best pitch near another one, its certainty, 0 to 1, and the elbow for it."""
        (x, _, z), (fx, _, fz) = upper, fore
        certain = 0.0
        for _ in range(rounds):
            roll, elbow = self.at_pitch(upper, fore, pitch, elbow)
            upper_down = -cos(roll)
            ahead, down = sin(elbow), cos(elbow) * upper_down
            sine = upper_down * x + FOREARM * (down * fx - ahead * fz)
            cosine = upper_down * z + FOREARM * (down * fz + ahead * fx)
            certain = min(hypot(sine, cosine), 1.0)
            if certain < UNCERTAIN:
                break
            pitch = atan2(sine, cosine)
        return pitch, certain, elbow

    def at_pitch(self, upper: Vector, fore: Vector, pitch: float, elbow: float) -> tuple[float, float]:
        """The best roll at a pitch and elbow, and then the best elbow."""
        (x, y, z), (fx, fy, fz) = upper, fore
        c, s = cos(pitch), sin(pitch)
        up, fore_ahead, fore_up = s * x + c * z, c * fx - s * fz, s * fx + c * fz
        share = FOREARM * cos(elbow)
        # An arm does not go over the shoulder.
        roll = atan2(y + share * fy, max(-up - share * fore_up, 0.5 * hypot(x, z)))
        roll = min(max(roll, self._roll[0]), self._roll[1])
        elbow = atan2(fore_ahead, sin(roll) * fy - cos(roll) * fore_up)
        return roll, min(max(elbow, self._elbow[0]), self._elbow[1])

    def elsewhere(self, upper: Vector, fore: Vector, pitch: float, elbow: float) -> float | None:
        """A much better pitch within its range, for an arm that is far off at this one, or None."""
        missing = self._missing(upper, fore, pitch, elbow)
        if missing < FAR_OFF:
            return None
        found, least, (low, high) = None, BETTER * missing, self._pitch
        for quarter in (1, 2, 3):
            goal, _, elbow = self.fit(upper, fore, pitch + 0.5 * pi * quarter, 0.5)
            goal += 2.0 * pi * round((0.5 * (low + high) - goal) / (2.0 * pi))
            missing = self._missing(upper, fore, goal, elbow)
            if missing < least and low <= goal <= high:
                found, least = goal, missing
        return found

    def _missing(self, upper: Vector, fore: Vector, pitch: float, elbow: float) -> float:
        roll, elbow = self.at_pitch(upper, fore, pitch, elbow)
        (x, y, z), (fx, fy, fz) = upper, fore
        c, s = cos(pitch), sin(pitch)
        sideways, down, bent, straight = sin(roll), -cos(roll), sin(elbow), cos(elbow)
        alike = sideways * y + down * (s * x + c * z)
        alike += FOREARM * (bent * (c * fx - s * fz) + straight * (sideways * fy + down * (s * fx + c * fz)))
        return 1.0 + FOREARM - alike
