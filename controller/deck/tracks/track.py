"""A track: one motion of a library that is playing, with its network and how far into the motion it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from controller.deck.joins.deck_motions import Motion
from controller.deck.tracks.frame_player import FramePlayer
from controller.deck.tracks.mixture import Mixture
from controller.library.motion_library import MotionLibrary
from controller.library.network_arrays import Network
from controller.mocap.posture import Posture
from controller.networks.guard import Guard
from controller.rotations import Array


class Track:
    """Plays one motion at a time, with a network of its own.

    Args:
        library: the motions.
        motions: the same as the deck sees them.

    Attributes:
        at: how far into the motion it is, s.
        end: the place at which the motion has ended or gone round, s.
        posture_before, posture: of the last two steps.
    """

    def __init__(self, library: MotionLibrary, motions: Mapping[str, Motion]) -> None:
        self._encoding, self._motions = library.encoding, motions
        core = library.network.twin()
        self._guard = _guard(core, library) if isinstance(core, Network) else None
        self._mixture = Mixture(self._guard or core, core)
        self._player = FramePlayer(self._mixture, library.info.rate)
        self._faded_restarts = 0
        self.at, self.end = 0.0, 0.0
        self.posture_before = self.posture = self._decode(self._player.step(0.0), 1.0)

    @property
    def motion(self) -> Motion:
        """The motion that is played, or morphed to."""
        return self._motions[self._player.motion]

    @property
    def morphing(self) -> bool:
        """Whether the network is on its way from one motion to another."""
        return self._mixture.crossing

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return self._guard.recues if self._guard else 0

    @property
    def ended(self) -> bool:
        """Whether the motion has ended or gone round."""
        return self.at >= self.end

    def cue(self, motion: str, anchor: int) -> None:
        """Starts a motion at one of its anchors."""
        self._player.cue_anchor(motion, anchor)
        self._enter(anchor)

    def cue_phase(self, motion: str, phase: float) -> None:
        """Starts a motion at a phase in [0, 1)."""
        self._player.cue(motion, phase)
        self.at, self.end = phase * self.motion.seconds, self.motion.seconds

    def morph(self, motion: str, anchor: int, seconds: float) -> None:
        """Has the network itself change to another motion within so many seconds (see `networks.morph`)."""
        self._mixture.mix(motion, 1.0, round(seconds * self._player.rate), anchor)
        self._player.motion = motion
        self._enter(anchor)

    def restart_at(self, anchor: int) -> None:
        """Plays on from an anchor of the same motion, to which its guard has restarted the network."""
        self._player.cue_anchor(self.motion.name, anchor)

    def restarted(self) -> int | None:
        """The anchor at which the network was restarted since the last call, if it was."""
        if self._guard is None or self._guard.recues == self._faded_restarts:
            return None
        self._faded_restarts = self._guard.recues
        return self._guard.anchor

    def step(self, dt: float, tempo: float) -> Posture:
        """Advances by dt seconds at a tempo; the posture there, its path played at that tempo."""
        self.at += dt * tempo
        self.posture_before, self.posture = self.posture, self._decode(self._player.step(dt * tempo), tempo)
        return self.posture

    def _decode(self, channels: Array, tempo: float) -> Posture:
        """The posture of channels, its path played at a tempo."""
        posture = self._encoding.decode(channels)
        return replace(
            posture,
            height=posture.height.copy(),
            velocity=posture.velocity * tempo,
            turn_rate=posture.turn_rate * tempo,
        )

    def finish_round(self) -> None:
        """Sets the end of a loop that has gone round to the end of its present round."""
        if self.motion.loop and self.ended:
            rounds = np.floor((self.at - self.end) / self.motion.seconds) + 1.0
            self.end += float(rounds) * self.motion.seconds

    def _enter(self, anchor: int) -> None:
        motion = self.motion
        self.at = anchor * motion.spacing
        self.end = motion.seconds + (self.at if motion.loop else 0.0)


def _guard(network: Network, library: MotionLibrary) -> Guard:
    """A guard around a network that runs by itself; one that a center drives cannot lose its place, and needs none."""
    motions = library.info.motions
    lengths = {motion.name: motion.frames for motion in motions}
    loops = {motion.name: motion.plays == "loop" for motion in motions}
    return Guard(network, lengths, loops, library.info.rate)
