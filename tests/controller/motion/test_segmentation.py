"""Borders are found where a motion changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.recognition.border_score import BorderScore, score_borders
from benchmarks.recognition.segment_labels import read_labels
from controller.motion.formats.reading import read_clip
from controller.motion.segmentation import body_features, find_segments
from motiondeck_base.errors import FileFormatError


def three_motions(seed, ends, columns=24):
    """Motions that each live in a plane of their own."""
    rng = np.random.default_rng(seed)
    pieces, first = [], 0
    for end in ends:
        t = np.arange(first, end) / 120.0
        latent = np.sin(np.multiply.outer(t, rng.uniform(3, 9, 3)) + rng.uniform(0, 6, 3))
        pieces.append(latent @ rng.normal(size=(3, columns)))
        first = end
    return np.concatenate(pieces) + 0.01 * rng.normal(size=(ends[-1], columns))


@settings(max_examples=10)
@given(st.integers(0, 50), st.integers(20, 40), st.integers(20, 40), st.booleans())
def test_borders_are_found_where_the_plane_changes(seed, one, two, told):
    ends = [12 * one, 12 * (one + two), 12 * (one + two + 30)]
    segments = find_segments(three_motions(seed, ends), 120.0, 3 if told else None)
    assert len(segments) == 3
    assert np.abs(np.array([end for _, end in segments]) - ends).max() <= 12


def test_what_is_too_short_is_refused():
    with pytest.raises(FileFormatError, match=r"2.5 s cannot be cut into 3"):
        find_segments(np.random.default_rng(0).normal(size=(300, 6)), 120.0, 3)
    with pytest.raises(FileFormatError, match="into 0"):
        find_segments(np.zeros((500, 6)), 120.0, 0)
    with pytest.raises(FileFormatError, match=r"0\.2 s"):
        find_segments(np.zeros((20, 6)), 120.0)


@pytest.fixture(scope="module")
def clip(mocap_data):
    return read_clip(mocap_data / "cmu/86/86_01.amc")


@pytest.mark.thorough
def test_a_recorded_sequence_is_cut_where_people_cut_it(mocap_data, clip):
    marked = read_labels(mocap_data / "cmu/86/labels/barbic_01_ground_truth.txt").borders
    features = body_features(clip)

    def score(count=None):
        segments = find_segments(features, clip.rate, count)
        return score_borders(np.array([end for _, end in segments[:-1]]), marked)

    assert score(7) == BorderScore(6, 6, 6)
    assert score().f1 >= 0.8


def test_features_do_not_see_where_a_body_stands_or_faces(clip):
    features = body_features(clip)
    # Root and its height aside, nothing is further from the root than a body is tall.
    assert np.abs(features[:, 3 : features.shape[1] // 2]).max() < 2.5
