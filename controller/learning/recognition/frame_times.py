"""When frames of a fixed rate are due between measurements that come at any pace."""

from __future__ import annotations

from collections.abc import Iterator


class FrameTimes:
    """Counts time from the first measurement on; a frame is due at that one, and then every 1 / rate seconds.

    Args:
        rate: frames a second, Hz.
    """

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate
        self._since = 0.0

    def due(self, dt: float) -> Iterator[float]:
        """Goes dt >= 0 s on, once the iterator is used up; at which share of them each frame is due, in (0, 1]."""
        due = self._period - self._since
        while due <= dt:
            yield due / dt if dt > 0.0 else 1.0
            due += self._period
        self._since = self._period - (due - dt)
