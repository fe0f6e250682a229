"""Trains phase-driven conceptors."""

from __future__ import annotations

from controller.learning.reservoirs.phase_conceptor_training import PhaseRecipe
from controller.learning.trainers.phase_driven import PhaseDrivenTrainer


class PhaseConceptorTrainer(PhaseDrivenTrainer[PhaseRecipe]):
    """Trains phase-driven conceptors."""

    recipe = PhaseRecipe


TRAINER = PhaseConceptorTrainer()
