"""Tempo: how fast motions are played, and which way. It follows the commanded one at a bounded rate."""

from __future__ import annotations

from controller.wire.messages.arguments import STEP_SECONDS, TEMPO, TEMPO_SECONDS
from motiondeck_base.errors import MotiondeckError

# How fast the tempo itself may change, 1/s: a pause takes 0.4 s.
TEMPO_RATE = 2.5


class Tempo:
    """A tempo: 1 as recorded, 0 stands still, negative plays backwards.

    Attributes:
        present: the present tempo; it follows the commanded one smoothly.
        commanded: the commanded tempo.
        paused: whether a pause was commanded: a tempo of zero until it is over.
    """

    def __init__(self) -> None:
        self.present = self.commanded = 1.0
        self.paused = False
        self._on = 0.0  # s for which the motion still goes on in a pause
        self._rate = TEMPO_RATE  # of the change to the commanded tempo, 1/s

    def command(self, factor: float, over: float = 0.0) -> None:
        """Changes to another tempo.

        Args:
            factor: the tempo, in the range of `command_table.TEMPO`.
            over: how long the change takes, s; at least as long as TEMPO_RATE demands. It begins after a pause.

        Raises:
            CommandError: if the tempo or the time is out of its range.
        """
        TEMPO.check(factor)
        TEMPO_SECONDS.check(over)
        self.commanded = factor
        begins = 0.0 if self.paused else self.present
        self._rate = min(TEMPO_RATE, abs(factor - begins) / over) if over > 0.0 else TEMPO_RATE

    def pause(self) -> None:
        """Comes to a standstill and stays there until `resume`."""
        self.paused = True
        self._rate = TEMPO_RATE

    def resume(self) -> None:
        """Plays on after a pause."""
        self.paused = False
        self._on = 0.0

    def step_on(self, seconds: float) -> None:
        """Goes on in a pause for so long at the commanded tempo, at least for one update.

        Raises:
            CommandError: if the time is out of its range.
            MotiondeckError: if there is no pause.
        """
        STEP_SECONDS.check(seconds)
        if not self.paused:
            raise MotiondeckError("a step goes on in a pause: pause first")
        self._on = max(seconds, 1e-9)

    def advance(self, dt: float) -> float:
        """The tempo after dt more seconds."""
        if self.present == self.commanded and not self.paused:
            return self.present
        return self._approach(self.commanded, self._rate, dt)

    def steer(self, wanted: float, rate: float, dt: float) -> float:
        """The tempo after dt more seconds on the way to another one than was commanded, changing at most at a rate."""
        return self._approach(wanted, rate, dt)

    def _approach(self, goal: float, rate: float, dt: float) -> float:
        if self.paused and self._on > 1e-12:
            self._on -= dt
            return self.commanded
        if self.paused:
            goal, rate = 0.0, TEMPO_RATE
        most = rate * dt
        self.present += min(max(goal - self.present, -most), most)
        return self.present


class Paced:
    """The tempo of a deck, as commands see it; a base of both decks."""

    def __init__(self) -> None:
        self._tempo = Tempo()

    @property
    def tempo(self) -> float:
        """The present tempo; it follows the commanded one smoothly."""
        return self._tempo.present

    @property
    def commanded_tempo(self) -> float:
        """The commanded tempo."""
        return self._tempo.commanded

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self._tempo.paused

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, reached within `over` seconds; see `Tempo.command`."""
        self._tempo.command(factor, over)

    def pause(self) -> None:
        """Comes to a standstill and stays there until `resume`."""
        self._tempo.pause()

    def step_on(self, seconds: float = 0.0) -> None:
        """Goes on in a pause for so long, s, or for one update; see `Tempo.step_on`."""
        self._tempo.step_on(seconds)

    def resume(self) -> None:
        """Plays on after a pause."""
        self._tempo.resume()
