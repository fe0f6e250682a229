"""One motion of a library in continuous time, at any rate and tempo: no robot, no clock, no switching."""

import math
from collections.abc import Mapping

import numpy as np

from controller.deck.tracks.frame_player import FramePlayer
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

LONGEST = 3600.0  # s, of motion generated at once


class MotionGenerator:
    """Plays one motion step by step.

    UnknownNameError if there is no such motion; it names the nearest. MotiondeckError if the phase is not in [0, 1], or
    the tempo not finite or negative where that is impossible.

    Args:
        library: the library; it is not changed, and generators of one library are independent.
        tempo: 1 is as fast as recorded, 0 stands still, negative plays backwards; may be changed between steps.
        phase: where in the motion to begin, in [0, 1]; a one-shot ends at 1.
        inputs: values of the motion's inputs besides the phase, such as {"speed": 1.4}, clipped to the learned range.
    """

    def __init__(
        self,
        library: MotionLibrary,
        motion: str,
        *,
        tempo: float = 1.0,
        phase: float = 0.0,
        inputs: Mapping[str, float] | None = None,
    ) -> None:
        if not 0.0 <= phase <= 1.0:
            raise MotiondeckError(f"a phase of {phase:g} is not in [0, 1]")
        self._velocities = library.encoding.velocities
        self._player = FramePlayer(library.network.twin(), library.info.rate, only=motion)
        for name, value in (inputs or {}).items():
            self.set_input(name, value)
        self._player.cue(motion, phase)
        self.tempo = tempo

    def set_input(self, name: str, value: float) -> None:
        """Gives an input besides the phase, such as speed, another value, from the next frame on.

        UnknownNameError if no motion of the library has such an input. MotiondeckError if the value is not finite.
        """
        if not math.isfinite(value):
            raise MotiondeckError(f"a {name} of {value:g} is not a finite number")
        self._player.set_input(name, value)

    @property
    def tempo(self) -> float:
        """The tempo; 1 is as fast as recorded, negative plays backwards."""
        return self._tempo

    @tempo.setter
    def tempo(self, tempo: float) -> None:
        if not math.isfinite(tempo):
            raise MotiondeckError(f"a tempo of {tempo:g} is not a finite number")
        if tempo < 0.0:
            self._player.require_phase()
        self._tempo = tempo

    @property
    def phase(self) -> float:
        """How far it is: [0, 1) in a loop, 0 to 1 in a one-shot; MotiondeckError if the network runs by itself."""
        return self._player.phase

    def step(self, dt: float) -> Array:
        """Advances by dt >= 0 seconds; the channels there, shape (C,), in the units of the library's encoding.

        Channels that are velocities are those of the motion as it is played: twice as large at twice the tempo.
        MotiondeckError if dt is negative or not finite.
        """
        if not 0.0 <= dt < math.inf:
            raise MotiondeckError(f"a step of {dt:g} s is not possible; time goes forward")
        channels = self._player.step(dt * self._tempo).copy()
        channels[self._velocities] *= self._tempo
        return channels

    def frames(self, seconds: float, rate: float) -> Array:
        """The next seconds of the motion, shape (round(seconds * rate), C); the first frame is the present one.

        MotiondeckError if the rate is impossible, or there would be no frame or too many.
        """
        if not (math.isfinite(rate) and 0.0 < rate <= 10_000.0):
            raise MotiondeckError(f"a rate of {rate:g} Hz is not between 0 and 10000")
        if not 1.0 / rate <= seconds <= LONGEST:
            raise MotiondeckError(f"{seconds:g} s at {rate:g} Hz: give at least one frame and at most {LONGEST:g} s")
        steps = [0.0] + [1.0 / rate] * (round(seconds * rate) - 1)
        return np.array([self.step(dt) for dt in steps])
