"""A marker is predicted from the others by principal components."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.learning.centralized.reconstruction import KEPT, by_components

FRAMES, OTHERS, MODES = 200, 30, 2
MISSING = np.arange(FRAMES) // 50 == 2


def dancing(seed):
    """Markers (K, M + 1, 3), m, that move together on a few waves; the last one is the one that is lost."""
    draw = np.random.default_rng(seed)
    rest = draw.normal(0.0, 0.4, (OTHERS + 1, 3))
    waves = np.sin(np.outer(np.linspace(0.0, 9.0, FRAMES), draw.uniform(2.0, 5.0, MODES)) + draw.uniform(0, 6, MODES))
    return rest + np.einsum("kw,wmc->kmc", waves, draw.normal(0.0, 0.1, (MODES, OTHERS + 1, 3)))


@pytest.mark.parametrize("kept", KEPT)
@given(seed=st.integers(0, 300))
def test_a_marker_that_moves_with_the_others_is_found_again(kept, seed):
    whole = dancing(seed)
    found = by_components(whole[:, :-1], whole[:, -1], MISSING, kept)
    off, moves = np.abs(found - whole[:, -1])[MISSING], whole[:, -1].std(0).max()
    assert off.mean() < 0.01 * moves


@given(seed=st.integers(0, 200), unit=st.sampled_from([0.01, 1000.0]))
def test_the_unit_does_not_matter_nor_what_stands_in_the_gap(seed, unit):
    whole = dancing(seed)
    lost = np.where(MISSING[:, None], np.nan, whole[:, -1])
    one = by_components(whole[:, :-1], whole[:, -1], MISSING, 0.99)
    other = by_components(unit * whole[:, :-1], unit * lost, MISSING, 0.99)
    assert np.allclose(other, unit * one, rtol=1e-6, atol=1e-6 * unit)


def test_markers_nearby_count_more():
    """The one beside it goes as it does, a distant one goes otherwise though it did the same before."""
    whole = dancing(3)
    whole[:, 0] = whole[:, -1] + [0.02, 0.0, 0.0]
    whole[:, 1] = whole[:, -1] + [0.0, 0.0, 3.0]
    whole[MISSING, 1] += 0.2
    found = by_components(whole[:, :-1], whole[:, -1], MISSING, 0.99)
    assert np.abs(found - whole[:, -1])[MISSING].mean() < 0.03


def test_markers_that_stand_still_are_predicted_where_they_stand():
    whole = np.tile(np.random.default_rng(1).normal(size=(1, 6, 3)), (40, 1, 1))
    found = by_components(whole[:, :-1], whole[:, -1], np.arange(40) > 30, 0.99)
    assert np.allclose(found, whole[:, -1], atol=1e-9)
