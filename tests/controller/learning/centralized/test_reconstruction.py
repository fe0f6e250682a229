"""Markers that are lost for a while are filled in from the others, where there is something to fill them in from."""

import numpy as np
import pytest

from benchmarks.papers.hidden_joints import fill_hidden
from controller.learning.centralized.reconstruction import fill_missing, gaps_of
from recordings import MARKER_RATE as RATE
from recordings import markers


@pytest.mark.thorough
def test_a_gap_is_filled_from_what_the_others_do():
    whole = markers()
    holes = whole.copy()
    holes[100:150, 2] = np.nan
    holes[270:, 4] = np.nan
    filled, gaps = fill_missing(holes, RATE)
    assert np.array_equal(filled[np.isfinite(holes)], holes[np.isfinite(holes)])
    missed = np.abs(filled - whole)
    straight = np.linspace(whole[99, 2], whole[150, 2], 52)[1:-1]
    assert missed[100:150, 2].mean() < 0.1 * np.abs(straight - whole[100:150, 2]).mean()
    assert missed[270:, 4].mean() < 0.1 * np.abs(whole[269, 4] - whole[270:, 4]).mean()
    assert [(g.marker, g.first, g.end, g.frames, g.filled) for g in gaps] == [
        (2, 100, 150, 50, True),
        (4, 270, 300, 30, True),
    ]
    assert all(g.expected is not None and g.expected < 10.0 for g in gaps)
    assert {g.by for g in gaps} <= {"network", "components"}


def test_the_error_is_expected_from_frames_that_were_seen():
    """Noise that nobody else knows of cannot be filled in, and is not promised."""
    whole = markers()
    whole[:, 2] += 30.0 * np.random.default_rng(0).normal(size=(300, 3))
    holes = whole.copy()
    holes[100:150, 2] = np.nan
    (gap,) = fill_missing(holes, RATE)[1]
    assert gap.expected is not None
    assert 15.0 < gap.expected < 50.0


def test_a_marker_that_only_goes_its_own_way_is_led_by_its_own_path():
    """The others jitter and say nothing of it, so the network has no say."""
    whole = markers() + 20.0 * np.random.default_rng(1).normal(size=(300, 8, 3))
    whole[:, 2] = np.linspace(0.0, 600.0, 300)[:, None]
    holes = whole.copy()
    holes[100:150, 2] = np.nan
    filled, (gap,) = fill_missing(holes, RATE)
    assert gap.by in {"line", "cubic"}
    assert np.allclose(filled[100:150, 2], whole[100:150, 2], atol=1e-6)


def test_nothing_missing_is_nothing_done():
    whole = markers(60)
    filled, gaps = fill_missing(whole, RATE)
    assert gaps == []
    assert np.array_equal(filled, whole)


def test_what_cannot_be_known_stays_open():
    holes = markers()
    holes[20:, 1] = np.nan  # hardly seen
    holes[130:150, 3:] = np.nan  # and only two of the others through this
    filled, gaps = fill_missing(holes, RATE)
    assert np.isnan(filled[130:150, 3:]).all()
    assert np.isnan(filled[20:, 1]).all()
    assert not any(gap.filled for gap in gaps)
    assert fill_missing(np.full((50, 4, 3), np.nan), RATE)[1] == gaps_of(np.full((50, 4, 3), np.nan))


def test_hidden_markers_are_counted_against_the_truth():
    found = fill_hidden(markers(), 2, [60, 200], 25, RATE)
    assert found.filled < 0.5 * found.cubic
    assert found.cubic < found.line
    assert found.line < found.mean


@pytest.mark.parametrize("lost", [(0, 10), (290, 300)])
def test_gaps_at_the_ends_meet_the_marker_on_one_side(lost):
    whole = markers()
    holes = whole.copy()
    holes[slice(*lost), 5] = np.nan
    filled, _ = fill_missing(holes, RATE)
    assert np.abs(filled - whole).max() < 10.0


def test_a_gap_in_markers_that_stand_still_is_filled():
    """A static trial: there is nothing to learn but where the marker was."""
    whole = np.tile(markers(1), (60, 1, 1))
    holes = whole.copy()
    holes[20:30, 2] = np.nan
    filled, (gap,) = fill_missing(holes, RATE)
    assert gap.filled
    assert np.allclose(filled, whole, rtol=0.0, atol=1e-6)
