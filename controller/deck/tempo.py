"""Tempo: the rate and direction of playing. It follows the commanded one at a bounded rate."""

from controller.wire.messages.arguments import STEP_SECONDS, TEMPO, TEMPO_SECONDS
from motiondeck_base.errors import MotiondeckError

TEMPO_RATE = 2.5  # how fast the tempo itself may change, 1/s: a pause takes 0.4 s


class Paced:
    """The tempo and the pauses of a deck."""

    def __init__(self) -> None:
        self.tempo = 1.0  # the present one: 1 as recorded, 0 stands still, negative plays backwards
        self.commanded_tempo = 1.0  # what the present one follows, unless a lock steers it
        self.paused = False  # whether a pause was commanded: a tempo of zero until it is over
        self._step_left = 0.0  # s for which the motion still goes on in a pause
        self._rate_to_commanded = TEMPO_RATE  # 1/s

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Changes the tempo within `over` s, by at most TEMPO_RATE; in a pause, after it. CommandError out of range."""
        TEMPO.check(factor)
        TEMPO_SECONDS.check(over)
        self.commanded_tempo = factor
        begins = 0.0 if self.paused else self.tempo
        self._rate_to_commanded = min(TEMPO_RATE, abs(factor - begins) / over) if over > 0.0 else TEMPO_RATE

    def pause(self) -> None:
        """Comes to a standstill and stays there until `resume`."""
        self.paused = True
        self._rate_to_commanded = TEMPO_RATE

    def resume(self) -> None:
        """Plays on after a pause."""
        self.paused = False
        self._step_left = 0.0

    def step_on(self, seconds: float = 0.0) -> None:
        """Goes on in a pause for some seconds, at least an update; CommandError, or MotiondeckError without a pause."""
        STEP_SECONDS.check(seconds)
        if not self.paused:
            raise MotiondeckError("a step goes on in a pause: pause first")
        self._step_left = max(seconds, 1e-9)

    def advance_tempo(self, dt: float) -> float:
        """The tempo dt seconds later, on its way to the commanded one."""
        if self.tempo == self.commanded_tempo and not self.paused:
            return self.tempo
        return self.steer_tempo(self.commanded_tempo, self._rate_to_commanded, dt)

    def steer_tempo(self, goal: float, rate: float, dt: float) -> float:
        """The tempo dt seconds later, on its way to a goal at a rate, 1/s; a pause comes first."""
        if self.paused and self._step_left > 1e-12:
            self._step_left -= dt
            return self.commanded_tempo
        if self.paused:
            goal, rate = 0.0, TEMPO_RATE
        most = rate * dt
        self.tempo = round(self.tempo + min(max(goal - self.tempo, -most), most), 12)  # through exactly 0
        return self.tempo
