"""The capture point of a body that is carried by a few points on the floor, its plan, and its lasting error.

While the centre of mass c stays about as high, h, the divergent component of its motion is the capture point

    xi = c + c' / omega,   omega^2 = g / h,        xi' = omega (xi - p)                                         (1)

with the centre of pressure p (Pratt et al. 2006, Takenaka et al. 2009). It runs away from p, so only one xi(t) stays
with a p that is known for all times to come: the mean of p, weighted exponentially,

    xi(t) = omega integral from t of  e^(-omega (s - t)) p(s) ds                                                 (2)

Between knots (t_k, p_k), p is linear, with the slopes m_k, and stays where it is after the last one. Then (2) is

    xi(t) = p(t) + sum over k of  m_k / omega (e^(-omega (t_k - t)) - e^(-omega (t_k+1 - t)))                    (3)

summed over what is to come. The centre of mass follows by itself:

    c' = omega (xi - c)                                                                                          (4)
"""

import numpy as np

from controller.motion.rotations import Array
from sim.models.gravity import GRAVITY

LEARNS, TAKES = 0.5, 0.25  # learning rate of a lasting error, 1/s, and time constant of the error on each foot, s
BIG, LEARNED = 0.03, 0.12  # largest error that counts, and largest learned one, in heights of the root


def pendulum_rate(height: float) -> float:
    """omega, 1/s, for a height of the centre of mass, m."""
    return float(np.sqrt(GRAVITY / max(height, 0.05)))


def planned_capture_point(times: Array, pressure: Array, now: float, omega: float) -> Array:
    """Equation (3): the planned capture point (...), m, for centres of pressure (K, ...), m, at ascending times (K,).

    The first one is not after `now`, s; omega in 1/s.
    """
    after = int(np.searchsorted(times, now, side="right"))
    if after == len(times):
        return pressure[-1].astype(np.float64)
    past = (now - times[after - 1]) / (times[after] - times[after - 1])
    here = pressure[after - 1] + past * (pressure[after] - pressure[after - 1])
    knots = np.concatenate([[now], times[after:]])
    length = np.maximum(np.diff(knots), 1e-9)
    share = np.exp(-omega * (knots[:-1] - now)) * -np.expm1(-omega * length) / (omega * length)
    return here + share @ np.diff(np.concatenate([here[None], pressure[after:]]), axis=0)


def follow(centre: Array, capture_point: Array, dt: float, omega: float) -> Array:
    """Equation (4): the centre of mass (2,) dt seconds later, of a capture point (2,) that hardly moves meanwhile."""
    return capture_point + np.exp(-omega * dt) * (centre - capture_point)


def run_away(capture_point: Array, pressure: Array, seconds: float, omega: float) -> Array:
    """Equation (1): where a capture point (2,) is some seconds later if the centre of pressure (2,) stays."""
    return pressure + np.exp(omega * seconds) * (capture_point - pressure)


class LastingError:
    """The mean error of the capture point, ahead and left of the heading: from a slope, a load or a leaning sensor.

    An error that changes sides with the feet, however slow the steps, does not last, and a push soon passes. So the
    error e is smoothed on each foot, by its share s_i of the weight, and the mean of the two feet is integrated:

        e_i' = s_i / TAKES (e - e_i),      b' = LEARNS (e_1 + e_2) / 2                                           (16)
    """

    def __init__(self, height: float, dt: float) -> None:
        """Args: height of the root, m; the tick, s."""
        self._dt, self._big, self._most = dt, BIG * height, LEARNED * height
        self._feet, self._learned = np.zeros((2, 2)), np.zeros(2)

    def learn(self, off: Array, standing: Array) -> Array:
        """The learned error (2,), m, after a tick with the error `off` (2,), m, and the shares (2,) of the feet."""
        shares = min(1.0, self._dt / TAKES) * standing
        self._feet += shares[:, None] * (np.clip(off, -self._big, self._big) - self._feet)
        self._learned += LEARNS * self._dt * self._feet.mean(axis=0)
        np.clip(self._learned, -self._most, self._most, out=self._learned)
        return self._learned
