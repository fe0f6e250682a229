"""The smallest phase-driven network that keeps to a tolerance."""

import numpy as np
import pytest

import synthetic
from controller.learning.measures.self_test import self_test
from controller.learning.preparation.training_motion import Lessons
from controller.learning.trainers.phase_conceptor import PhaseConceptorTrainer
from controller.learning.trainers.phase_echo_state import PhaseEchoStateTrainer


class Conceptors(PhaseConceptorTrainer):
    sizes = ({"neurons": 20, "rank": 4}, {"neurons": 60, "rank": 12}, {"neurons": 120, "rank": 25})


class EchoState(PhaseEchoStateTrainer):
    sizes = ({"neurons": 40}, {"neurons": 120})


def chosen(tolerance, trainer, **changes):
    motions, normalisation = synthetic.lessons()
    judge = synthetic.judge()
    lessons = Lessons(motions, normalisation, synthetic.RATE)
    recipe = trainer.recipe(tolerance_mm=tolerance, **changes)
    recipe = trainer.sized(recipe, lessons, 0, judge, lambda _: None)
    verdicts = self_test(synthetic.trained(recipe, motions, normalisation), judge)
    return recipe, max(verdict.error_mm for verdict in verdicts.values())


def sized(trainer, recipe):
    return {name: getattr(recipe, name) for name in trainer.sizes[0]}


def test_a_network_is_as_large_as_the_tolerance_asks_for():
    trainer = Conceptors()
    loose, loose_error = chosen(20.0, trainer, piece_seconds=2.0)
    tight, tight_error = chosen(0.5 * loose_error, trainer, piece_seconds=2.0)
    assert loose.piece_seconds == 2.0
    assert loose_error <= 20.0
    assert tight_error <= 0.5 * loose_error
    assert sized(trainer, loose) in trainer.sizes[:2]
    assert tight.neurons > loose.neurons


@pytest.mark.parametrize(("tolerance", "neurons"), [(120.0, 40), (0.5, 120)])
def test_an_echo_state_network_has_the_neurons_that_its_tolerance_asks_for(tolerance, neurons):
    motions, normalisation = synthetic.lessons()
    lessons = Lessons(motions, normalisation, synthetic.RATE)
    recipe = EchoState.recipe(tolerance_mm=tolerance)
    sized = EchoState().sized(recipe, lessons, 0, synthetic.judge(), lambda _: None)
    assert (sized.neurons, sized.ridge, sized.tolerance_mm) == (neurons, recipe.ridge, tolerance)


def test_the_largest_is_taken_where_none_will_do():
    recipe, error = chosen(1e-9, Conceptors())
    assert sized(Conceptors, recipe) == Conceptors.sizes[-1]
    assert np.isfinite(error)
