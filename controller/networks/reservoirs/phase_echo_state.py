"""A phase-driven echo-state network: a center drives the reservoir, and every motion reads it out for itself.

The reservoir of an echo-state network (Deliallisi 2017, eq. 3.4 with a = 1) is fed the phase phi of a harmonic center
(Vakulenko et al. 2017, eq. 1) instead of its own output:

    x(n+1)  = tanh(W x(n) + W_phi p(phi(n+1)) + b)
    y(n)    = R x(n) + r

W, W_phi and b are drawn from a seed and shared; R and r belong to a motion, or to a piece of a long one. Nothing is fed
back, so with a spectral radius below 1 the state forgets where it began, and with it every disturbance. Phase, pieces,
tempo and inputs besides the phase are those of `phase_driven`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.networks.reservoirs.driving_input import DrivingInput
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion, PhaseVoice
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir


@dataclass(frozen=True)
class StoredReadouts:
    """A motion as a library keeps it: P pieces in N neurons, with C channels.

    Attributes:
        readout: (R, r) in the units of the encoding, shape (P, C, N + 1).
    """

    readout: Float32


class PhaseEchoStateMotion(PhaseMotion):
    """One motion, ready to be played.

    Args:
        stored: its readouts.
        course: of its phase.
        reservoir: the weights that it shares with others.
        driving: its input besides the phase, if it has one.

    Attributes:
        driven: W_phi p + b at each frame, shape (T, N).
        drive: W_u, shape (N,).
    """

    def __init__(
        self,
        stored: StoredReadouts,
        course: PhaseCourse,
        reservoir: PhaseReservoir,
        driving: DrivingInput | None = None,
    ) -> None:
        super().__init__(stored, course, reservoir, driving)
        self.driven = reservoir.harmonics_of(course.phase) @ reservoir.phase_weights.T + reservoir.bias
        self.drive = reservoir.drive_weights.sum(1)
        self.settle()

    def voice(self, frame: int, state: Float32, level: float) -> PhaseEchoStateVoice:
        """What plays it from a frame on, in a state, its input at a level."""
        return PhaseEchoStateVoice(self, frame, state, len(state), level)


class PhaseEchoStateVoice(PhaseVoice[PhaseEchoStateMotion]):
    """A motion while it plays; its state is x."""

    def step(self, frame: int) -> None:
        """Goes on to a frame whose phase is near the present one."""
        motion, hidden = self.motion, self.activation
        np.dot(motion.reservoir.weights, self.state, out=hidden)
        np.add(hidden, motion.driven[frame], out=hidden)
        if motion.driving is not None:
            np.add(hidden, np.float32(self.level) * motion.drive, out=hidden)
        np.tanh(hidden, out=hidden)
        np.copyto(self.state, hidden)
        self.frame = frame


class PhaseEchoStateNetwork(PhaseDrivenNetwork[PhaseEchoStateMotion]):
    """Plays motions with a phase-driven echo-state network frame by frame; fits `base.InputNetwork`."""
