"""A track: one playing motion, its network (which may morph into another motion) and the time into the motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from controller.deck.joins.deck_motions import SUMMED, Motion
from controller.deck.tracks.frame_player import FramePlayer
from controller.library.motion_library import MotionLibrary
from controller.motion.quintic import rise
from controller.motion.rotations import Array
from controller.motion.skeleton import Posture
from controller.networks.base import Activation, AutonomousNetwork, Channels, FrameNetwork, Morph
from controller.networks.guard import Guard

AHEAD = 3  # frames by which a player is ahead of its output


class Mixture:
    """A network alone, perhaps guarded, or its core's mixture of two motions, unguarded; fits `base.FrameNetwork`."""

    def __init__(self, network: FrameNetwork, core: AutonomousNetwork | None) -> None:
        self.motions, self.channels = network.motions, network.channels
        self._network, self._core = network, core
        self.motion = self.motions[0]
        self._end()

    @property
    def crossing(self) -> bool:
        """Whether a mixture is still in the player's output."""
        return self._morph is not None

    as_phase_network = None

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self._network.anchors(motion)

    def cue(self, motion: str, anchor: int) -> None:
        """Plays one motion alone from an anchor on."""
        self._network.cue(motion, anchor)
        self.motion = motion
        self._end()

    def morph_to(self, other: str, frames: int) -> None:
        """Morphs inside the network to another motion, within a number of frames; UnknownNameError if there is none."""
        assert self._core is not None, "only a network that runs by itself is morphed"
        self._morph, self._other = self._core.morph(self.motion, other), other
        self._frames, self._length = 0, max(1, frames)

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        if self._morph is None:
            self._network.advance(out)
            return
        self._frames += 1
        self._morph.advance(rise(min(1.0, self._frames / self._length)), out)
        if self._frames >= self._length + AHEAD:
            self._continue_alone(self._morph, out)

    def _continue_alone(self, morph: Morph, frame: Channels) -> None:
        """Leaves the other motion playing, and cues a guard to where it is."""
        morph.settle()
        core = self._core
        assert core is not None
        state = core.snapshot()
        self.cue(self._other, int(np.square(core.anchors(self._other) - frame).sum(1).argmin()))
        core.restore(state)

    def _end(self) -> None:
        self._morph: Morph | None = None
        self._other, self._frames, self._length = "", 0, 0


class Track:
    """Plays one motion at a time with its own copy of the network; another track may share its anchors."""

    def __init__(self, library: MotionLibrary, motions: Mapping[str, Motion], beside: Track | None = None) -> None:
        self._encoding, self._motions = library.encoding, motions
        core = library.network.twin()
        self._core, autonomous = core, core.as_autonomous
        # Restarts the network where it loses its motion; None where it cannot.
        lengths = {motion.name: motion.frames for motion in library.info.motions}
        loops = {name: motion.loop for name, motion in motions.items()}
        self.guard = Guard(autonomous, lengths, loops, library.info.rate) if autonomous is not None else None
        self._mixture = None if core.as_phase_network is not None else Mixture(self.guard or core, autonomous)
        others = beside.player if beside is not None else None
        self.player = FramePlayer(self._mixture or core, library.info.rate, others)
        self._faded_restarts = 0
        self.at = 0.0  # time into the motion, s; in a loop it goes on rising, round after round
        self._round = (0.0, 0.0)  # where it has ended or gone round, backwards and forwards, s
        self._backwards = False
        self.posture_before = self.posture = self._encoding.decode(self.player.step(0.0))  # of the last two steps

    @property
    def motion(self) -> Motion:
        """The motion that is played, or morphed to."""
        return self._motions[self.player.motion]

    @property
    def morphing(self) -> bool:
        """Whether the network morphs from one motion to another."""
        return self._mixture is not None and self._mixture.crossing

    @property
    def activation(self) -> Activation | None:
        """The activation of the network's neurons, shape (N,); None for a network without neurons."""
        return self._core.activation

    @property
    def phase(self) -> float | None:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot; None if the network runs by itself."""
        return self.player.phase if self._mixture is None else None

    @property
    def share(self) -> float | None:
        """How far a loop is, [0, 1), also of a network that keeps time without a phase; None if it keeps none."""
        if self._mixture is None:
            return self.phase
        return self.at / self.motion.seconds % 1.0 if self.guard is None else None

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return self.guard.recues if self.guard else 0

    @property
    def ended(self) -> bool:
        """Whether the motion has ended or gone round, in its direction of play."""
        return self.at <= self._round[0] + SUMMED if self._backwards else self.at >= self._round[1] - SUMMED

    def cue(self, motion: str, anchor: int) -> None:
        """Starts a motion at one of its anchors."""
        self.player.cue_anchor(motion, anchor)
        self._enter(anchor)

    def cue_phase(self, motion: str, phase: float) -> None:
        """Starts a motion at a phase in [0, 1]."""
        self.player.cue(motion, phase)
        seconds = self.motion.seconds
        self.at, self._round, self._backwards = min(phase * self.motion.whole, seconds), (0.0, seconds), False

    def morph(self, motion: str, anchor: int, seconds: float) -> None:
        """Starts a morph of the network itself to another motion (`Mixture.morph_to`), which takes some seconds."""
        assert self._mixture is not None, "a network that a center drives is not morphed here"
        self._mixture.morph_to(motion, round(seconds * self.player.rate))
        self.player.motion = motion
        self._enter(anchor)

    def restarted(self) -> int | None:
        """The anchor of a restart since the last call, or None."""
        if self.guard is None or self.guard.recues == self._faded_restarts:
            return None
        self._faded_restarts = self.guard.recues
        return self.guard.anchor

    def step(self, dt: float, tempo: float) -> Posture:
        """Advances by dt seconds at a tempo; the posture there, its path played at that tempo."""
        player = self.player
        self.at += dt * tempo * player.pace
        if not self._motions[player.motion].loop:
            self.at = min(max(self.at, self._round[0]), self._round[1])
        self._backwards = tempo < 0.0 or (tempo == 0.0 and self._backwards)
        posture = self._encoding.decode(player.step(dt * tempo))
        if tempo != 1.0:
            posture.velocity, posture.turn_rate = posture.velocity * tempo, posture.turn_rate * tempo
        self.posture_before, self.posture = self.posture, posture
        return posture

    def ahead(self, tempo: float, onset: float = 1.0) -> Callable[[Array], Array]:
        """The course of the stored motion at times (S,) from now on, s, of which the first is 0.

        It reaches the tempo from a share `onset` of it, with the square of time (see `Fading.onset`).
        """
        motion, begin = self.motion, self.at

        def course(times: Array) -> Array:
            risen = (1.0 - onset) * (times / times[-1]) ** 2
            return motion.ahead(begin + tempo * times * (onset + risen / 3.0), tempo * (onset + risen))

        return course

    def postures_ahead(self, times: Array, tempo: float) -> Posture:
        """The postures of the stored motion at times (S,) from now on, s."""
        return self.motion.postures_ahead(self.at + tempo * times, tempo)

    def finish_round(self) -> None:
        """Ends a loop with its present round."""
        if self.motion.loop:
            begin, seconds = self._round[1], self.motion.seconds
            begin += float(np.floor((self.at - begin + SUMMED) / seconds)) * seconds
            self._round = begin, begin + seconds

    def _enter(self, anchor: int) -> None:
        motion = self.motion
        self.at, self._backwards = anchor * motion.spacing, False
        whole = motion.seconds
        self._round = (self.at - whole, self.at + whole) if motion.loop else (0.0, whole)
