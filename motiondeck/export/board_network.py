"""A motion of a centralized network as `player.c` evaluates it, instead of keys of what it plays.

    x(f) = rest + unit W Phi(q(f)),   q_i(f) = (cos, sin)(2 pi (turn_i f + start_i)),   Phi_j(q) = exp(form_j (q, 1))

of frame f. W has 16 bits a number, all else 32; responses below exp(LEAST_RESPONSE) are left out.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from controller.motion.rotations import Array
from controller.networks.centralized.centers import pairs_at
from controller.networks.centralized.centralized import CentralizedMotion
from controller.networks.reservoirs.phase_reservoir import Float32

LEAST_RESPONSE = -9.0
MOST_CENTERS = 8


@dataclass(frozen=True, eq=False)
class BoardNetwork:
    """n centers, m satellites, J joints; rad and turns."""

    turns: Float32  # of each center in a frame and at the first, shape (n, 2)
    rest: Float32  # and the unit of the weights, shape (J, 2)
    form: Float32  # shape (m, 2 n + 1)
    weights: Array  # whole numbers, shape (m, J)
    searched = 1  # places or moments that are weighed in a tick (`spread_deck`)

    @classmethod
    def of(cls, motion: CentralizedMotion, rate: float, order: list[int], scale: Array, rest: Array) -> Self:
        """The first channels of a motion, times `scale`, as joints `order` of those that rest at `rest` (J,), rad."""
        form, weights = motion.linear_form
        matrix, rest = np.zeros((len(rest), len(form))), rest.copy()
        matrix[order] = (scale[:, None] * weights[:, :-1])[: len(order)]
        rest[order] = (scale * motion.rest)[: len(order)]
        unit = np.maximum(np.abs(matrix).max(1), 1e-6) / 32767.0
        turns = np.column_stack([motion.frequency / rate, motion.phase % (2.0 * np.pi)]) / (2.0 * np.pi)
        turns, rests, form = (part.astype("<f4") for part in (turns, np.column_stack([rest, unit]), form))
        return cls(turns, rests, form, np.rint(matrix / unit[:, None]).T)

    def drawn(self, frames: int, *, loop: bool) -> Array:
        """The joints of the frames, shape (frames, J), rad."""
        turn, start = 2.0 * np.pi * self.turns.T.astype(np.float64)
        states = pairs_at(turn, start, np.arange(float(frames)))
        exponents = states @ self.form[:, :-1].T + self.form[:, -1]
        response = np.where(exponents < LEAST_RESPONSE, 0.0, np.exp(exponents))
        return self.rest[:, 0] + response @ self.weights * self.rest[:, 1]

    @property
    def words(self) -> bytes:
        """As the player reads it."""
        head = np.array([len(self.turns), len(self.form)], "<u4").tobytes()
        reals = b"".join(part.tobytes() for part in (self.turns, self.rest, self.form))
        return head + reals + np.pad(self.weights, ((0, 0), (0, self.weights.shape[1] % 2))).astype("<i2").tobytes()
