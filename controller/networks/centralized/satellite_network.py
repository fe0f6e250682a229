"""Centers that drive satellites of any kind: a signal in continuous time (Vakulenko et al. 2017, eqs 1 - 6).

    x(t) = rest + W Phi(q(t))                                                                                   (eq. 2)

Phi may be Gaussian, harmonic or polynomial, q the coordinates of harmonic, Duffing or pendulum centers. The motions
of a library are `centralized.CentralizedMotion`: harmonic centers and Gaussian satellites that learning has placed.
"""

from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from controller.networks.centralized.centers import HarmonicCenters, NonlinearCenters
from controller.networks.centralized.satellites import GaussianSatellites, Satellites, grid_places
from controller.networks.ridge import ridge
from controller.networks.signals import sampling_rate, time_series, whole_number
from motiondeck_base.errors import MotiondeckError

GRID = 36

Centers = HarmonicCenters | NonlinearCenters


@dataclass(eq=False)
class SatelliteNetwork:
    """A signal of D channels from m satellites."""

    centers: Centers  # in their present state; change their frequency or control parameter to change the tempo
    satellites: Satellites  # functions of the centers' coordinates
    weights: Array  # W, shape (D, m)
    rest: Array  # shape (D,)

    @property
    def now(self) -> Array:
        """The signal where the centers are, shape (D,)."""
        return self.weights @ self.satellites.respond(self.centers.coordinates) + self.rest

    def step(self, dt: float) -> Array:
        """Goes dt seconds on; the signal there, shape (D,)."""
        self.centers.advance(dt)
        return self.now

    def run(self, steps: int, dt: float) -> Array:
        """The signal now and at the next steps of dt seconds, shape (steps, D); MotiondeckError unless steps >= 1."""
        steps = whole_number(steps, "steps", 1)
        return np.array([self.now] + [self.step(dt) for _ in range(steps - 1)])


def learn_weights(
    signal: Array,
    rate: float,
    centers: Centers | None = None,
    satellites: Satellites | None = None,
    regulariser: float = 1e-6,
) -> SatelliteNetwork:
    """The network whose satellites, driven by centers from where they are, follow a signal (T, D) best.

    The rate is in Hz. Only W and the rest are learned: the centers, by default one that turns once, are not moved; the
    satellites are by default GRID Gaussian ones on a grid. `regulariser` is that of the ridge regression, as a share of
    the number of frames. MotiondeckError if the signal is not of that shape, holds a number that is not finite, the
    rate is none, or the satellites do not fit the centers.
    """
    signal, rate = time_series(signal, "the signal"), sampling_rate(rate)
    if centers is None:
        centers = HarmonicCenters.at_phase(2.0 * np.pi * rate / len(signal))
    if satellites is None:
        satellites = GaussianSatellites(grid_places(len(centers.coordinates), GRID))
    driven = deepcopy(centers)
    states = []
    for _ in range(len(signal)):
        states.append(driven.coordinates.copy())
        driven.advance(1.0 / rate)
    try:
        response, rest = satellites.respond(np.array(states)), signal.mean(0)
    except ValueError:
        seen = len(driven.coordinates)
        raise MotiondeckError(f"the centers have {seen} coordinates, and the satellites take another number") from None
    weights = ridge(response, signal - rest, regulariser * len(signal))
    return SatelliteNetwork(deepcopy(centers), satellites, weights, rest)
