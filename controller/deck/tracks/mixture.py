"""Plays one motion of a network, or lets the network itself morph into another (see `networks.reservoirs.morph`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.motion.quintic import rise
from controller.networks.base import AutonomousNetwork, Channels, FrameNetwork, Morph

AHEAD = 3
"""Frames by which a player is ahead of its output."""


class Mixture:
    """Plays a network alone or a mixture of two of its motions; fits `base.FrameNetwork`.

    Args:
        network: plays one motion alone, perhaps guarded.
        core: the same network without the guard; it plays mixtures.
    """

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
        """Morphs inside the network to another motion, within a number of frames.

        Raises:
            UnknownNameError: if there is no such motion.
        """
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

    def snapshot(self) -> Any:
        """A copy of the state, while one motion plays alone."""
        return self._network.snapshot(), self.motion

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        state, self.motion = snapshot
        self._network.restore(state)
        self._end()

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
