"""Nearest motion and distance to it, by windows of joint positions.

A window is 0.2 s of all joints relative to the root, and the root's height, in mm, at SAMPLES times. The distance of
two windows is the root mean square distance of their joints. Windows, unlike frames, distinguish postures passed in
different directions, and need no alignment in time: a slightly different tempo is not an error.
"""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from controller.motion.encodings.encoding import Encoding
from controller.motion.rotations import Array, Indices

SAMPLES = 6  # per window
SAMPLE_SECONDS = 1.0 / 30.0  # from one to the next, and from one window to the next
LOST_MM = 40.0


def joint_features(encoding: Encoding, channels: Array) -> Array:
    """Joint positions relative to the root in the heading frame, and the root's height, shape (T, 3 B + 1), mm."""
    skeleton = encoding.skeleton
    joints = skeleton.chain @ (encoding.directions(channels) * skeleton.length[:, None])
    return 1e3 * np.concatenate([joints.reshape(len(channels), -1), encoding.height(channels)[:, None]], axis=1)


def windows(features: Array, stride: int, *, wrap: bool = False) -> Array:
    """Windows of features (T, F), every `stride` frames, (n, SAMPLES * F); `wrap` goes round the end."""
    length = SAMPLES * stride
    if wrap:
        repeats = -(-length // len(features))
        features = np.concatenate([features, *[features] * repeats])[: len(features) + length]
    starts = np.arange(0, len(features) - length + 1, stride)
    return features[starts[:, None] + np.arange(0, length, stride)].reshape(len(starts), -1)


@dataclass(frozen=True)
class MotionMatch:
    """The n windows of a run compared with the motions of a library."""

    motion: Indices  # index of the nearest motion to each window
    distance: Array  # to the nearest window of the intended motion, mm (root mean square over joints)
    place: Indices  # index of that window


class Matcher:
    """The windows of every motion, of features (T_j, F) each at a rate, Hz, `stride` frames from one to the next."""

    def __init__(self, references: list[Array], loops: list[bool], rate: float) -> None:
        self.stride = max(1, round(SAMPLE_SECONDS * rate))
        self._windows = [windows(r, self.stride, wrap=loop) for r, loop in zip(references, loops, strict=True)]
        self._square = [np.square(w).sum(1) for w in self._windows]
        self._joints = references[0].shape[1] / 3.0 * SAMPLES

    def window_count(self, frames: int) -> int:
        """The number of windows of a run with this many frames."""
        return max(0, frames // self.stride - SAMPLES + 1)

    def match(self, run: Array, meant: int, *, alone: bool = False) -> MotionMatch:
        """Compares a run with features (T, F) with all motions, or only with the intended one."""
        seen = windows(run, self.stride)
        square = np.square(seen).sum(1)
        nearest = np.full((len(self._windows), len(seen)), np.inf)
        place = np.empty(0, dtype=np.int64)
        for j, (reference, reference_square) in enumerate(zip(self._windows, self._square, strict=True)):
            if alone and j != meant:
                continue
            distance = square[:, None] + reference_square - 2.0 * seen @ reference.T
            nearest[j] = distance.min(1)
            if j == meant:
                place = distance.argmin(1)
        rms = np.sqrt(np.maximum(nearest, 0.0) / self._joints)
        return MotionMatch(rms.argmin(0), rms[meant], place)

    def nearest(self, run: Array, motion: int) -> Array:
        """The smallest distance of a run with features (T, F) from each window of a motion, shape (n,), mm."""
        seen, reference = windows(run, self.stride), self._windows[motion]
        distance = np.square(seen).sum(1)[:, None] + self._square[motion] - 2.0 * seen @ reference.T
        return np.sqrt(np.maximum(distance.min(0), 0.0) / self._joints)

    def spread(self, motion: int) -> float:
        """The root mean square distance of a motion's joints from their own mean, mm."""
        own = self._windows[motion]
        return float(np.sqrt(np.square(own - own.mean(0)).sum(1).mean() / self._joints))


def rising_length(places: Indices) -> int:
    """The length of the longest strictly rising subsequence."""
    tops: list[int] = []
    for place in places.tolist():
        at = bisect_right(tops, place - 1)
        tops[at : at + 1] = [place]
    return len(tops)


def activity(features: Array, rate: float) -> float:
    """The root mean square speed, mm/s, of joint features (T, F), mm, at a rate in Hz."""
    return float(np.sqrt(np.square(np.diff(features, axis=0)).mean())) * rate
