"""Entry points: the one after which a motion is most like the course of the motion before it."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from controller.motion.rotations import Array
from controller.networks.base import Channels

WINDOW_FRAMES = 12
WINDOW_SECONDS = 0.45


class TimedMotion(Protocol):
    """A motion with channels at any time."""

    def at(self, time: Array) -> Channels:
        """The channels at times (T,) since its beginning, s, shape (T, D)."""
        ...


def channel_scale(spread: Array) -> Array:
    """The spread of channels (D,) to divide them by: no less than a thousandth of the largest, and never 0."""
    return np.maximum(spread, 1e-3 * max(1e-12, float(spread.max())))


class Entries:
    """The windows that follow the entry points of some motions, (E,), s."""

    def __init__(self, motions: Mapping[str, TimedMotion], starts: Mapping[str, Array]) -> None:
        self._ahead = np.linspace(0.0, WINDOW_SECONDS, WINDOW_FRAMES)
        windows = {
            name: motion.at((starts[name][:, None] + self._ahead).ravel()).reshape(len(starts[name]), WINDOW_FRAMES, -1)
            for name, motion in motions.items()
        }
        frames = np.concatenate([w.reshape(-1, w.shape[-1]) for w in windows.values()])
        self._scale = channel_scale(frames.std(0))
        self._windows = {name: w / self._scale for name, w in windows.items()}

    def best(self, source: TimedMotion, time: float, target: str, among: int | None = None) -> int:
        """The best of the first `among` entry points for leaving a motion at a time, s; spread scales channels."""
        coming = source.at(time + self._ahead) / self._scale
        return int(np.square(self._windows[target][:among] - coming).sum((1, 2)).argmin())
