"""What comes next: the motions that a centralized network knows are laid beside the last fraction of a second.

Each motion is compared at many phases and tempos (its frequencies scaled); the few that fit best go on, each from where
the body really is: the difference to it fades within FORGET seconds, that in velocity within FORGET_VELOCITY.

What is seen may be like nothing that the network knows. How far it is to be trusted then is learned from the network
itself: each of its motions is predicted from the others alone, and at each distance from the nearest known moment the
least squares tell how much of the network's movement, and of the last velocity, comes true (`Trust`). The rest of the
prediction is the last pose, held. While a recording goes on, what came true of earlier predictions of it corrects these
shares (`Experience`), and where last velocity and pose did better alone, it is left to them.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from benchmarks.centralized.anticipation_trust import (
    AHEAD_FRAMES,
    RATE,
    Experience,
    Forecast,
    Trust,
    at_last_velocity,
)
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.centralized.network import CentralizedNetwork
from motiondeck_base.errors import MotiondeckError

PAST_FRAMES = 24
VELOCITY_FRAMES = 4
LOOK_EVERY = 3
PHASES_A_SECOND = 30.0
TEMPOS = (0.75, 0.87, 1.0, 1.15, 1.33)
VOICES = 8
FORGET, FORGET_VELOCITY = 0.4, 0.06
TRIALS_A_SECOND = 10.0  # of each motion, predicted from the others


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
                f"library '{library.info.name}' holds a {library.info.network} network; this needs a centralized "
                "one. Train it with: motiondeck learn RECIPE (docs/centralized-networks.md)."
            )
        self.encoding = library.encoding
        steps = np.arange(1 - PAST_FRAMES, AHEAD_FRAMES + 1) / RATE
        seen, coming, own = [], [], []
        for index, name in enumerate(network.motions):
            part = network[name]
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

        Both are `joint_features`, mm. Nothing is known of the recording before these frames.
        """
        return past[-1] + self.forecast(past, Experience(past)).movement

    def forecast(self, past: Array, experience: Experience) -> Forecast:
        """The same as movements away from the last frame, by what is known of the recording already."""
        network, distance = self.by_network(past)
        return experience.forecast(self.trust, distance, network - past[-1], at_last_velocity(past))

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
        steps = np.arange(1 - PAST_FRAMES, AHEAD_FRAMES + 1) / RATE
        distances, by_network, by_velocity, came = [], [], [], []
        for index, name in enumerate(network.motions if len(network.motions) > 1 else ()):
            part = network[name]
            for phase in np.arange(0.0, part.seconds, 1.0 / TRIALS_A_SECOND):
                at = phase + steps
                features = joint_features(self.encoding, part.at(at % part.seconds if part.loop else at))
                past, coming = features[:PAST_FRAMES], features[PAST_FRAMES:]
                predicted, distance = self.by_network(past, without=index)
                distances.append(distance)
                by_network.append(predicted - past[-1])
                by_velocity.append(at_last_velocity(past))
                came.append(coming - past[-1])
        return Trust.learn(np.array(distances), np.array(by_network), np.array(by_velocity), np.array(came))


@dataclass(frozen=True)
class Foresight:
    """How far off predictions were, mean absolute error of a coordinate in mm.

    Attributes:
        ahead_s: how far ahead.
        anticipated: by the network's motions, the last velocity and pose, each as far as it is trusted.
        network: by the network's motions alone.
        hold: by holding the last pose.
        velocity: by going on at the last velocity.
        trust: the mean share that the network has in what is anticipated, and
        line: the last velocity.
    """

    ahead_s: float
    anticipated: float
    network: float
    hold: float
    velocity: float
    trust: float
    line: float


def foresight(anticipator: Anticipator, channels: Array, rate: float, every_s: float = 0.1) -> list[Foresight]:
    """Predicts a recording (T, C) again and again from its own past, and measures how well, for 0.1 to 0.5 s ahead.

    MotiondeckError if it is too short.
    """
    features = _at_60_hz(joint_features(anticipator.encoding, channels), rate)
    starts = range(PAST_FRAMES, len(features) - AHEAD_FRAMES)
    if not starts:
        raise MotiondeckError(
            f"a recording of {len(channels) / rate:.2f} s is too short to predict half a second. Give a longer one."
        )
    missed, trusted, measured = np.zeros((4, AHEAD_FRAMES)), np.zeros((2, AHEAD_FRAMES)), 0
    experience = Experience(features[:PAST_FRAMES])
    forecasts: deque[tuple[int, Forecast]] = deque(maxlen=AHEAD_FRAMES)
    for start in starts:
        past, came = features[start - PAST_FRAMES : start], features[start : start + AHEAD_FRAMES]
        held = past[-1]
        for before, forecast in forecasts:
            experience.add(start - before, forecast, held - features[before - 1])
        forecast = anticipator.forecast(past, experience)
        forecasts.append((start, forecast))
        if (start - PAST_FRAMES) % round(every_s * RATE):
            continue
        ways = (forecast.movement, forecast.network, 0.0, forecast.velocity)
        missed += [np.abs(held + movement - came).mean(1) for movement in ways]
        trusted += forecast.shares.T
        measured += 1
    rows = np.vstack([missed, trusted]) / measured
    at = [round(ahead * RATE) - 1 for ahead in (0.1, 0.2, 0.3, 0.4, 0.5)]
    return [Foresight((k + 1) / RATE, *(float(value) for value in rows[:, k])) for k in at]


def _at_60_hz(features: Array, rate: float) -> Array:
    """Features (T, F) at another rate: every n-th, or on lines between frames.

    Frames between recorded ones know the next one. So at 30 Hz every moment that is measured is a recorded frame.
    """
    stride = max(1, round(rate / RATE))
    if abs(rate / stride - RATE) < 0.05 * RATE:
        return features[::stride]
    time = np.arange(1, int((len(features) - 1) * RATE / rate) + 1) / RATE * rate
    before = np.minimum(time.astype(int), len(features) - 2)
    share = (time - before)[:, None]
    return (1.0 - share) * features[before] + share * features[before + 1]


def _velocity(past: Array) -> Array:
    """Of the last frames, a second."""
    return (past[-1] - past[-1 - VELOCITY_FRAMES]) * RATE / VELOCITY_FRAMES
