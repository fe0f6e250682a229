"""Morphing inside a phase-driven network: two loops share one phase, and the network plays their mixture.

Each loop a is known by the states X_a in which it settles: their mean m_a and correlation R_a. The mixture of two has

    m = (1 - mu) m_a + mu m_b,    R = (1 - mu) R_a + mu R_b,    C = R (R + aperture^-2 I)^-1,

V and the readout learned from the states of both together (as one W_out serves all motions in Deliallisi 2017, eq.
3.13), and p = (1 - mu) p_a + mu p_b at a phase that turns once in the mixed period T_a^(1 - mu) T_b^mu. mu = 0 is the
source, mu = 1 the target, beyond them lies extrapolation: there R may lose its sign in some direction, closed by C.

C takes away what belongs to one motion alone, and a mixture moves less or more than both played in step. So its
deviation from its own mean is scaled until its channels move as much as those of both in step do.

Conceptors and scales are prepared for some mu, the knots, and interpolated between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.motion.clip import between_rows
from controller.motion.rotations import Array
from controller.networks.base import Channels
from controller.networks.phase_conceptor.network import PhaseConceptorMotion, PhaseConceptorNetwork
from controller.networks.ridge import affine_ridge
from motiondeck_base.errors import MotiondeckError

RANK = 40  # directions of each motion
APERTURE = 10.0
RIDGE = 1e-2
KNOTS = (0.0, 0.25, 0.5, 0.75, 1.0)
SETTLING_ROUNDS = 2
LARGEST_GAIN = 4.0


@dataclass(frozen=True)
class _Knot:
    """The mixture at one mu, seen in q directions."""

    mu: float
    conceptor: Array  # C, shape (q, q)
    centre: Array  # the mean channels of a round, shape (C,)
    gain: Array  # of each channel's deviation from it, shape (C,)


class PhaseMorph:
    """A phase-driven network that goes over from one loop to another; fits `base.Morph`.

    Preparing it settles the mixture at every knot, which takes some ten ms each: not for a tick. Knots are rising mu,
    and all mu have to lie within them. MotiondeckError if one of the motions is a one-shot, or fewer than two knots are
    given or do not rise. UnknownNameError if there is no such motion. `network` plays the source, or either motion
    after `give_up` and `settle`.
    """

    def __init__(
        self, network: PhaseConceptorNetwork, source: str, target: str, knots: Sequence[float] = KNOTS
    ) -> None:
        for name in (source, target):
            if not network[name].course.loop:
                raise MotiondeckError(f"'{name}' is a one-shot; inside a phase-driven network only loops are mixed")
        if len(knots) < 2 or (np.diff(knots) <= 0.0).any():
            raise MotiondeckError(f"knots {tuple(knots)}: give at least two, rising")
        self._network, self._source, self._target = network, source, target
        self._motions = network[source], network[target]
        reservoir = network.reservoir
        self._phase_weights, self._harmonics_of = reservoir.phase_weights, reservoir.harmonics_of
        states, channels = [*map(_settled, self._motions)], [motion.read() for motion in self._motions]
        means = np.stack([one.mean(0) for one in states])
        centred = [one - mean for one, mean in zip(states, means, strict=True)]
        spans = [np.linalg.svd(one, full_matrices=False)[2][:RANK].T for one in centred]  # principal directions
        basis, _ = np.linalg.qr(np.hstack([*spans, (means[1] - means[0])[:, None]]))
        seen = [one @ basis for one in states]
        following = [network.normalisation.apply(np.roll(one, -1, axis=0)) for one in channels]
        estimate, self._readout = (
            affine_ridge(np.concatenate(seen), np.concatenate(targets), RIDGE) for targets in (following, channels)
        )
        centred = [one - one.mean(0) for one in seen]
        self._correlations = [one.T @ one / network.neurons for one in centred]
        self._means = means @ basis
        self._project = np.ascontiguousarray(basis.T)
        self._recurrent = reservoir.weights @ basis + reservoir.input_weights @ estimate[:, :-1]
        inputs = self._means @ estimate[:, :-1].T + estimate[:, -1]
        self._bias = means @ reservoir.weights.T + inputs @ reservoir.input_weights.T + reservoir.bias
        self._share, self._z = 0.0, np.zeros(basis.shape[1])
        self._knots = [self._knot(mu) for mu in knots]
        self._share = network.phase
        self._z = seen[0][self._motions[0].course.frame_at(self._share)] - self._means[0]

    def advance(self, mu: float, out: Channels) -> None:
        """The next frame, with the share mu of the target, into `out`; MotiondeckError if mu is beyond the knots."""
        knots = self._knots
        if not knots[0].mu <= mu <= knots[-1].mu:
            raise MotiondeckError(f"mu {mu:g} lies outside of the knots from {knots[0].mu:g} to {knots[-1].mu:g}")
        after = next(place for place in range(1, len(knots)) if mu <= knots[place].mu)
        low, high = knots[after - 1], knots[after]
        share = (mu - low.mu) / (high.mu - low.mu)
        self._step(mu, (1.0 - share) * low.conceptor + share * high.conceptor)
        centre = (1.0 - share) * low.centre + share * high.centre
        gain = (1.0 - share) * low.gain + share * high.gain
        out[:] = centre + gain * (self._read(mu) - centre)

    def settle(self) -> None:
        """Leaves the network playing the target alone, at the phase of the mixture."""
        self._network.seek(self._target, self._share)

    def give_up(self) -> None:
        """Leaves it playing the source alone, at the phase of the mixture."""
        self._network.seek(self._source, self._share)

    def _knot(self, mu: float) -> _Knot:
        """The mixture at one mu, its mean and its gain measured on a round after it has settled."""
        first, second = self._correlations
        values, vectors = np.linalg.eigh((1.0 - mu) * first + mu * second)
        values = np.maximum(values, 0.0)
        conceptor = (vectors * (values / (values + APERTURE**-2))) @ vectors.T
        frames = self._frames(mu)
        for _ in range(SETTLING_ROUNDS * frames):
            self._step(mu, conceptor)
        began = self._share
        played = np.empty((frames, len(self._readout)))
        for frame in played:
            self._step(mu, conceptor)
            frame[:] = self._read(mu)
        share = began + np.arange(1, frames + 1) / frames
        source, target = (channels_at(motion, share) for motion in self._motions)
        gain = _activity((1.0 - mu) * source + mu * target) / np.maximum(_activity(played), 1e-9)
        return _Knot(mu, conceptor, played.mean(0), np.clip(gain, 1.0 / LARGEST_GAIN, LARGEST_GAIN))

    def _frames(self, mu: float) -> int:
        source, target = self._motions
        return round(len(source) ** (1.0 - mu) * len(target) ** mu)

    def _step(self, mu: float, conceptor: Array) -> None:
        shares = np.array([1.0 - mu, mu])
        self._share = (self._share + 1.0 / self._frames(mu)) % 1.0
        phases = np.array([self._share * motion.course.whole for motion in self._motions])
        hidden = self._recurrent @ self._z + shares @ self._bias
        hidden += self._phase_weights @ (shares @ self._harmonics_of(phases))
        self._z = conceptor @ (self._project @ np.tanh(hidden) - shares @ self._means)

    def _read(self, mu: float) -> Array:
        state = self._z + (1.0 - mu) * self._means[0] + mu * self._means[1]
        return self._readout[:, :-1] @ state + self._readout[:, -1]


def _settled(motion: PhaseConceptorMotion) -> Array:
    """The states x (T, N) in which a motion settles."""
    stored, z = motion.stored, motion.states.astype(np.float64)
    states = np.empty((len(z), stored.mean.shape[1]))
    for one, (directions, mean) in enumerate(zip(stored.basis, stored.mean, strict=True)):
        own = motion.course.piece == one
        states[own] = mean.astype(np.float64) + z[own] @ directions.T.astype(np.float64)
    return states


def channels_at(motion: PhaseConceptorMotion, share: Array) -> Channels:
    """The channels of a loop at shares (T,) of its round, between frames linearly."""
    channels = motion.read()
    round_of = np.vstack([channels, channels[:1]])
    return between_rows(round_of, np.arange(len(round_of)), share % 1.0 * len(channels))


def _activity(channels: Channels) -> Array:
    """Root mean square change of channels (T, C) from frame to frame, shape (C,)."""
    return np.sqrt(np.square(np.diff(channels, axis=0)).mean(0))
