"""How large a phase-driven network has to be: the smallest that plays every motion to within a tolerance.

What a library stores grows with the size and its error falls with it; sizes are tried from the smallest on, which cost
least.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from controller.learning.measures.self_test import Judge, self_test
from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.reservoirs.phase_training import PhaseDrivenRecipe, train_phase_driven
from controller.motion.encodings.normalisation import Normalisation

Recipe = TypeVar("Recipe", bound=PhaseDrivenRecipe)


def smallest_within(
    tolerance_mm: float,
    motions: list[TrainingMotion],
    normalisation: Normalisation,
    recipe: Recipe,
    rate: float,
    seed: int,
    judge: Judge,
    progress: Callable[[str], None] = lambda _: None,
) -> Recipe:
    """The recipe with the smallest of its sizes whose network passes every motion, none further off than a tolerance.

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
    for size in recipe.sizes:
        progress("trying " + ", ".join(f"{name} {value}" for name, value in size.items()))
        changes: Any = size
        sized = msgspec.structs.replace(recipe, **changes)
        verdicts = self_test(train_phase_driven(motions, normalisation, sized, rate, seed), judge)
        if all(verdict.passed and verdict.error_mm <= tolerance_mm for verdict in verdicts.values()):
            break
    return sized
