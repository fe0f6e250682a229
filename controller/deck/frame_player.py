"""From frames to continuous time: plays a frame network at any tempo.

Between two frames p1 and p2 it follows the cubic whose slopes there are (p2 - p0) / 2 and (p3 - p1) / 2 (Catmull-Rom),
so that velocities do not jump at a frame. The network runs two frames ahead of the output, without delay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.networks.base import Channels, CrossingNetwork, FrameNetwork

# Rows: the weights of p0 .. p3 for 1, u, u^2, u^3.
_CUBIC = 0.5 * np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]], dtype=np.float64)


@dataclass(frozen=True)
class PlayerState:
    """A copy of a player's whole state."""

    motion: str
    network: object
    frames: Channels
    fraction: float


class FramePlayer:
    """Plays a frame network in continuous time; fits `base.Generator`.

    Args:
        network: the network that is played.
        rate: the frames per second of its training.
    """

    def __init__(self, network: FrameNetwork, rate: float) -> None:
        self.network = network
        self.rate = rate
        self.motions = network.motions
        self._frames = np.zeros((4, network.channels))
        self._powers = np.ones(4)
        self._weights = np.zeros(4)
        self._out = np.zeros(network.channels)
        self.motion = self.motions[0]
        self.cue(self.motion)

    def cue(self, motion: str, phase: float = 0.0) -> None:
        """Starts a motion at a phase in [0, 1): at the anchor that comes last before it."""
        self.cue_anchor(motion, int(phase * len(self.network.anchors(motion))))

    def cue_anchor(self, motion: str, anchor: int) -> None:
        """Starts a motion at one of its anchors."""
        self.network.cue(motion, anchor)
        self.motion = motion
        self._fraction = 0.0
        self._frames[0] = self.network.anchors(motion)[anchor]
        for frame in self._frames[1:]:
            self.network.advance(frame)

    def cross(self, network: CrossingNetwork, motion: str, entries: int) -> int:
        """Has a network with a switching module cross to one of the first anchors of a motion; returns which."""
        self.motion = motion
        return network.cross(motion, entries)

    def step(self, dt: float) -> Channels:
        """Advances by dt >= 0 seconds; the channels there, shape (channels,), overwritten by the next step."""
        self._fraction += dt * self.rate
        while self._fraction >= 1.0:
            self._fraction -= 1.0
            for older, newer in zip(self._frames, self._frames[1:], strict=False):
                older[:] = newer
            self.network.advance(self._frames[3])
        u = self._fraction
        self._powers[1:] = u, u * u, u * u * u
        np.dot(self._powers, _CUBIC, out=self._weights)
        return np.dot(self._weights, self._frames, out=self._out)

    def snapshot(self) -> PlayerState:
        """A copy of the state: two runs from one snapshot are identical."""
        return PlayerState(self.motion, self.network.snapshot(), self._frames.copy(), self._fraction)

    def restore(self, playhead: PlayerState) -> None:
        """Puts the state back to a snapshot."""
        self.motion = playhead.motion
        self.network.restore(playhead.network)
        self._frames[:] = playhead.frames
        self._fraction = playhead.fraction
