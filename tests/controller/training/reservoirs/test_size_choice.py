"""The smallest phase-driven network that keeps to a tolerance."""

import numpy as np

import synthetic
from controller.measures.self_test import Judge, self_test
from controller.training.reservoirs import size_choice
from controller.training.reservoirs.phase_training import PhaseRecipe, train_phase_conceptors

SIZES = ((20, 4), (60, 12), (120, 25))


def chosen(tolerance, monkeypatch):
    monkeypatch.setattr(size_choice, "SIZES", SIZES)
    motions, normalisation = synthetic.lessons()
    loops = {name: name != "bow" for name in synthetic.MOTIONS}
    judge = Judge(synthetic.small_encoding(), synthetic.references(), loops, synthetic.RATE)
    recipe = size_choice.smallest_within(
        tolerance, motions, normalisation, PhaseRecipe(aperture=20.0), synthetic.RATE, 0, judge
    )
    verdicts = self_test(train_phase_conceptors(motions, normalisation, recipe, synthetic.RATE, 0), judge)
    return recipe, max(verdict.error_mm for verdict in verdicts.values())


def test_a_network_is_as_large_as_the_tolerance_asks_for(monkeypatch):
    loose, loose_error = chosen(20.0, monkeypatch)
    tight, tight_error = chosen(0.5 * loose_error, monkeypatch)
    assert loose.aperture == 20.0
    assert loose_error <= 20.0
    assert tight_error <= 0.5 * loose_error
    assert (loose.neurons, loose.rank) in SIZES[:2]
    assert tight.neurons > loose.neurons


def test_the_largest_is_taken_where_none_will_do(monkeypatch):
    recipe, error = chosen(1e-9, monkeypatch)
    assert (recipe.neurons, recipe.rank) == SIZES[-1]
    assert np.isfinite(error)
