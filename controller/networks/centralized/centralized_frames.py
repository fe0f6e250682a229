"""Centralized motions frame by frame, as the deck plays networks: entered at anchors, advanced one frame at a time.

A switch is the switching module's: while z goes from one motion to the other both play, mixed by how far it has come.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from controller.motion.rotations import Array
from controller.networks.base import Channels
from controller.networks.centralized.centralized import CentralizedMotion, Passage, Voice, mix
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.entry_points import Entries
from controller.networks.named_motions import NamedMotions
from motiondeck_base.errors import MotiondeckError

ANCHOR_EVERY = 2


@dataclass(frozen=True, eq=False)
class StoredMotion:
    """A centralized motion as arrays, with n centers, m satellites and C channels.

    Attributes:
        frequency, phase: of the centers, shape (n,), rad/s and rad.
        places, sharpness: of the satellites, shape (m, 2 n) and (m,).
        weights: W, shape (C, m), or its two factors.
        rest: shape (C,).
    """

    frequency: Array
    phase: Array
    places: Array
    sharpness: Array
    weights: Array | LowRankWeights
    rest: Array

    @classmethod
    def of(cls, motion: CentralizedMotion) -> StoredMotion:
        """What is stored of a motion."""
        satellites = motion.satellites
        return cls(motion.frequency, motion.phase, satellites.places, satellites.sharpness, motion.weights, motion.rest)

    def revive(self, frames: int, rate: float, *, loop: bool) -> CentralizedMotion:
        """The motion, learned from some frames at a rate in Hz.

        Raises:
            MotiondeckError: if the arrays do not fit each other, or a loop does not close.
        """
        seconds = (frames if loop else max(1, frames - 1)) / rate
        satellites = GaussianSatellites(self.places, self.sharpness)
        return CentralizedMotion(self.frequency, self.phase, satellites, self.weights, self.rest, seconds, loop)


class CentralizedNetwork(NamedMotions[CentralizedMotion]):
    """Plays centralized motions frame by frame; fits `base.FrameNetwork`.

    Args:
        motions: what it plays, all with the same channels.
        rate: frames per second.
    """

    def __init__(self, motions: dict[str, CentralizedMotion], rate: float) -> None:
        if len({len(motion.rest) for motion in motions.values()}) != 1:
            raise MotiondeckError("a centralized network needs motions, all with the same number of channels")
        super().__init__(motions)
        self.rate = rate
        self.channels = len(motions[self.motions[0]].rest)
        self._passage = Passage(len(motions))
        self._mixed = np.zeros(self.channels)
        self._entries = Entries(motions, {name: self._anchor_times(name) for name in self.motions})
        self.cue(self.motions[0], 0)

    def twin(self) -> CentralizedNetwork:
        """The same weights with a state of its own: what one player does, another does not see."""
        return CentralizedNetwork(self._of, self.rate)

    def joined(self, other: CentralizedNetwork) -> CentralizedNetwork:
        """The motions of both."""
        return CentralizedNetwork(self._of | other._of, self.rate)

    @property
    def neurons(self) -> int:
        """How many centers and satellites all motions have together."""
        return sum(len(part.frequency) + len(part.satellites) for part in self._of.values())

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self[motion].at(self._anchor_times(motion))

    def _anchor_times(self, motion: str) -> Array:
        part = self[motion]
        frames = round(part.seconds * self.rate) + (not part.loop)
        return np.arange(0, frames, ANCHOR_EVERY) / self.rate

    def recall(self, motion: str) -> Channels:
        """What the readout gives at the anchors: the same, for there is no state that could stray."""
        return self.anchors(motion)

    def cue(self, motion: str, anchor: int) -> None:
        """Goes to an anchor; the next `advance` gives the frame after it."""
        self._voice = Voice(self[motion], anchor * ANCHOR_EVERY / self.rate)
        self._source: Voice | None = None
        self._passage.module.reset(self.motions.index(motion))

    def cross(self, motion: str, entries: int) -> int:
        """Goes over from what is played to one of the first anchors of a motion, by the switching module.

        It is the anchor after which the motion is most like what would have come.
        """
        source, part = self._voice, self[motion]
        anchor = self._entries.best(source.motion, source.time, motion, entries)
        self._voice = Voice(part, anchor * ANCHOR_EVERY / self.rate)
        self._source = source
        self._passage.begin(self.motions.index(motion))
        return anchor

    @property
    def crossing(self) -> bool:
        """Whether it is crossing to another motion."""
        return self._source is not None

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        dt = 1.0 / self.rate
        self._voice.advance(dt)
        self._voice.read(out)
        if self._source is None:
            return
        if not self._passage.advance(dt):
            self._source = None
            return
        self._source.advance(dt)
        self._source.read(self._mixed)
        mix(self._passage.share, self._mixed, out)

    def snapshot(self) -> tuple[Voice, Voice | None, tuple[object, float, float]]:
        """A copy of the state."""
        source = self._source.copy() if self._source is not None else None
        return self._voice.copy(), source, self._passage.snapshot()

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        voice, source, passage = snapshot
        self._voice = voice.copy()
        self._source = source.copy() if source is not None else None
        self._passage.restore(passage)
