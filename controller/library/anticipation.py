"""What comes next: the motions that a centralized network knows are laid beside the last fraction of a second.

Each motion is compared at many phases and tempos (its frequencies scaled); the few that fit best go on, each from where
the body really is: the difference to it fades within FORGET seconds, that in velocity within FORGET_VELOCITY.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


class Anticipator:
    """Predicts the joints for the next half second.

    Args:
        library: whose motions are expected; its network must be a centralized one.

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
        seen, coming = [], []
        for name in network.motions:
            part = network.part(name)
            for phase in np.arange(0.0, part.seconds, 1.0 / PHASES_A_SECOND):
                time = phase + np.multiply.outer(TEMPOS, steps)
                time = time % part.seconds if part.loop else time
                features = joint_features(self.encoding, part.at(time.ravel())).reshape(*time.shape, -1)
                seen.append(features[:, :PAST_FRAMES:LOOK_EVERY])
                coming.append(features[:, PAST_FRAMES - 1 :])
        self._seen = np.concatenate(seen).reshape(-1, seen[0].shape[1] * seen[0].shape[2])
        self._square = np.square(self._seen).sum(1)
        self._coming = np.concatenate(coming)

    def __call__(self, past: Array) -> Array:
        """The next AHEAD_FRAMES frames at RATE after the last PAST_FRAMES, shape (PAST_FRAMES, F) to (AHEAD_FRAMES, F).

        Both are `joint_features`, mm.
        """
        asked = past[::LOOK_EVERY].ravel()
        distance = np.maximum(self._square - 2.0 * self._seen @ asked + asked @ asked, 1e-9)
        best = np.argsort(distance)[:VOICES]
        share = (1.0 / distance[best]) / (1.0 / distance[best]).sum()
        going = np.tensordot(share, self._coming[best], 1)
        time = np.arange(1, AHEAD_FRAMES + 1)[:, None] / RATE
        off = past[-1] - going[0]
        off_velocity = _velocity(past) - (going[1] - going[0]) * RATE
        return going[1:] + off * np.exp(-time / FORGET) + off_velocity * time * np.exp(-time / FORGET_VELOCITY)


@dataclass(frozen=True)
class Foresight:
    """How far off predictions were, mean absolute error of a coordinate in mm.

    Attributes:
        ahead_s: how far ahead.
        network: by the network's motions.
        hold: by holding the last pose.
        velocity: by going on at the last velocity.
    """

    ahead_s: float
    network: float
    hold: float
    velocity: float


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
    missed = np.zeros((3, AHEAD_FRAMES))
    for start in starts:
        past, came = features[start - PAST_FRAMES : start], features[start : start + AHEAD_FRAMES]
        for row, predicted in enumerate((anticipator(past), past[-1], past[-1] + _velocity(past) * time)):
            missed[row] += np.abs(predicted - came).mean(1)
    missed /= len(starts)
    at = [round(ahead * RATE) - 1 for ahead in (0.1, 0.2, 0.3, 0.4, 0.5)]
    return [Foresight((k + 1) / RATE, *(float(value) for value in missed[:, k])) for k in at]


def _velocity(past: Array) -> Array:
    """Of the last frames, a second."""
    return (past[-1] - past[-1 - VELOCITY_FRAMES]) * RATE / VELOCITY_FRAMES
