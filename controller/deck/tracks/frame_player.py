"""From frames to continuous time: plays a frame network at any tempo.

Between two frames it follows a cubic, so that velocities do not jump at a frame. The network runs two frames ahead of
the output, without delay. One that a center drives also knows its phase, and is played backwards; then it runs two
frames behind.
"""

from __future__ import annotations

import numpy as np

from controller.motion.clip import CUBIC
from controller.networks.base import Channels, FrameNetwork
from motiondeck_base.errors import MotiondeckError, UnknownNameError


class FramePlayer:
    """Plays a frame network in continuous time, at the frames per second of its training; fits `base.Generator`.

    One that a center drives is also sent to any phase and played backwards. Players of one library may share anchors;
    one for a single motion needs those of no other.
    """

    def __init__(self, network: FrameNetwork, rate: float, beside: FramePlayer | None = None, only: str = "") -> None:
        self.network = network
        self.rate = rate
        self.pace = 1.0  # rate factor implied by the input
        self.motions = (only,) if only else network.motions
        # Found once, before the loop: some networks compute all of a motion's anchors at every question.
        self._anchors = beside._anchors if beside else {one: network.anchors(one) for one in self.motions}
        self._center = network.as_phase_network
        self._driven = self._center if self._center is not None and self._center.inputs else None
        self._frames = np.zeros((4, network.channels))
        self._phases = [0.0] * 4
        self._forwards = True
        self._powers = np.ones(4)
        self._weights = np.zeros(4)
        self._out = np.zeros(network.channels)
        self.motion = self.motions[0]
        self.cue(self.motion)

    def cue(self, motion: str, phase: float = 0.0) -> None:
        """Starts a motion at a phase in [0, 1]: there if a center drives it, or else at the last anchor before it."""
        if self._center is None:
            anchors = len(self.network.anchors(motion))
            self.cue_anchor(motion, min(int(phase * anchors), anchors - 1))
            return
        self._center.seek(motion, phase)
        begins = self._center.phase
        self._center.retreat(self._frames[0])
        first_of_all = self._center.phase == begins  # no frame comes before the first of a one-shot
        if first_of_all:
            self._frames[1] = self._frames[0]
        self._begin(motion, 1 + first_of_all)
        if first_of_all:
            self._frames[0] = 2.0 * self._frames[1] - self._frames[2]

    def cue_anchor(self, motion: str, anchor: int) -> None:
        """Starts a motion at one of its anchors."""
        if self._center is not None and anchor == 0:
            self.cue(motion)
            return
        self.network.cue(motion, anchor)
        self._frames[0] = self._anchors[motion][anchor]
        self._begin(motion)

    def _begin(self, motion: str, known: int = 1) -> None:
        self.motion, self._fraction, self._forwards = motion, 0.0, True
        if self._driven is not None:
            self.pace = self._driven.pace
        for place in range(known):
            self._note_phase(place)
        for place in range(known, 4):
            self._take(place)

    @property
    def phase(self) -> float:
        """How far it is: [0, 1) in a loop, 0 to 1 in a one-shot; MotiondeckError if the network does not know."""
        self.require_phase()
        before, after = self._phases[1], self._phases[2]
        way = after - before
        # A loop's phase falls from nearly 1 to 0 where it begins anew.
        way -= round(way)
        phase = before + self._fraction * way
        return phase % 1.0 if way and not 0.0 <= phase <= 1.0 else phase

    def step(self, dt: float) -> Channels:
        """Advances by dt s; the channels, overwritten by the next step. MotiondeckError if it cannot go back."""
        if dt < 0.0 or not self._forwards:
            self.require_phase()
            if dt and (dt > 0.0) != self._forwards:
                self._turn_round()
        self._fraction += abs(dt) * self.rate * self.pace
        while self._fraction >= 1.0:
            self._fraction -= 1.0
            self._frames[:3] = self._frames[1:]
            self._phases[:3] = self._phases[1:]
            self._take(3)
        u = self._fraction
        powers = self._powers
        powers[1], powers[2], powers[3] = u, u * u, u * u * u  # one by one, and `dot`: half as long on few numbers
        return powers.dot(CUBIC, self._weights).dot(self._frames, self._out)

    def _take(self, place: int) -> None:
        if self._forwards:
            self.network.advance(self._frames[place])
        elif self._center is not None:
            self._center.retreat(self._frames[place])
        self._note_phase(place)

    def _note_phase(self, place: int) -> None:
        if self._center is not None:
            self._phases[place] = self._center.phase

    def _turn_round(self) -> None:
        """Reverses the direction of play; the network has to get ahead of the output again."""
        self._forwards = not self._forwards
        self._fraction = 1.0 - self._fraction
        self._frames[:] = self._frames[::-1].copy()
        self._phases.reverse()
        if self._center is not None:
            # From the frame that is played towards: at an end of a one-shot the network waits, however long it is held.
            self._center.seek(self.motion, self._phases[2])
        self._take(3)

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        """The learned ranges of the network's inputs besides the phase, by name."""
        return self._driven.inputs if self._driven is not None else {}

    def set_input(self, name: str, value: float) -> None:
        """Changes an input; the next frames follow it. UnknownNameError if the network has no such input."""
        if self._driven is None:
            raise UnknownNameError(f"there is no input '{name}': no motion of this library was learned with one")
        self._driven.set_input(name, value)
        self.pace = self._driven.pace

    def require_phase(self) -> None:
        """Checks that a center drives the network; MotiondeckError if it runs by itself."""
        if self._center is None:
            raise MotiondeckError(
                "this library's network runs by itself: it has no phase to jump to or to lock, and cannot be played "
                'backwards. Learned from its recipe with type = "phase-conceptor" under [network], it has one'
            )
