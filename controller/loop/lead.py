"""Lead: joints whose actuators lag get their targets earlier than the picture, so that all shows at the same time.

The deck runs L ahead of the picture, L being the largest lag of a joint, in whole ticks. With l(o, j) the lag of joint
j at output o and e(j) its largest, a target passes the safety envelope L - e(j) after the deck has made it, and output
o gets it e(j) - l(o, j) after that: each shaft is where the motion is L after the deck. These are the deck's own
targets, only later, so switches, changes of tempo and pauses come through exactly. The envelope stays the last before
an output that lags: what it brakes, brakes at once.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from controller.loop.output_channel import Channel
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose


class Delay:
    """Delays J values, each by its own time, linear between ticks; before its first values they were as these."""

    def __init__(self, seconds: Array, dt: float) -> None:
        """Delays by `seconds` (J,), >= 0, in ticks of dt s."""
        ticks = seconds / dt
        whole = np.floor(ticks + 1e-6)
        self._share = np.maximum(ticks - whole, 0.0)
        self._whole, self._columns = whole.astype(np.int64), np.arange(len(seconds))
        # Whole ticks that all values are delayed by, which is quicker; None where they differ.
        alike = not self._share.any() and len(seconds) and (self._whole == self._whole[0]).all()
        self._alike = int(self._whole[0]) if alike else None
        self._ring = np.zeros((int(self._whole.max(initial=0)) + 2, len(seconds)))
        self._place = -1
        self._delayed = np.empty(len(seconds))
        self._shown = self._delayed.view()
        self._shown.flags.writeable = False  # no output can change what the next one is given

    def __call__(self, values: Array) -> Array:
        """Takes the values (J,) of a tick; the delayed ones, read-only and overwritten by the next call."""
        ring, columns = self._ring, self._columns
        if self._place < 0:
            ring[:] = values
        self._place = (self._place + 1) % len(ring)
        ring[self._place] = values
        if self._alike is not None:
            self._delayed[:] = ring[self._place - self._alike]
            return self._shown
        newer = ring[self._place - self._whole, columns]
        older = ring[self._place - self._whole - 1, columns]
        self._delayed[:] = newer + self._share * (older - newer)
        return self._shown


class Lead:
    """How far a deck runs ahead of the picture, and how late each output gets what it plays, in one run."""

    def __init__(self, channels: Sequence[Channel], joints: int, dt: float) -> None:
        """Takes the lags of the outputs, for J joints and ticks of dt s."""
        none = np.zeros(joints)
        self._channels, self._dt = channels, dt
        self._lags = [none, *(channel.lag if channel.lag is not None else none for channel in channels)]
        self._largest = np.maximum.reduce(self._lags)
        self._ticks = math.ceil(self._largest.max(initial=0.0) / dt - 1e-6)
        self.seconds = self._ticks * dt  # L, s
        self.delays = self.seconds - self._largest  # of the deck's targets on their way to the envelope, shape (J,), s
        self.before = Delay(self.delays, dt)  # delays the targets so
        # Of each stream the delay of targets, the latest poses, the delayed one first, and whether it is corrected.
        self._streams: list[tuple[Delay, deque[Pose], bool]] = []
        self._stream_of: list[int] = []

    def begin(self) -> None:
        """Begins with the outputs as they are now: some may have got a correction, for which the lead is needed."""
        dt = self._dt
        # One stream for all outputs that lag alike; the first is the picture.
        corrected = [False, *(channel.corrected for channel in self._channels)]
        alike = [(lag.tobytes(), one) for lag, one in zip(self._lags, corrected, strict=True)]
        distinct = dict(zip(alike, self._lags, strict=True))
        self._streams = [
            (Delay(self._largest - lag, dt), deque(maxlen=self._ticks - round(lag.max(initial=0.0) / dt) + 1), own)
            for (_, own), lag in distinct.items()
        ]
        self._stream_of = [[*distinct].index(one) for one in alike[1:]]

    def write(self, tick: int, targets: Array, pose: Pose, added: Array | None = None) -> tuple[Array, Pose]:
        """Writes the safe targets (J,), rad, and the deck's pose of a tick to the outputs; returns the picture's.

        Args:
            added: what was added to the targets for outputs that are corrected; the others get them without it.
        """
        plain = targets if added is None else targets - added
        streamed: list[tuple[Array, Pose]] = []
        for late, poses, own in self._streams:
            poses.append(pose)
            streamed.append((late(targets if own else plain), poses[0]))
        for channel, stream in zip(self._channels, self._stream_of, strict=True):
            channel.write(tick, *streamed[stream])
        return streamed[0]
