"""A deck without bodies and networks, for tests of locks."""

import numpy as np

from controller.deck.lockable import Lockable
from controller.deck.locks.phase_lock import LoopPlace

DT = 0.005
ROUND = 0.8


class Wheel(Lockable):
    """A loop of some seconds a round, or a one-shot, whose phase its tempo advances.

    Its targets are those of two joints that go round a circle, and of one that stands still.
    """

    def __init__(self, phase=0.0, seconds=ROUND, *, loop=True):
        super().__init__()
        self.time, self.phase, self.seconds, self.loop, self.jumps = 0.0, phase, seconds, loop, 0

    def require_phase(self):
        pass

    @property
    def targets(self):
        angle = 2.0 * np.pi * self.phase
        return np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.3])

    def _playhead(self, time):
        alone = not self.paused
        return LoopPlace(time, "walk", self.phase, self.seconds, self.loop, self.commanded_tempo, alone)

    def update(self, dt):
        tempo, jump = self._steer(dt)
        if jump is not None:
            self.phase, self.jumps = jump, self.jumps + 1
        self.phase = (self.phase + tempo * dt / self.seconds) % 1.0
        self.time += dt
        self._note(self.targets)
