"""Borders are read, found where a motion changes, scored against windows, and crossed without a jump."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.errors import FileFormatError
from controller.mocap.reading import read_clip
from controller.mocap.segmentation import (
    Agreement,
    Border,
    body_features,
    by_hand,
    by_labels,
    compare,
    cross_fade,
    find_segments,
    read_borders,
)

LABELS = "3\n1 walking\n500 550 600\n2 jump\n1150 1100 1200 \n3 walking\n1900\n"


def written(tmp_path, text):
    path = tmp_path / "labels.txt"
    path.write_text(text)
    return path


def test_borders_are_read_and_put_in_order(tmp_path):
    assert read_borders(written(tmp_path, LABELS)) == [
        Border("walking", 500, 550, 600),
        Border("jump", 1100, 1150, 1200),
    ]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", "a count"),
        ("walking\n", "a count"),
        ("2\n1 walking\n500 550 600\n", "two lines"),
        ("2\n1 walking\n500 550\n2 jump\n900\n", "line 3"),
        ("2\nwalking\n500 550 600\n2 jump\n900\n", "line 2"),
        ("2\n1 walking\n500 x 600\n2 jump\n900\n", "line 3"),
    ],
)
def test_a_damaged_label_file_is_refused_by_its_place(tmp_path, text, place):
    with pytest.raises(FileFormatError, match=place):
        read_borders(written(tmp_path, text))


@given(st.text(alphabet="0123456789 ab\n", max_size=80))
def test_any_text_is_read_or_refused(tmp_path, text):
    try:
        borders = read_borders(written(tmp_path, text))
    except FileFormatError:
        return
    assert all(b.earliest <= b.best <= b.latest for b in borders)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="nowhere"):
        read_borders(tmp_path / "nowhere.txt")


@given(st.lists(st.integers(-5, 60), max_size=6))
def test_segments_by_hand_cover_everything_once(borders):
    if borders == sorted(set(borders)) and all(0 < border < 50 for border in borders):
        segments = by_hand(borders, 50)
        assert [i for first, end in segments for i in range(first, end)] == list(range(50))
    else:
        with pytest.raises(FileFormatError, match="must rise"):
            by_hand(borders, 50)


def test_labels_become_segments():
    assert by_labels(np.array([0, 0, 1, 1, 1, 0])) == ((0, 2), (2, 5), (5, 6))


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


def test_a_recorded_sequence_is_cut_where_people_cut_it(mocap_data):
    clip = read_clip(mocap_data / "cmu/86/86_01.amc")
    marked = read_borders(mocap_data / "cmu/86/labels/barbic_01_ground_truth.txt")
    agreement = compare(find_segments(body_features(clip), clip.rate, 7), marked)
    assert agreement == Agreement(right=6, found=6, marked=6)
    unaided = compare(find_segments(body_features(clip), clip.rate), marked)
    assert unaided.f1 >= 0.8


def test_features_do_not_see_where_a_body_stands_or_faces(mocap_data):
    clip = read_clip(mocap_data / "cmu/86/86_01.amc")
    features = body_features(clip)
    # Root and its height aside, nothing is further from the root than a body is tall.
    assert np.abs(features[:, 3 : features.shape[1] // 2]).max() < 2.5


def test_agreement_counts_each_window_once():
    marked = [Border("a", 90, 100, 110), Border("b", 190, 200, 210), Border("c", 290, 300, 310)]
    agreement = compare(by_hand([95, 105, 205, 260], 400), marked)
    assert agreement == Agreement(right=2, found=4, marked=3)
    assert agreement.precision == 0.5
    assert agreement.recall == pytest.approx(2 / 3)
    assert agreement.f1 == pytest.approx(4 / 7)
    assert compare(by_hand([85, 205, 320], 400), marked, tolerance=10) == Agreement(3, 3, 3)
    assert compare(by_hand([], 400), marked).f1 == 0.0


@given(st.integers(0, 12), st.integers(1, 4))
def test_pieces_of_one_curve_join_to_that_curve(overlap, count):
    curve = np.sin(np.arange(400) / 20.0)[:, None] * np.array([1.0, 2.0])
    borders = np.linspace(0, 400, count + 1).astype(int)
    pieces = [curve[max(0, first - overlap) : min(400, end + overlap)] for first, end in pairwise(borders)]
    assert np.allclose(cross_fade(pieces, overlap), curve)


def test_pieces_that_differ_join_smoothly_and_short_ones_are_refused():
    joined = cross_fade([np.zeros((60, 1)), np.ones((60, 1))], 12)
    assert len(joined) == 96
    assert (np.diff(joined[:, 0]) >= 0).all()
    assert np.abs(np.diff(joined[:, 0])).max() < 0.1
    with pytest.raises(FileFormatError, match="piece 1"):
        cross_fade([np.zeros((60, 1)), np.ones((20, 1)), np.zeros((60, 1))], 12)
