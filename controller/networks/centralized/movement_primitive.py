"""Movement primitives: several demonstrations of one motion as mean and spread, bent at run time through via points.

Satellites are driven by a phase that goes from 0 to 1 (Vakulenko et al. 2017, eq. 2); each of N demonstrations is one
W. Their mean is the motion and their deviations say how channels and phases vary together (Paraschos et al. 2013):

    mean   y(phi) = rest + W Phi(phi),    cov(y_c(phi), y_d(psi)) = sum_i dev_i,c(phi) dev_i,d(psi) / (N - 1)
                                                       + (c = d) bend_c^2 exp(-(phi - psi)^2 / (2 REACH^2))

A motion that has to pass through points is the conditional distribution given these. What was demonstrated to vary
together moves together; the second term lets a motion reach a point that no mixture of demonstrations does, by bending
it near there.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from controller.motion.rotations import Array
from controller.networks.centralized.centers import pairs_at
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.signals import number_within, points
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import counted

REACH = 0.1  # of a bend on either side, in phase


@dataclass(frozen=True, eq=False)
class ViaPoints:
    """Points that a motion passes through: the value of one channel at one phase each; shape (V,)."""

    phase: Array
    channel: NDArray[np.int64]
    value: Array
    deviation: Array  # standard deviation that is allowed


NOWHERE = ViaPoints(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class MovementPrimitive:
    """A motion of D channels that was demonstrated N times."""

    frequency: Array  # angular frequency of its centers, shape (n,), rad per unit of phase
    start: Array  # phase of its centers, shape (n,), rad
    satellites: GaussianSatellites  # m of them, in the 2 n coordinates of the centers
    weights: Array  # of each demonstration, shape (N, D, m)
    rest: Array  # shape (D,)
    bend: Array  # standard deviation of a channel beyond the demonstrations, shape (D,)
    seconds: Array  # of each demonstration, shape (N,)
    via: ViaPoints = NOWHERE  # points that it passes through

    def __repr__(self) -> str:
        demonstrations, channels = self.weights.shape[:2]
        via = f", through {counted(len(self.via.phase), 'given value')}" if len(self.via.phase) else ""
        shown = f"{counted(demonstrations, 'demonstration')} of {counted(channels, 'channel')}"
        return f"<movement primitive: {shown}{via}>"

    def mean(self, phase: ArrayLike) -> Array:
        """The motion at phases (T,) in [0, 1], shape (T, D)."""
        phase = points(phase, "a phase", 0.0, 1.0)
        found = self._demonstrated(phase).mean(0)
        if len(self.via.phase):
            found += np.einsum("tdv,v->td", self._covariance_with_via(phase), self._pull)
        return found

    def spread(self, phase: ArrayLike) -> Array:
        """The standard deviation of each channel at phases (T,), shape (T, D)."""
        phase = points(phase, "a phase", 0.0, 1.0)
        variance = np.square(self._deviations(phase)).sum(0) + np.square(self.bend)
        if len(self.via.phase):
            from scipy.linalg import cho_solve

            with_via = self._covariance_with_via(phase)
            solved = cho_solve(self._factor, with_via.reshape(-1, with_via.shape[2]).T).T.reshape(with_via.shape)
            variance -= (with_via * solved).sum(2)
        return np.sqrt(np.maximum(variance, 0.0))

    def play(self, rate: float, seconds: float | None = None) -> Array:
        """The motion at a rate in Hz, as long as the demonstrations on average or as long as is said, shape (T, D)."""
        lasts = float(self.seconds.mean()) if seconds is None else seconds
        if not (lasts > 0.0 and rate > 0.0):
            raise MotiondeckError(f"{lasts:g} s at {rate:g} Hz cannot be played; both have to be above 0")
        return self.mean(np.linspace(0.0, 1.0, max(2, round(lasts * rate) + 1)))

    def through(
        self, phase: float, point: ArrayLike, *, channels: ArrayLike | None = None, deviation: float = 0.0
    ) -> Self:
        """The motion through one point more, at a phase in [0, 1]: a value for each of the channels (default: all).

        `deviation` is the standard deviation that is allowed, in their unit. MotiondeckError if the phase, a channel or
        a number makes no sense.
        """
        phase = number_within(phase, "the phase of a point", 0.0, 1.0)
        deviation = number_within(deviation, "the deviation of a point", 0.0, 1e12)
        last = len(self.rest) - 1
        chosen = np.arange(last + 1) if channels is None else np.atleast_1d(np.asarray(channels))
        if chosen.dtype.kind not in "iu" or chosen.ndim != 1 or not ((chosen >= 0) & (chosen <= last)).all():
            raise MotiondeckError(f"channels {chosen.tolist()}; give whole numbers from 0 to {last}")
        value = points(point, "a point")
        if len(value) != len(chosen):
            raise MotiondeckError(f"a point of {len(value)} values; {len(chosen)} are needed, one for each channel")
        known = self.via.phase, self.via.channel, self.via.value, self.via.deviation
        more = np.full(len(chosen), phase), chosen, value, np.full(len(chosen), deviation)
        grown: list[NDArray[Any]] = [np.append(old, new) for old, new in zip(known, more, strict=True)]
        return replace(self, via=ViaPoints(*grown))

    def ending_at(self, point: ArrayLike, *, deviation: float = 0.0) -> Self:
        """The same motion with another end; see `through`."""
        return self.through(1.0, point, deviation=deviation)

    def _demonstrated(self, phase: Array) -> Array:
        """Each demonstration as the satellites say it, shape (N, T, D)."""
        response = self.satellites.respond(pairs_at(self.frequency, self.start, phase))
        return np.einsum("tm,idm->itd", response, self.weights) + self.rest

    def _deviations(self, phase: Array) -> Array:
        """Each demonstration less their mean, over the root of N - 1, shape (N, T, D)."""
        each = self._demonstrated(phase)
        return (each - each.mean(0)) / np.sqrt(max(1, len(each) - 1))

    def _covariance_with_via(self, phase: Array) -> Array:
        """Of every channel at phases (T,) with every via point, shape (T, D, V)."""
        via = self.via
        at_via = self._deviations(via.phase)[:, np.arange(len(via.phase)), via.channel]
        together = np.einsum("itd,iv->tdv", self._deviations(phase), at_via)
        near = np.exp(-0.5 * np.square(np.subtract.outer(phase, via.phase) / REACH))
        together[:, via.channel, np.arange(len(via.phase))] += near * np.square(self.bend[via.channel])
        return together

    @cached_property
    def _factor(self) -> tuple[Array, bool]:
        from scipy.linalg import cho_factor  # slow to import, and nothing that plays needs it

        via, steps = self.via, np.arange(len(self.via.phase))
        covariance = self._covariance_with_via(via.phase)[steps, via.channel, :]
        size = np.square(self.bend[via.channel])
        covariance[steps, steps] += np.square(via.deviation) + 1e-9 * np.maximum(size, 1e-12)
        return cho_factor(covariance, lower=True)

    @cached_property
    def _pull(self) -> Array:
        from scipy.linalg import cho_solve

        via = self.via
        there = self._demonstrated(via.phase).mean(0)[np.arange(len(via.phase)), via.channel]
        return cho_solve(self._factor, via.value - there)
