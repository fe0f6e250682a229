"""What comes next: the motions that a centralized network knows are laid beside the last fraction of a second.

Each motion is compared at many phases and tempos (its frequencies scaled); the few that fit best go on, each from where
the body really is: the difference to it fades within FORGET seconds, that in velocity within FORGET_VELOCITY.

What is seen may be like nothing that the network knows. How far it is to be trusted then is learned from the network
itself: each of its motions is predicted from the others alone, and at each distance from the nearest known moment the
least squares tell how much of the network's movement, and of the last velocity, comes true (`Trust`). The rest of the
prediction is the last pose, held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from controller.library.motion_library import MotionLibrary
from controller.measures.motion_matching import joint_features
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.rotations import Array
from motiondeck_base.errors import MotiondeckError

RATE = 60.0
PAST_FRAMES = 24
AHEAD_FRAMES = 30
LOOK_EVERY = 3
PHASES_A_SECOND = 30.0
TEMPOS = (0.75, 0.87, 1.0, 1.15, 1.33)
VOICES = 8
FORGET, FORGET_VELOCITY = 0.4, 0.06
VELOCITY_FRAMES = 4
TRIALS_A_SECOND = 10.0  # of each motion, predicted from the others
TRUST_LEVELS = 4  # distances, each with as many of these trials


@dataclass(frozen=True)
class Trust:
    """How much of a prediction comes true, by how far what is seen is from what is known.

    Attributes:
        distance: shape (L,), mm, rising from 0, where the network is trusted fully.
        network: share of the network's movement at each frame ahead, shape (L, AHEAD_FRAMES); it never rises.
        velocity: share of the movement at the last velocity, shape (L, AHEAD_FRAMES).
    """

    distance: Array
    network: Array
    velocity: Array

    @classmethod
    def learn(cls, distance: Array, network: Array, velocity: Array, came: Array) -> Trust:
        """From trials: their distances (T,) and what was predicted and came, less the last pose, (T, frames, F)."""
        if not len(distance):
            return cls(np.zeros(1), np.ones((1, AHEAD_FRAMES)), np.zeros((1, AHEAD_FRAMES)))
        order = np.argsort(distance)
        levels = [these for these in np.array_split(order, TRUST_LEVELS) if len(these)]
        shares = np.zeros((len(levels), AHEAD_FRAMES, 2))
        for frame in range(AHEAD_FRAMES):

            def fitted(these: NDArray[np.intp], frame: int = frame) -> Array:
                ways = np.stack([network[these, frame].ravel(), velocity[these, frame].ravel()], axis=-1)
                return np.minimum(nnls(ways, came[these, frame].ravel())[0], 1.0)

            # What is further away is not known better: levels where it seems so are taken together.
            pools = [([level], fitted(these)) for level, these in enumerate(levels)]
            while (worse := next((k for k in range(1, len(pools)) if pools[k][1][0] > pools[k - 1][1][0]), 0)) > 0:
                joined = pools[worse - 1][0] + pools[worse][0]
                pools[worse - 1 : worse + 1] = [(joined, fitted(np.concatenate([levels[k] for k in joined])))]
            for these, share in pools:
                shares[these, frame] = share
        known = np.concatenate([[0.0], [float(np.median(distance[these])) for these in levels]])
        full = np.broadcast_to([1.0, 0.0], (1, AHEAD_FRAMES, 2))
        together = np.concatenate([full, shares])
        return cls(known, together[:, :, 0], together[:, :, 1])

    def at(self, distance: float) -> tuple[Array, Array]:
        """The shares of network and velocity at a distance, each (AHEAD_FRAMES,); beyond the last the network fades."""
        beyond = min(1.0, float(self.distance[-1]) / distance) if len(self.distance) > 1 and distance > 0.0 else 1.0
        level = float(np.interp(distance, self.distance, np.arange(len(self.distance))))
        below, share = int(level), level - int(level)
        above = min(below + 1, len(self.distance) - 1)
        network, velocity = ((1 - share) * part[below] + share * part[above] for part in (self.network, self.velocity))
        return beyond * network, velocity


class Anticipator:
    """Predicts the joints for the next half second.

    Args:
        library: whose motions are expected; its network must be a centralized one. The trust of one with a single
            motion cannot be learned; it is full.

    Raises:
        MotiondeckError: if it is not.
    """

    def __init__(self, library: MotionLibrary) -> None:
        network = library.network
        if not isinstance(network, CentralizedNetwork):
            raise MotiondeckError(
                f"library '{library.info.name}' holds a {library.info.network} network; this needs a centralized one"
            )
        self.encoding = library.encoding
        steps = np.arange(1 - PAST_FRAMES, AHEAD_FRAMES + 1) / RATE
        seen, coming, own = [], [], []
        for index, name in enumerate(network.motions):
            part = network.part(name)
            for phase in np.arange(0.0, part.seconds, 1.0 / PHASES_A_SECOND):
                time = phase + np.multiply.outer(TEMPOS, steps)
                time = time % part.seconds if part.loop else time
                features = joint_features(self.encoding, part.at(time.ravel())).reshape(*time.shape, -1)
                seen.append(features[:, :PAST_FRAMES:LOOK_EVERY])
                coming.append(features[:, PAST_FRAMES - 1 :])
                own.append(np.full(len(TEMPOS), index))
        self._seen = np.concatenate(seen).reshape(-1, seen[0].shape[1] * seen[0].shape[2])
        self._square = np.square(self._seen).sum(1)
        self._coming, self._own = np.concatenate(coming), np.concatenate(own)
        self.trust = self._learn_trust(network)

    def __call__(self, past: Array) -> Array:
        """The next AHEAD_FRAMES frames at RATE after the last PAST_FRAMES, shape (PAST_FRAMES, F) to (AHEAD_FRAMES, F).

        Both are `joint_features`, mm.
        """
        network, distance = self.by_network(past)
        of_network, of_velocity = self.trust.at(distance)
        held, time = past[-1], np.arange(1, AHEAD_FRAMES + 1) / RATE
        return held + of_network[:, None] * (network - held) + np.multiply.outer(of_velocity * time, _velocity(past))

    def by_network(self, past: Array, without: int = -1) -> tuple[Array, float]:
        """As the motions of the network go on, trusted fully, and how far the nearest of them was, mm.

        Args:
            past: as above.
            without: the number of a motion that has no say.
        """
        asked = past[::LOOK_EVERY].ravel()
        distance = np.maximum(self._square - 2.0 * self._seen @ asked + asked @ asked, 1e-9)
        distance[self._own == without] = np.inf
        best = np.argsort(distance)[:VOICES]
        share = (1.0 / distance[best]) / (1.0 / distance[best]).sum()
        going = np.tensordot(share, self._coming[best], 1)
        time = np.arange(1, AHEAD_FRAMES + 1)[:, None] / RATE
        off = past[-1] - going[0]
        off_velocity = _velocity(past) - (going[1] - going[0]) * RATE
        predicted = going[1:] + off * np.exp(-time / FORGET) + off_velocity * time * np.exp(-time / FORGET_VELOCITY)
        return predicted, float(np.sqrt(distance[best[0]] / len(asked)))

    def _learn_trust(self, network: CentralizedNetwork) -> Trust:
        """From each motion, predicted by the others."""
        steps, time = (
            np.arange(1 - PAST_FRAMES, AHEAD_FRAMES + 1) / RATE,
            np.arange(1, AHEAD_FRAMES + 1)[:, None] / RATE,
        )
        distances, by_network, by_velocity, came = [], [], [], []
        for index, name in enumerate(network.motions if len(network.motions) > 1 else ()):
            part = network.part(name)
            for phase in np.arange(0.0, part.seconds, 1.0 / TRIALS_A_SECOND):
                at = phase + steps
                features = joint_features(self.encoding, part.at(at % part.seconds if part.loop else at))
                past, coming = features[:PAST_FRAMES], features[PAST_FRAMES:]
                predicted, distance = self.by_network(past, without=index)
                distances.append(distance)
                by_network.append(predicted - past[-1])
                by_velocity.append(_velocity(past) * time)
                came.append(coming - past[-1])
        return Trust.learn(np.array(distances), np.array(by_network), np.array(by_velocity), np.array(came))


@dataclass(frozen=True)
class Foresight:
    """How far off predictions were, mean absolute error of a coordinate in mm.

    Attributes:
        ahead_s: how far ahead.
        anticipated: by the network's motions as far as they are trusted.
        network: by the network's motions alone.
        hold: by holding the last pose.
        velocity: by going on at the last velocity.
        trust: the mean share that the network has in what is anticipated.
    """

    ahead_s: float
    anticipated: float
    network: float
    hold: float
    velocity: float
    trust: float


def foresight(anticipator: Anticipator, channels: Array, rate: float, every_s: float = 0.1) -> list[Foresight]:
    """Predicts a recording (T, C) again and again from its own past, and measures how well, for 0.1 to 0.5 s ahead.

    Raises:
        MotiondeckError: if it is too short or its rate does not fit.
    """
    stride = max(1, round(rate / RATE))
    if abs(rate / stride - RATE) > 0.05 * RATE:
        raise MotiondeckError(f"{rate:g} frames a second cannot be thinned to {RATE:g}")
    features = joint_features(anticipator.encoding, channels)[::stride]
    starts = np.arange(PAST_FRAMES, len(features) - AHEAD_FRAMES, max(1, round(every_s * RATE)))
    if not len(starts):
        raise MotiondeckError(
            f"a recording of {len(channels) / rate:.2f} s is too short to predict half a second of it"
        )
    time = np.arange(1, AHEAD_FRAMES + 1)[:, None] / RATE
    missed, trusted = np.zeros((4, AHEAD_FRAMES)), np.zeros(AHEAD_FRAMES)
    for start in starts:
        past, came = features[start - PAST_FRAMES : start], features[start : start + AHEAD_FRAMES]
        network, distance = anticipator.by_network(past)
        ways = (anticipator(past), network, past[-1], past[-1] + _velocity(past) * time)
        missed += [np.abs(predicted - came).mean(1) for predicted in ways]
        trusted += anticipator.trust.at(distance)[0]
    rows = np.vstack([missed, trusted]) / len(starts)
    at = [round(ahead * RATE) - 1 for ahead in (0.1, 0.2, 0.3, 0.4, 0.5)]
    return [Foresight((k + 1) / RATE, *(float(value) for value in rows[:, k])) for k in at]


def _velocity(past: Array) -> Array:
    """Of the last frames, a second."""
    return (past[-1] - past[-1 - VELOCITY_FRAMES]) * RATE / VELOCITY_FRAMES
