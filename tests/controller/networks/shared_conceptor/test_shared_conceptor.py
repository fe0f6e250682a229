"""Conceptors that share their weights: one prediction and one readout, and the conceptor selects the motion."""

import numpy as np
import pytest

import synthetic
from benchmarks.reservoirs.conceptor_selects import table
from controller.learning.trainers.phase_conceptor import RidgeSums
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.networks.phase_conceptor.network import PhaseConceptorMotion
from controller.networks.ridge import ridge

SMALL = {"neurons": 300, "rank": 30, "piece_seconds": 5.0, "readout": "shared"}


@pytest.fixture(scope="module")
def network():
    return synthetic.small_shared_conceptor(readout="shared")


def test_motions_differ_in_their_conceptors_alone(network):
    stored = network.arrays()
    own = {name.rpartition("/")[2] for name in stored if name.startswith("motion/")}
    assert own == {"directions", "strength", "mean", "held", "turn"}
    assert stored["shared/estimate"].shape == stored["shared/readout"].shape == (28, 301)


def test_each_reads_in_its_own_directions_where_that_is_asked():
    stored = synthetic.small_shared_conceptor().arrays()
    assert "shared/readout" not in stored
    assert stored["motion/wave/readout"].shape == (1, 28, 31)


def test_with_the_conceptor_of_another_motion_it_leaves_its_own(network):
    march, wave = network["march"], network["wave"]
    parts = march.course, march.reservoir, None, march.shared
    off = [np.abs(PhaseConceptorMotion(one.stored, *parts).read() - synthetic.march()).max() for one in (march, wave)]
    assert off[0] < 0.02
    assert off[1] > 0.3


def test_whatever_is_taken_away_or_exchanged_costs_a_factor_of_five():
    found = table(synthetic.training_set(), [1], SharedConceptorRecipe(**SMALL))
    learned = found.pop("as learned")
    assert {name for name, error in found.items() if error < 5.0 * learned} == set()


def test_sums_in_parts_are_the_ridge_regression_of_the_whole():
    rng = np.random.default_rng(3)
    states, targets = rng.normal(size=(60, 7)), rng.normal(size=(60, 2)) + 4.0
    sums = RidgeSums(7, 2)
    for part in np.split(np.arange(60), [10, 33]):
        sums.add(states[part], targets[part])
    found = sums.solve(0.5)
    centre, middle = states.mean(0), targets.mean(0)
    weights = ridge(states - centre, targets - middle, 0.5)
    np.testing.assert_allclose(found[:, :-1], weights, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(found[:, -1], middle - weights @ centre, rtol=1e-4)
