"""Centers: oscillators whose states drive the satellites (Vakulenko et al. 2017, section 2.1).

A harmonic center obeys  q'' + omega^2 q = 0  (eq. 1). Advancing it by the exact rotation

    (q - i p/omega)(t + dt) = exp(i omega dt) (q - i p/omega)(t)

keeps the amplitude for hours, where explicit Euler gains energy at every step.

A nonlinear center obeys  q'' + z f(q) = 0,  q(0) = 0,  p(0) = p0  (eqs 9-11), and z sets its frequency. A change of z
in flight changes the energy too, and the frequency would stay wrong for ever; the term -damping (E - p0^2/2) p leads
back to the orbit that belongs to z.
"""

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

LARGEST_TURN = 0.1  # a step of the splitting integrator turns an oscillator by at most this angle, rad

# Yoshida's composition of three second-order steps into one of fourth order.
_OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_YOSHIDA = (_OUTER, 1.0 - 2.0 * _OUTER, _OUTER)


class FrequencyError(MotiondeckError):
    """A frequency or control parameter that no center can have."""


def require_frequencies(frequency: Array) -> None:
    """Refuses, by a FrequencyError that names the center, frequencies that are not finite and positive."""
    if frequency.ndim != 1:
        raise FrequencyError(f"frequencies of shape {frequency.shape}; one number a center is needed, (n,), rad/s")
    for center, omega in enumerate(frequency):
        if not (np.isfinite(omega) and omega > 0.0):
            raise FrequencyError(f"center {center}: frequency {omega} rad/s is not a positive number")


@dataclass(slots=True)
class HarmonicCenters:
    """n uncoupled harmonic oscillators, advanced exactly."""

    frequency: Array  # angular frequencies omega, shape (n,), rad/s, all > 0
    # q - i p/omega of each center, shape (n,), complex; |state| is the amplitude, its angle the phase.
    state: NDArray[np.complex128]

    @classmethod
    def at_phase(cls, frequency: Array | float, phase: Array | float = 0.0) -> Self:
        """Unit-amplitude centers of frequencies (n,), or of one, at the given phases, rad: shape (n,), or one for all.

        FrequencyError if a frequency is not finite and positive; it names the center.
        """
        frequencies = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        require_frequencies(frequencies)
        return cls(frequencies, np.exp(1j * np.broadcast_to(phase, frequencies.shape)))

    def advance(self, dt: float) -> None:
        """Moves every center dt seconds on (negative dt runs backwards)."""
        self.state *= np.exp((1j * dt) * self.frequency)

    @property
    def coordinates(self) -> Array:
        """The (cos, sin) pair of each center, shape (2 n,): what the satellites see."""
        # A scalar q folds time, because it passes every value twice a period; the pair does not.
        return self.state.view(np.float64)


def pairs_at(frequency: Array, phase: Array, time: Array) -> Array:
    """The coordinates of harmonic centers at times (T,), shape (T, 2 n): cos, sin of each center in turn."""
    return np.exp(1j * (np.multiply.outer(time, frequency) + phase)).view(np.float64)


class Spring(Protocol):
    """The force of a nonlinear center per unit of z, and the frequency that z gives it in closed form."""

    def force(self, q: Array) -> Array:
        """f(q) of eq. 9."""
        ...

    def potential(self, q: Array) -> Array:
        """Its antiderivative F (eq. 11), zero at q = 0."""
        ...

    def least_control(self, momentum: float) -> float:
        """The z below which the start p(0) = momentum no longer swings to and fro."""
        ...

    def orbit(self, control: Array | float, momentum: float) -> tuple[Array, Array]:
        """Frequency, rad/s, and amplitude of q on the orbit of q(0) = 0, p(0) = momentum."""
        ...


@dataclass(frozen=True)
class Pendulum:
    """f(q) = sin q:  omega = pi sqrt(z) / (2 K(k)),  k = p0 / (2 sqrt z),  amplitude 2 asin k."""

    def force(self, q: Array) -> Array:
        return np.sin(q)

    def potential(self, q: Array) -> Array:
        """1 - cos q, written so that small q lose no digits."""
        return 2.0 * np.square(np.sin(0.5 * q))

    def least_control(self, momentum: float) -> float:
        """At z = p0^2 / 4 the pendulum just reaches the top."""
        return 0.25 * momentum**2

    def orbit(self, control: Array | float, momentum: float) -> tuple[Array, Array]:
        """Frequency and amplitude; K is the complete elliptic integral of the first kind."""
        from scipy.special import ellipk

        root = np.sqrt(control)
        modulus = momentum / (2.0 * root)
        return np.pi * root / (2.0 * ellipk(modulus**2)), 2.0 * np.arcsin(modulus)


