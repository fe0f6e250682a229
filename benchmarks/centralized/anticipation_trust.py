"""How far a prediction is trusted: what the network says, the last velocity, and for the rest the last pose, held.

`Trust` knows it from the library, `Experience` from what came true of earlier predictions of the same recording: where
velocity and pose did better without the network, the network loses its say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from controller.motion.rotations import Array

RATE = 60.0  # Hz
AHEAD_FRAMES = 30
TRUST_LEVELS = 4  # distances, each with as many of the trials
PRIOR_TRIALS = 2.0  # for so many predictions of a recording the trust from the library counts
PRIOR_ALONE = 8.0  # for so many its share of the last velocity alone
CAUTION = 3.0
EAGERNESS = 2.0
SEEN_AHEAD = 9  # so many frames ahead the velocity alone is tried before the first prediction
DAMPING_S = 0.15  # in which a velocity falls to 1/e


@dataclass(frozen=True)
class Trust:
    """How much of a prediction comes true, by how far what is seen is from what is known.

    Attributes:
        distance: shape (L,), mm, rising from 0, where the network is trusted fully.
        network: share of the network's movement at each frame ahead, shape (L, AHEAD_FRAMES); it never rises.
        velocity: share of the movement at the last velocity, shape (L, AHEAD_FRAMES).
        alone: the same where the network has no say, at whatever distance, shape (AHEAD_FRAMES,).
    """

    distance: Array
    network: Array
    velocity: Array
    alone: Array

    @classmethod
    def learn(cls, distance: Array, network: Array, velocity: Array, came: Array) -> Trust:
        """From trials: their distances (T,) and what was predicted and came, less the last pose, (T, frames, F)."""
        if not len(distance):
            return cls(np.zeros(1), np.ones((1, AHEAD_FRAMES)), np.zeros((1, AHEAD_FRAMES)), np.zeros(AHEAD_FRAMES))
        order = np.argsort(distance)
        levels = [these for these in np.array_split(order, TRUST_LEVELS) if len(these)]
        shares = np.zeros((len(levels), AHEAD_FRAMES, 2))
        for frame in range(AHEAD_FRAMES):

            def fitted(these: NDArray[np.intp], frame: int = frame) -> Array:
                ways = np.stack([network[these, frame].ravel(), velocity[these, frame].ravel()])
                return shares_of(ways @ ways.T, ways @ came[these, frame].ravel())

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
        alone = (velocity * came).sum((0, 2)) / np.maximum(np.square(velocity).sum((0, 2)), 1e-9)
        return cls(known, together[:, :, 0], together[:, :, 1], np.clip(alone, 0.0, 1.0))

    def at(self, distance: float) -> tuple[Array, Array]:
        """The shares of network and velocity at a distance, each (AHEAD_FRAMES,); beyond the last the network fades."""
        beyond = min(1.0, float(self.distance[-1]) / distance) if len(self.distance) > 1 and distance > 0.0 else 1.0
        level = float(np.interp(distance, self.distance, np.arange(len(self.distance))))
        below, share = int(level), level - int(level)
        above = min(below + 1, len(self.distance) - 1)
        network, velocity = ((1 - share) * part[below] + share * part[above] for part in (self.network, self.velocity))
        return beyond * network, velocity


@dataclass(frozen=True)
class Forecast:
    """What was predicted at one moment, in two ways, as movements away from the last pose.

    Attributes:
        network, velocity: as the network goes on, and at the last velocity, shape (AHEAD_FRAMES, F).
        joint: shares of both in what is predicted by both together, shape (AHEAD_FRAMES, 2).
        alone: share of the last velocity in what is predicted without the network, shape (AHEAD_FRAMES,).
        say: how much the first of the two ways counts, in [0, 1], shape (AHEAD_FRAMES,).
    """

    network: Array
    velocity: Array
    joint: Array
    alone: Array
    say: Array

    @property
    def shares(self) -> Array:
        """Of network and velocity in what is anticipated, shape (AHEAD_FRAMES, 2)."""
        return self.say[:, None] * self.joint + ((1.0 - self.say) * self.alone)[:, None] * [0.0, 1.0]

    @property
    def movement(self) -> Array:
        """What is anticipated, shape (AHEAD_FRAMES, F)."""
        shares = self.shares
        return shares[:, :1] * self.network + shares[:, 1:] * self.velocity


class Experience:
    """What came true of earlier predictions of a recording, at each frame ahead.

    Two ways of predicting compete: network and last velocity together, and the last velocity alone; the rest of either
    is the last pose, held. Each is corrected by least squares over what came true, and how much each counts is
    exponential weighting (Vovk 1990) of their mean absolute errors so far, E of the first and e of the second in sum,

        say / (1 - say) = p / (1 - p) exp(EAGERNESS (e - E) / m),      p = q^CAUTION,

    with m the mean error of the better one, and q the share that the network is trusted with by the library. Were
    every error known at once and p and m the same throughout, the sum of errors would exceed e by no more than
    m ln(1 / (1 - p)) / EAGERNESS + EAGERNESS sum r^2 / (8 m), where r is by how much a prediction's two errors differ.
    Errors are known as late as the prediction reaches ahead: until then p decides. The last velocity alone is tried
    within what was seen before the first prediction as well.

    Args:
        seen: the frames before the first prediction, shape (T, F), mm.
    """

    def __init__(self, seen: Array) -> None:
        self._trials = np.zeros(AHEAD_FRAMES)
        self._alone = np.zeros((3, AHEAD_FRAMES))  # of the velocity alone: trials, square, product with what came
        self._gram = np.zeros((AHEAD_FRAMES, 2, 2))
        self._came = np.zeros((AHEAD_FRAMES, 2))
        self._missed = np.zeros((AHEAD_FRAMES, 2))
        for last in range(1, len(seen)):
            velocity = at_last_velocity(seen[: last + 1])
            for at, frame in enumerate(seen[last + 1 :][:SEEN_AHEAD]):
                self._add_alone(at, velocity[at], frame - seen[last])

    def add(self, ahead: int, forecast: Forecast, came: Array) -> None:
        """Takes in what came, less the last pose of then, (F,), so many frames after a forecast."""
        at = ahead - 1
        ways = np.stack([forecast.network[at], forecast.velocity[at]])
        self._trials[at] += 1.0
        self._add_alone(at, forecast.velocity[at], came)
        self._gram[at] += ways @ ways.T
        self._came[at] += ways @ came
        self._missed[at, 0] += np.abs(forecast.joint[at] @ ways - came).mean()
        self._missed[at, 1] += np.abs(forecast.alone[at] * ways[1] - came).mean()

    def forecast(self, trust: Trust, distance: float, network: Array, velocity: Array) -> Forecast:
        """What is predicted now.

        Args:
            trust: by the library; its shares count as PRIOR_TRIALS predictions, that of the velocity alone as
                PRIOR_ALONE.
            distance: from the nearest known moment, mm.
            network, velocity: as in `Forecast`.
        """
        joint = np.stack(trust.at(distance), axis=1)
        known = np.clip(joint[:, 0] ** CAUTION, 1e-9, 1.0 - 1e-9)
        trials, size = np.maximum(self._trials, 1.0), np.diagonal(self._gram, axis1=1, axis2=2)
        prior = size * PRIOR_TRIALS / trials[:, None] + 1e-9
        joint = shares_of(self._gram + prior[:, None] * np.eye(2), self._came + prior * joint)
        tried, square, product = self._alone
        prior_alone = square * PRIOR_ALONE / np.maximum(tried, 1.0) + 1e-9
        alone = (product + prior_alone * trust.alone) / (square + prior_alone)
        better = np.maximum(self._missed.min(1) / trials, 1e-9)
        favour = EAGERNESS * (self._missed[:, 1] - self._missed[:, 0]) / better
        say = expit(logit(known) + favour)
        return Forecast(network, velocity, joint, np.clip(alone, 0.0, 1.0), say)

    def _add_alone(self, at: int, velocity: Array, came: Array) -> None:
        self._alone[:, at] += np.array([1.0, velocity @ velocity, velocity @ came])


def at_last_velocity(past: Array) -> Array:
    """How far the last velocity, damped, goes in each of the next frames, shape (AHEAD_FRAMES, F).

    A velocity v that falls by exp(-t / d) goes  v d (1 - exp(-t / d)).
    """
    damping = DAMPING_S * RATE
    ahead = damping * (1.0 - np.exp(-np.arange(1, AHEAD_FRAMES + 1) / damping))
    return np.multiply.outer(ahead, past[-1] - past[-2])


def shares_of(gram: Array, came: Array) -> Array:
    """The shares in [0, 1] of two ways that make most of what came: least squares without negative ones, cut at 1.

    Args:
        gram: inner products of the two ways, shape (..., 2, 2).
        came: theirs with what came, shape (..., 2).
    """
    size = np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-300)
    # If the free solution has a negative share, the best of the others has one way only.
    lone = np.maximum(came, 0.0) / size
    first_is_best = (lone * came)[..., 0] >= (lone * came)[..., 1]
    one = lone * np.stack([first_is_best, ~first_is_best], axis=-1)
    crossed, determinant = gram[..., 0, 1], np.linalg.det(gram)
    both = (
        np.stack([size[..., 1] * came[..., 0], size[..., 0] * came[..., 1]], axis=-1)
        - crossed[..., None] * came[..., ::-1]
    )
    free = both / np.where(determinant > 1e-12 * size.prod(-1), determinant, np.inf)[..., None]
    regular = (determinant > 1e-12 * size.prod(-1)) & (free >= 0.0).all(-1)
    return np.minimum(np.where(regular[..., None], free, one), 1.0)
