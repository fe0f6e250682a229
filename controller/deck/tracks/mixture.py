"""A mixture: plays one motion of a network, or two whose weights change smoothly.

Every network can be mixed in two ways:

- inside: the network itself plays the mixture, as its paper defines it (see `morph`);
- dual run: both motions are played side by side and their frames are mixed.

    y = (1 - mu) y_i + mu y_j
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.networks.base import Channels, FrameNetwork
from controller.networks.centralized.centralized_frames import CentralizedNetwork
from controller.networks.reservoirs.morph import Morph, ReservoirNetwork, morph
from controller.networks.reservoirs.phase_conceptor import PhaseConceptorNetwork
from controller.quintic import rise

AHEAD = 3
"""Frames by which a player is ahead of its output."""


class Mixture:
    """Plays a network alone or a mixture of two of its motions; fits `base.FrameNetwork`.

    Args:
        network: plays one motion alone, perhaps guarded.
        core: the same network without the guard; it plays mixtures.

    Attributes:
        motion: the motion that is played, or the first of the two.
        other: the second of the two, or "".
        anchor: the anchor of that motion nearest to where it continues alone after a mixture.
    """

    def __init__(
        self, network: FrameNetwork, core: ReservoirNetwork | PhaseConceptorNetwork | CentralizedNetwork
    ) -> None:
        self.motions, self.channels = network.motions, network.channels
        self._network, self._core = network, core
        self._pair = core.twin(), core.twin()
        self.motion = self.motions[0]
        self.anchor = 0
        self._end()

    @property
    def weight(self) -> float:
        """The weight of the second motion."""
        return self._weight

    @property
    def mixed(self) -> bool:
        """Whether two motions are played."""
        return self._morph is not None

    @property
    def reached_output(self) -> bool:
        """Whether the change of the weight has reached the player's output."""
        return self._frames > AHEAD

    @property
    def crossing(self) -> bool:
        """Whether the weight is still changing in the player's output."""
        return self._morph is not None and self._frames < self._length + AHEAD

    def anchors(self, motion: str) -> Channels:
        """The frames at the anchors of a motion, shape (anchors, channels)."""
        return self._network.anchors(motion)

    def cue(self, motion: str, anchor: int) -> None:
        """Plays one motion alone from an anchor on."""
        self._network.cue(motion, anchor)
        self.motion = motion
        self._end()

    def mix(self, other: str, weight: float, frames: int, anchor: int, *, inside: bool = True) -> None:
        """Mixes another motion in until it has a weight in [0, 1], within so many frames.

        At 1 the other motion continues alone, at 0 the first one does.

        Args:
            other: the motion; while two are mixed already, the second of them.
            weight: its final weight.
            frames: how long the change takes.
            anchor: of the other motion, where it begins when both are played side by side.
            inside: whether the network itself plays the mixture, where it can: a centralized one has no other way.

        Raises:
            UnknownNameError: if there is no such motion.
        """
        if self._morph is None:
            if inside and isinstance(self._core, ReservoirNetwork):
                self._morph = morph(self._core, self.motion, other)
            else:
                self._morph = self._dual(other, anchor)
            self.other = other
        self._from, self._to, self._frames, self._length = self._weight, weight, 0, max(1, frames)

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        if self._morph is None:
            self._network.advance(out)
            return
        self._frames += 1
        passed = min(1.0, self._frames / self._length)
        self._weight = self._from + (self._to - self._from) * rise(passed)
        self._morph.advance(self._weight, out)
        if self._to in (0.0, 1.0) and self._frames >= self._length + AHEAD:
            self._continue_alone(out)

    def snapshot(self) -> Any:
        """A copy of the state, while one motion plays alone."""
        return self._network.snapshot(), self.motion

    def restore(self, snapshot: Any) -> None:
        """Puts the state back to a snapshot."""
        state, self.motion = snapshot
        self._network.restore(state)
        self._end()

    def _dual(self, other: str, anchor: int) -> DualRun:
        leaving, entering = self._pair
        leaving.restore(self._core.snapshot())
        entering.cue(other, anchor)
        return DualRun(self._core, leaving, entering)

    def _continue_alone(self, frame: Channels) -> None:
        """Leaves one motion playing, and cues a guard to where it is."""
        assert self._morph is not None
        if self._to == 1.0:
            self._morph.settle()
            self.motion = self.other
        else:
            self._morph.give_up()
        state = self._core.snapshot()
        self.anchor = int(np.square(self._core.anchors(self.motion) - frame).sum(1).argmin())
        self.cue(self.motion, self.anchor)
        self._core.restore(state)

    def _end(self) -> None:
        self._morph: Morph | None = None
        self.other = ""
        self._weight = self._from = self._to = 0.0
        self._frames = self._length = 0


class DualRun:
    """Two runs side by side, their frames mixed; fits `morph.Morph`.

    Args:
        network: what plays the second motion alone in the end.
        leaving, entering: its twins, each playing a motion.
    """

    def __init__(self, network: FrameNetwork, leaving: FrameNetwork, entering: FrameNetwork) -> None:
        self._network, self._leaving, self._entering = network, leaving, entering
        self._frames = np.zeros((2, network.channels))

    def advance(self, mu: float, out: Channels) -> None:
        """Steps both one frame on and writes their mixture into out."""
        first, second = self._frames
        self._leaving.advance(first)
        self._entering.advance(second)
        out[:] = (1.0 - mu) * first + mu * second

    def settle(self) -> None:
        """Leaves the network playing the second motion alone."""
        self._network.restore(self._entering.snapshot())

    def give_up(self) -> None:
        """Leaves it playing the first one alone."""
        self._network.restore(self._leaving.snapshot())
