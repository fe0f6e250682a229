"""How large a phase-driven network has to be: the smallest that plays every motion to within a tolerance.

What a library stores grows with N k for each piece, and its error falls with both; sizes are tried from the smallest
on, which cost least.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from controller.measures.self_test import Judge, self_test
from controller.mocap.encodings.normalisation import Normalisation
from controller.training.preparation.training_motion import TrainingMotion
from controller.training.reservoirs.phase_training import PhaseRecipe, train_phase_conceptors

# N and k; what is stored grows by about 1.4 from one to the next.
SIZES = ((80, 20), (110, 25), (150, 28), (200, 32), (250, 36), (300, 40), (360, 46), (440, 54), (540, 62), (660, 72))


def smallest_within(
    tolerance_mm: float,
    motions: list[TrainingMotion],
    normalisation: Normalisation,
    recipe: PhaseRecipe,
    rate: float,
    seed: int,
    judge: Judge,
    progress: Callable[[str], None] = lambda _: None,
) -> PhaseRecipe:
    """The recipe with the smallest of SIZES whose network passes every motion, none further off than a tolerance.

    Args:
        tolerance_mm: the mean distance of joints at the same phase that any motion may have.
        motions: what is learned.
        normalisation: between their channels and the encoding's units.
        recipe: its other parameters stay.
        rate: frames per second.
        seed: of everything random.
        judge: knows what was recorded.
        progress: is told each size that is tried.

    Returns:
        The recipe; that of the largest size, where no size keeps to the tolerance.
    """
    sized = recipe
    for neurons, rank in SIZES:
        progress(f"trying {neurons} neurons, rank {rank}")
        sized = msgspec.structs.replace(recipe, neurons=neurons, rank=rank)
        verdicts = self_test(train_phase_conceptors(motions, normalisation, sized, rate, seed), judge)
        if all(verdict.passed and verdict.error_mm <= tolerance_mm for verdict in verdicts.values()):
            break
    return sized
