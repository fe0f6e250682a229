"""The search finds the frequencies a motion was made with, and refuses what it cannot do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.papers.frequency_search import (
    Candidate,
    FrequencySearch,
    frequency_grid,
    principal_scores,
    readout,
    sines_at,
)
from controller.networks.centralized.satellites import GaussianSatellites, grid_places, spacing
from motiondeck_base.errors import MotiondeckError

TIME = np.arange(600) / 120.0


def made_with(frequency, places, seed=0):
    rng = np.random.default_rng(seed)
    sharpness = np.full(len(places), 1.0 / spacing(len(frequency), len(places)))
    response = GaussianSatellites(places, sharpness).respond(sines_at(frequency, TIME))
    return response @ rng.normal(size=(len(places), 6)), float(sharpness[0])


@settings(max_examples=6)
@given(st.integers(0, 25), st.integers(1, 25), st.integers(0, 9))
def test_the_grid_finds_the_pair_a_motion_was_made_with(slow, above, seed):
    grid = frequency_grid(5.0, 40)
    chosen = grid[[slow, min(39, slow + above + 2)]]
    target, sharpness = made_with(chosen, grid_places(2, 25), seed)
    found = FrequencySearch(target, TIME, grid_places(2, 25)).exhaustive(grid, sharpness)
    assert len(found) == 40 * 39 // 2
    assert np.allclose(found[0].frequency, chosen)
    assert found[0].error < 1e-6
    assert [c.error for c in found] == sorted(c.error for c in found)


def test_one_center_is_searched_alone():
    grid = frequency_grid(5.0, 30)
    target, sharpness = made_with(grid[[7]], grid_places(1, 9))
    assert FrequencySearch(target, TIME, grid_places(1, 9)).exhaustive(grid, sharpness)[0].frequency == grid[7]


def test_random_search_and_refinement_only_get_better():
    truth = np.array([1.7, 4.0, 9.0])
    places = grid_places(3, 27)
    target, sharpness = made_with(truth, places)
    search = FrequencySearch(target, TIME, places)
    found = search.at_random(1.2, 12.0, 300, sharpness, seed=3)
    assert [c.frequency.tolist() for c in found] == [
        c.frequency.tolist() for c in search.at_random(1.2, 12.0, 300, sharpness, seed=3)
    ]
    near = Candidate(truth * 1.01, sharpness, search.judge(truth * 1.01, sharpness))
    refined = search.refine(near, 200)
    assert refined.error < 0.2 * near.error
    assert search.refine(found[0]).error <= found[0].error


def test_both_ways_of_judging_agree():
    grid, places = frequency_grid(5.0, 12), grid_places(2, 16)
    target = np.random.default_rng(0).normal(size=(600, 4)).cumsum(0)
    search = FrequencySearch(target, TIME, places)
    for candidate in search.exhaustive(grid, 1.5)[:20]:
        assert search.judge(candidate.frequency, 1.5) == pytest.approx(candidate.error, rel=1e-6)


def test_principal_scores_keep_every_distance():
    target = np.random.default_rng(0).normal(size=(200, 5)) @ np.random.default_rng(1).normal(size=(5, 93))
    scores = principal_scores(target)
    assert scores.shape == (200, 40)
    assert np.allclose(scores @ scores.T, target @ target.T)


def test_the_readout_is_the_best_there_is():
    rng = np.random.default_rng(0)
    response, weights = rng.normal(size=(50, 7)), rng.normal(size=(3, 7))
    assert np.allclose(readout(response, response @ weights.T), weights)


def test_what_cannot_be_searched_is_refused():
    with pytest.raises(MotiondeckError, match="25 satellites cannot be learned from 20 frames"):
        FrequencySearch(np.ones((20, 3)), TIME[:20], grid_places(2, 25))
    with pytest.raises(MotiondeckError, match="3 centers"):
        FrequencySearch(np.ones((200, 3)), TIME[:200], grid_places(3, 27)).exhaustive(frequency_grid(2.0, 5), 1.0)
    with pytest.raises(MotiondeckError, match="center 0"):
        FrequencySearch(np.ones((200, 3)), TIME[:200], grid_places(1, 5)).exhaustive(np.array([-1.0]), 1.0)
    with pytest.raises(MotiondeckError, match="9 satellites"):
        readout(np.ones((5, 9)), np.ones((5, 2)))
