"""Trains phase-driven echo-state networks: ridge readouts from the states that follow from the phase alone.

The channels are not fed back, so the states in playing are known before training, and one regression a piece suffices.
"""

import numpy as np

from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.trainers.phase_driven import MotionByMotionTrainer, PhaseDrivenRecipe, course_of
from controller.networks.phase_echo_state.network import PhaseEchoStateMotion, PhaseEchoStateNetwork, StoredReadouts
from controller.networks.reservoirs.phase_reservoir import PhaseReservoir


class PhaseEchoStateRecipe(PhaseDrivenRecipe, frozen=True, kw_only=True, tag="phase-echo-state"):
    """The parameters of a phase-driven echo-state network: those that both kinds have."""

    neurons: int = 100
    harmonics: int = 4
    spectral_radius: float = 0.9
    drive_scale: float = 0.2  # with 1 a motion between two values overshoots by a fifth


class PhaseEchoStateTrainer(MotionByMotionTrainer[PhaseEchoStateRecipe]):
    """Trains phase-driven echo-state networks."""

    recipe = PhaseEchoStateRecipe
    plays = PhaseEchoStateNetwork
    sizes = tuple({"neurons": neurons} for neurons in (20, 28, 40, 55, 75, 100, 140, 200, 280, 400))

    def unread(
        self, recipe: PhaseEchoStateRecipe, motion: TrainingMotion, reservoir: PhaseReservoir, rate: float
    ) -> PhaseEchoStateMotion:
        course = course_of(motion, recipe.piece_seconds * rate)
        shape = (int(course.piece[-1]) + 1, motion.frames.shape[1], recipe.neurons + 1)
        stored = StoredReadouts(np.zeros(shape, dtype=np.float32))
        return PhaseEchoStateMotion(stored, course, reservoir, motion.driving)


TRAINER = PhaseEchoStateTrainer()
