"""Borders are found where a motion changes."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.centralized.plane_segments import body_features, plane_segments
from benchmarks.recognition.border_score import BorderScore, score_borders
from benchmarks.recognition.segment_labels import read_labels
from controller.motion.formats.reading import read_clip
from controller.motion.take import segmentation
from controller.motion.take.segmentation import find_segments, poses_of, segments_of
from motiondeck_base.errors import FileFormatError

RATE = 30.0


def motions(seed, ends, columns=24):
    """Motions that each spread in directions of their own, m, at 30 Hz."""
    rng = np.random.default_rng(seed)
    pieces, first = [], 0
    for end in ends:
        t = np.arange(first, end) / RATE
        latent = np.sin(np.multiply.outer(t, rng.uniform(3, 9, 3)) + rng.uniform(0, 6, 3))
        pieces.append(0.2 * latent @ rng.normal(size=(3, columns)) + 0.1 * rng.normal(size=columns))
        first = end
    return np.concatenate(pieces) + 0.002 * rng.normal(size=(ends[-1], columns))


@settings(max_examples=10)
@given(st.integers(0, 50), st.integers(60, 120), st.integers(60, 120), st.booleans())
def test_borders_are_found_where_the_motion_changes(seed, one, two, told):
    ends = [2 * one, 2 * (one + two), 2 * (one + two + 90)]
    segments = find_segments(motions(seed, ends), RATE, 3 if told else None)
    assert len(segments) == 3
    assert np.abs(np.array([end for _, end in segments]) - ends).max() <= RATE * segmentation.SLOW_WITHIN + 3


@settings(max_examples=5)
@given(st.integers(0, 50), st.sampled_from([1, 2, 5, 9]))
def test_a_number_that_is_given_is_kept_to(seed, count):
    segments = find_segments(motions(seed, [300, 700]), RATE, count)
    assert len(segments) == count
    assert [first for first, _ in segments[1:]] == [end for _, end in segments[:-1]]


def test_one_motion_is_not_cut_however_long_it_is():
    assert find_segments(motions(3, [1200]), RATE) == ((0, 1200),)


def test_a_start_that_is_dropped_changes_no_border(monkeypatch):
    poses = motions(5, [200, 330, 600, 720, 900])
    short = find_segments(poses, RATE)
    monkeypatch.setattr(segmentation, "REACH", 1000.0)
    assert find_segments(poses, RATE) == short
    monkeypatch.setattr(segmentation, "REACH", 5.0)  # shorter than the longest segment
    assert find_segments(poses, RATE) == short


@pytest.mark.parametrize("seed", range(4))
def test_no_borders_cost_less(seed):
    shortest, price = 10, 1.5
    poses = motions(seed, [70, 100, 145, 180, 260], columns=4)
    costs = segmentation._Costs(poses, np.linspace(0, 260, 88).round().astype(int), RATE)
    least = np.full(88, np.inf)
    least[0] = 0.0
    for end in range(shortest, 88):
        starts = np.arange(end - shortest + 1)
        least[end] = (least[starts] + costs(starts, end)).min() + price
    ends = [0, *segmentation._best_borders(costs, price, shortest), 87]
    found = sum(costs(np.array([one]), other)[0] + price for one, other in pairwise(ends))
    assert found == pytest.approx(least[-1])


def test_what_is_too_short_is_refused():
    with pytest.raises(FileFormatError, match=r"2.5 s cannot be cut into 3"):
        find_segments(np.random.default_rng(0).normal(size=(75, 6)), RATE, 3)
    with pytest.raises(FileFormatError, match="into 0"):
        find_segments(np.zeros((500, 6)), RATE, 0)
    with pytest.raises(FileFormatError, match=r"0\.2 s"):
        find_segments(np.zeros((6, 6)), RATE)


def test_a_still_recording_is_one_segment():
    assert find_segments(np.zeros((500, 6)), RATE) == ((0, 500),)


@pytest.fixture(scope="module")
def clip(mocap_data):
    return read_clip(mocap_data / "cmu/86/86_01.amc")


def test_a_recorded_sequence_is_cut_where_people_cut_it(mocap_data, clip):
    marked = read_labels(mocap_data / "cmu/86/labels/barbic_01_ground_truth.txt").borders
    found = np.array([end for _, end in segments_of(clip)[:-1]])
    assert score_borders(found, marked + np.array([-24, 0, 24])) == BorderScore(6, 6, 6)


@pytest.mark.thorough
def test_planes_cut_a_recorded_sequence_too(mocap_data, clip):
    marked = read_labels(mocap_data / "cmu/86/labels/barbic_01_ground_truth.txt").borders
    segments = plane_segments(body_features(clip), clip.rate, 7)
    assert score_borders(np.array([end for _, end in segments[:-1]]), marked) == BorderScore(6, 6, 6)


def test_poses_do_not_see_where_a_body_stands_or_faces(clip):
    # Root and its height aside, nothing is further from the root than a body is tall.
    assert np.abs(poses_of(clip)[:, 3:]).max() < 2.5
