"""Trains phase-driven echo-state networks."""

from __future__ import annotations

from controller.learning.reservoirs.phase_echo_state_training import PhaseEchoStateRecipe
from controller.learning.trainers.phase_driven import PhaseDrivenTrainer


class PhaseEchoStateTrainer(PhaseDrivenTrainer[PhaseEchoStateRecipe]):
    """Trains phase-driven echo-state networks."""

    recipe = PhaseEchoStateRecipe


TRAINER = PhaseEchoStateTrainer()
