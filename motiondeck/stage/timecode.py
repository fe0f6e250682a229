"""MIDI timecode: where a tape or a sequencer is, from quarter-frame messages (MIDI Time Code, RP-004).

Eight quarter frames, 0 to 7, carry the time of the frame in which the first of them was sent, a nibble each; they take
two frames. Once eight have come in order, each further one is a quarter of a frame later.
"""

import re
from typing import NamedTuple, Self

_TEXT = re.compile(r"(\d\d):(\d\d):(\d\d)[:;](\d\d)")
_RATES = (24, 25, 30, 30)  # frames a second by number of a rate; 2 is 30 drop-frame (29.97), 3 is 30
_DROP = 2


class Timecode(NamedTuple):
    """A time in hours, minutes, seconds and frames."""

    hours: int
    minutes: int
    seconds: int
    frames: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """The time in "HH:MM:SS:FF"; raises a ValueError where it is none."""
        found = _TEXT.fullmatch(text)
        time = cls(*map(int, found.groups())) if found else None
        if time is None or not time.possible(max(_RATES)):
            raise ValueError("a time of a timecode is HH:MM:SS:FF, such as 01:00:10:00")
        return time

    def possible(self, rate: int) -> bool:
        """Whether the time exists at this frame rate."""
        return self.hours < 24 and self.minutes < 60 and self.seconds < 60 and self.frames < rate

    def number(self, kind: int) -> int:
        """How many frames after 00:00:00:00 it is; kinds of rates are 24, 25, 30 drop-frame and 30 frames a second."""
        # Drop-frame leaves out the first two numbers of each minute, but not of each tenth one.
        minutes = 60 * self.hours + self.minutes
        count = (60 * minutes + self.seconds) * _RATES[kind] + self.frames
        return count - 2 * (minutes - minutes // 10) if kind == _DROP else count


class Passed(NamedTuple):
    """What a timecode has gone through: frames beyond `after` up to `until`, and the number of its rate."""

    after: float
    until: float
    kind: int

    def contains(self, time: Timecode) -> bool:
        """Whether a time lies in it."""
        return self.after < time.number(self.kind) <= self.until


class TimecodeReader:
    """Follows quarter frames forward; what is jumped over, or passed backwards, is not passed."""

    def __init__(self) -> None:
        self._nibbles = [0] * 8
        self._expected = 0
        self._kind = 0
        self._position: float | None = None  # in frames, once it is known

    def quarter_frame(self, piece: int, nibble: int) -> Passed | None:
        """Takes one quarter frame; what was passed since the one before, None while that is not known."""
        if piece != self._expected:
            self.locate()
            if piece:
                return None
        self._nibbles[piece] = nibble
        self._expected = (piece + 1) % 8
        if piece == 7:
            return self._complete()
        if self._position is None:
            return None
        before, self._position = self._position, self._position + 0.25
        return Passed(before, self._position, self._kind)

    def locate(self) -> None:
        """The timecode goes on somewhere else, where it has to be found anew."""
        self._position, self._expected = None, 0

    def _complete(self) -> Passed | None:
        low, high = self._nibbles[::2], self._nibbles[1::2]
        frames, seconds, minutes = (a | b << 4 for a, b in zip(low[:3], high[:3], strict=True))
        hours, self._kind = low[3] | (high[3] & 1) << 4, high[3] >> 1 & 3
        time = Timecode(hours, minutes, seconds, frames)
        if not time.possible(_RATES[self._kind]):
            self.locate()
            return None
        began, before = time.number(self._kind), self._position
        self._position = began + 1.75
        if before is None or not 0.0 < self._position - before <= _RATES[self._kind]:
            before = began - 0.25
        return Passed(before, self._position, self._kind)
