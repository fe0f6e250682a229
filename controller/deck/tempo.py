"""Tempo: how fast motions are played. It follows what is commanded at a bounded rate; a pause is a tempo of zero."""

from __future__ import annotations

from controller.wire.messages import FASTEST, SLOWEST
from motiondeck_base.errors import MotiondeckError

# How fast the tempo itself may change, 1/s: a pause takes 0.4 s.
TEMPO_RATE = 2.5


class Tempo:
    """A tempo, 1 as recorded.

    Attributes:
        speed: what is played; it follows the commanded one smoothly.
        commanded: what was commanded.
        paused: whether a standstill was commanded.
    """

    def __init__(self) -> None:
        self.speed = self.commanded = 1.0
        self.paused = False
        self._rate = TEMPO_RATE  # of going to the commanded tempo, 1/s

    def command(self, factor: float, over: float = 0.0) -> None:
        """Goes over to another tempo, SLOWEST to FASTEST times as fast as recorded.

        Args:
            factor: the tempo.
            over: how long the change takes, s; never less than is smooth. In a pause it begins when that is over.

        Raises:
            MotiondeckError: if the factor is outside, or the time is negative.
        """
        if not SLOWEST <= factor <= FASTEST:
            raise MotiondeckError(f"speed {factor:g} is not between {SLOWEST:g} and {FASTEST:g}")
        if not over >= 0.0:
            raise MotiondeckError(f"a change of speed cannot take {over:g} s")
        self.commanded = factor
        begins = 0.0 if self.paused else self.speed
        self._rate = min(TEMPO_RATE, abs(factor - begins) / over) if over > 0.0 else TEMPO_RATE

    def pause(self) -> None:
        """Comes to a standstill and stays there."""
        self.paused = True
        self._rate = TEMPO_RATE

    def resume(self) -> None:
        """Goes on after a pause."""
        self.paused = False

    def advance(self, dt: float) -> float:
        """The speed after dt more seconds."""
        goal, rate = (0.0, TEMPO_RATE) if self.paused else (self.commanded, self._rate)
        most = rate * dt
        self.speed += min(max(goal - self.speed, -most), most)
        return self.speed


class Paced:
    """Something that is played at a tempo, as those who command it see that."""

    def __init__(self) -> None:
        self._tempo = Tempo()

    @property
    def speed(self) -> float:
        """The tempo that is being played; it follows the commanded one smoothly."""
        return self._tempo.speed

    @property
    def commanded_speed(self) -> float:
        """The tempo that was commanded."""
        return self._tempo.commanded

    @property
    def paused(self) -> bool:
        """Whether it stands still on command."""
        return self._tempo.paused

    def set_speed(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, within so many seconds; see `Tempo.command`."""
        self._tempo.command(factor, over)

    def pause(self) -> None:
        """Comes to a standstill and stays there."""
        self._tempo.pause()

    def resume(self) -> None:
        """Goes on after a pause."""
        self._tempo.resume()
