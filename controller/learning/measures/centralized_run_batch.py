"""Many runs of one motion of a centralized network side by side; fits `run_batch.RunBatch`.

What can be disturbed are the two coordinates (q, p / omega) of each center: satellites follow from them at once. As in
`networks/centralized/centralized.py` amplitudes are restored in every step and phases at the end of each round.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.networks.centralized.centralized_frames import CentralizedNetwork

Float32 = NDArray[np.float32]


class CentralizedBatch:
    """R runs of one motion.

    Args:
        network: what plays.
        motion: which motion; all runs start at its beginning.
        runs: R.

    Attributes:
        neurons: the coordinates of the centers, two each.
    """

    def __init__(self, network: CentralizedNetwork, motion: str, runs: int) -> None:
        self._part = network[motion]
        self._dt = 1.0 / network.rate
        self.neurons = 2 * len(self._part.frequency)
        self._time = np.zeros(runs)
        self._centers = self._at(self._time)

    def displace(self, noise: Float32) -> None:
        """(q, p / omega)(0) = s + noise."""
        self._centers += _pairs(noise)

    def advance(self, noise: Float32 | None = None) -> Float32:
        """Turns every center, adds noise, and reads the satellites."""
        part = self._part
        self._time += self._dt
        over = self._time >= part.seconds
        self._time = self._time % part.seconds if part.loop else np.minimum(self._time, part.seconds)
        self._centers *= np.exp(1j * part.frequency * self._dt)
        self._centers[over] = self._at(self._time[over])
        if noise is not None:
            self._centers += _pairs(noise)
        self._centers /= np.abs(self._centers)
        frames = part.satellites.respond(self._centers.view(np.float64)) @ part.matrix.T + part.rest
        return frames.astype(np.float32)

    def _at(self, time: NDArray[np.float64]) -> NDArray[np.complex128]:
        """The centers at times (R,), shape (R, n)."""
        return np.exp(1j * (np.multiply.outer(time, self._part.frequency) + self._part.phase))


def _pairs(noise: Float32) -> NDArray[np.complex128]:
    """Noise (R, 2 n) on (q, p / omega) as complex numbers (R, n)."""
    return noise[:, ::2] + 1j * noise[:, 1::2].astype(np.float64)