@dataclass(frozen=True)
class Duffing:
    """f(q) = a q - b q^3; softening for b > 0, hardening for b < 0.

    The orbit is q = A sn(u t, k) with  u^2 = (z a + sqrt(z^2 a^2 - 2 z b p0^2)) / 2,  A = p0 / u,
    k^2 = z b A^2 / (2 u^2)  and  omega = pi u / (2 K(k)); where b < 0 a negative k^2 is meant.
    """

    linear: float = 1.0  # a > 0
    cubic: float = 1.0  # b

    def force(self, q: Array) -> Array:
        return q * (self.linear - self.cubic * np.square(q))

    def potential(self, q: Array) -> Array:
        square = np.square(q)
        return square * (0.5 * self.linear - 0.25 * self.cubic * square)

    def least_control(self, momentum: float) -> float:
        """Below 2 b p0^2 / a^2 a softening spring lets go."""
        return max(0.0, 2.0 * self.cubic * momentum**2 / self.linear**2)

    def orbit(self, control: Array | float, momentum: float) -> tuple[Array, Array]:
        from scipy.special import ellipk

        stiffness = np.multiply(control, self.linear)
        loss = np.multiply(control, self.cubic) * momentum**2
        speed = 0.5 * (stiffness + np.sqrt(np.square(stiffness) - 2.0 * loss))
        rate = np.sqrt(speed)
        return np.pi * rate / (2.0 * ellipk(loss / (2.0 * np.square(speed)))), momentum / rate


def control_for(spring: Spring, frequency: float, momentum: float = 1.0) -> float:
    """The z with which a center swings at a frequency (rad/s) from q(0) = 0, p(0) = momentum: the inverse of eq. 12.

    FrequencyError if the frequency is not positive, or so low that z comes too near to the separatrix.
    """
    # Here and not above: it takes half a second to import, and playing never needs it.
    from scipy.optimize import brentq

    require_frequencies(np.array([frequency]))

    def excess(control: float) -> float:
        return float(spring.orbit(control, momentum)[0]) - frequency

    least = spring.least_control(momentum)
    low = least * (1.0 + 1e-12) if least > 0.0 else 1e-12
    if excess(low) > 0.0:
        raise FrequencyError(f"p0 = {momentum:g} cannot swing as slowly as {frequency:g} rad/s: choose a smaller p0.")
    high = 2.0 * max(low, 1e-6)
    while excess(high) < 0.0:
        high *= 2.0
    return float(brentq(excess, low, high, xtol=1e-300, rtol=np.float64(1e-14)))  # pyright: ignore[reportArgumentType]


@dataclass(slots=True)
class NonlinearCenters:
    """n centers of eq. 9 whose frequency follows their control parameter."""

    spring: Spring  # f, F and the closed form of the frequency
    control: Array  # z of each center, shape (n,), above `spring.least_control(momentum)`
    momentum: float  # p0 > 0 of eq. 10, which fixes the energy p0^2 / 2 of every orbit
    damping: float  # rate of the return to the orbit's energy, >= 0
    q: Array  # the state, shape (n,)
    p: Array  # of the same shape

    @classmethod
    def at_rest(cls, spring: Spring, control: Array | float, momentum: float = 1.0, damping: float = 1.0) -> Self:
        """Centers with control parameters (n,), or one, at q = 0, p = p0 (eq. 10); FrequencyError names a bad one."""
        controls = np.atleast_1d(np.asarray(control, dtype=np.float64))
        centers = cls(spring, controls, momentum, damping, np.zeros(len(controls)), np.full(len(controls), momentum))
        centers.set_control(controls)
        return centers

    def set_control(self, control: Array) -> None:
        """Changes z in flight; the energy term leads each center to its new orbit. FrequencyError names a bad one."""
        least = self.spring.least_control(self.momentum)
        for center, z in enumerate(control):
            if not (np.isfinite(z) and z > least):
                raise FrequencyError(f"center {center}: z = {z} gives no oscillation; it must be above {least:g}")
        self.control = control

    @property
    def frequency(self) -> Array:
        """omega(z) of each center, shape (n,), rad/s."""
        return self.spring.orbit(self.control, self.momentum)[0]

    @property
    def energy(self) -> Array:
        """E of each center (eq. 11), shape (n,)."""
        return 0.5 * np.square(self.p) + self.control * self.spring.potential(self.q)

    @property
    def coordinates(self) -> Array:
        """(q / amplitude, -p / p0) of each center, shape (2 n,): of unit size whatever z is."""
        # Unscaled, q would shrink as z grows, out of the reach of the satellites.
        amplitude = self.spring.orbit(self.control, self.momentum)[1]
        return np.stack([self.q / amplitude, -self.p / self.momentum], axis=-1).ravel()

    def advance(self, dt: float) -> None:
        """Moves every center dt seconds on: fourth-order splitting, the energy term solved exactly in between."""
        fastest = float(np.sqrt(np.max(self.control) * max(1.0, abs(float(self.spring.force(np.array(1e-6))) / 1e-6))))
        steps = max(1, int(np.ceil(abs(dt) * fastest / LARGEST_TURN)))
        h = dt / steps
        for _ in range(steps):
            self._settle(0.5 * h)
            for share in _YOSHIDA:
                self.q = self.q + 0.5 * share * h * self.p
                self.p = self.p - share * h * self.control * self.spring.force(self.q)
                self.q = self.q + 0.5 * share * h * self.p
            self._settle(0.5 * h)

    def _settle(self, h: float) -> None:
        """Solves p' = -damping (p^2/2 + c) p for h seconds: a logistic equation in p^2, stable for every h >= 0."""
        c = self.control * self.spring.potential(self.q) - 0.5 * self.momentum**2
        x = -2.0 * self.damping * h * c
        # (1 - exp(-x)) / x tends to 1 where c does to 0.
        shrink = np.where(np.abs(x) < 1e-12, 1.0, np.expm1(x) / np.where(x == 0.0, 1.0, x))
        self.p = self.p * np.exp(0.5 * x) / np.sqrt(1.0 + self.damping * h * np.square(self.p) * shrink)
