"""A phase-driven echo-state network: a center drives the reservoir, and every motion reads it out for itself.

The reservoir of an echo-state network (Deliallisi 2017, eq. 3.4 with a = 1) is fed the phase phi of a harmonic center
(Vakulenko et al. 2017, eq. 1) instead of fed-back output:

    x(n+1)  = tanh(W x(n) + W_phi p(phi(n+1)) + b)
    y(n)    = R x(n) + r

W, W_phi and b are drawn from a seed and shared; R and r belong to a motion, or to a piece of a long one. Nothing is fed
back, so with a spectral radius below 1 the state forgets where it began, and with it every disturbance. Phase, pieces,
tempo and inputs besides the phase are those of `phase_driven`.

A small library stores no R. It has as many functions of the phase as a motion has keys (`networks.keys`), each a
spline that the states are read out for, and R is their sum with the keys as factors: the ridge regression of the frames
that the keys draw, which is solved when the motion is loaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.encodings.normalisation import Normalisation
from controller.networks.keys import Keys
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion, PhasePlayer, stored_course
from controller.networks.reservoirs.phase_reservoir import Float32, PhaseCourse, PhaseReservoir
from controller.networks.ridge import learn_readouts
from controller.networks.storage import DrivingInput, MotionHeader, StoredNetwork, arrays_of

KEYED_RIDGE = 1e-5  # gamma of readouts that keys stand for


@dataclass(frozen=True)
class StoredReadouts:
    """A motion as a library keeps it: P pieces in N neurons, with C channels."""

    readout: Float32  # (R, r) in the units of the encoding, shape (P, C, N + 1)
    keys: Keys | None = None  # that it was learned from and is stored by


class PhaseEchoStateMotion(PhaseMotion):
    """One motion, ready to be played."""

    def __init__(
        self,
        stored: StoredReadouts,
        course: PhaseCourse,
        reservoir: PhaseReservoir,
        driving: DrivingInput | None = None,
    ) -> None:
        super().__init__(stored, course, reservoir, driving)
        # W_phi p + b at each frame and before, shape (T + SETTLING_STEPS, N).
        self.driven = reservoir.harmonics_of(course.with_lead_in[0]) @ reservoir.phase_weights.T + reservoir.bias
        self.drive = reservoir.drive_weights.sum(1)  # W_u, shape (N,)
        self.recurrent = reservoir.weights.T

    @classmethod
    def unread(
        cls, channels: int, course: PhaseCourse, reservoir: PhaseReservoir, driving: DrivingInput | None = None
    ) -> Self:
        """A motion whose readouts are still to be learned."""
        shape = (int(course.piece[-1]) + 1, channels, len(reservoir.bias) + 1)
        return cls(StoredReadouts(np.zeros(shape, dtype=np.float32)), course, reservoir, driving)

    def reading(self, keys: Keys) -> PhaseEchoStateMotion:
        """The motion with the readouts that keys stand for."""
        states, frames, piece = self.settled_frames(keys.drawn(len(self), loop=self.course.loop))
        stored = StoredReadouts(learn_readouts(states, piece, frames, KEYED_RIDGE), keys)
        motion = PhaseEchoStateMotion(stored, self.course, self.reservoir)
        vars(motion)["states"] = self.states
        return motion

    def player(self, frame: int, state: Float32, level: float, runs: tuple[int, ...] = ()) -> PhaseEchoStatePlayer:
        return PhaseEchoStatePlayer(self, frame, state, level, runs)


class PhaseEchoStatePlayer(PhasePlayer[PhaseEchoStateMotion]):
    """A motion while it plays; its state is x."""

    def step(self, frame: int, noise: Float32 | None = None) -> None:
        motion, hidden = self.motion, self.activation
        self.state.dot(motion.recurrent, hidden)  # as a method: np.dot first looks for other kinds of arrays
        np.add(hidden, motion.driven[frame], out=hidden)
        if motion.driving is not None:
            np.add(hidden, np.float32(self.level) * motion.drive, out=hidden)
        np.tanh(hidden, out=hidden)
        self.state[...] = hidden
        if noise is not None:
            self.state += noise
        self.frame = frame

    def displace(self, noise: Float32) -> None:
        self.state += noise


class PhaseEchoStateNetwork(PhaseDrivenNetwork[PhaseEchoStateMotion]):
    """Plays motions with a phase-driven echo-state network frame by frame; fits `base.PhaseNetwork`."""

    kind = "phase-echo-state"

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The stored arrays by name; no normalisation, which keys do without, if all motions have keys."""
        alone = all(self[name].stored.keys is not None for name in self.motions)
        found = {} if alone else arrays_of(self.normalisation, "")
        for name in self.motions:
            stored, at = self[name].stored, f"motion/{name}/"
            held = {at + "held": np.array([self[name].course.held], dtype=np.int32), at + "readout": stored.readout}
            found |= held if stored.keys is None else arrays_of(stored.keys, at)
        return found

    @classmethod
    def load_normalisation(cls, stored: StoredNetwork) -> Normalisation:
        if any(f"motion/{motion.name}/readout" in stored.stored for motion in stored.header.motions):
            return stored.normalisation()
        return Normalisation(np.zeros(stored.channels), np.ones(stored.channels))

    @classmethod
    def load_motion(
        cls, stored: StoredNetwork, motion: MotionHeader, sizes: dict[str, int], reservoir: PhaseReservoir
    ) -> PhaseEchoStateMotion:
        own, at, loop = sizes | {"e": sizes["n"] + 1}, f"motion/{motion.name}/", motion.plays == "loop"
        if at + "packed" in stored.stored:
            keys = Keys.load(stored, at, motion.frames)
            _, held, _, pieces = keys.course.tolist()
            course = PhaseCourse.of(motion.frames, pieces, loop=loop, held=held)
            return PhaseEchoStateMotion.unread(own["c"], course, reservoir).reading(keys)
        readouts = StoredReadouts(stored.read(at, own, readout="pce")["readout"])
        return PhaseEchoStateMotion(readouts, stored_course(stored, motion, own["p"]), reservoir, motion.input)


KIND = PhaseEchoStateNetwork
