import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.recognition import change_points
from benchmarks.recognition.border_score import BorderScore, score_borders
from benchmarks.recognition.change_points import cross_prediction, kernel_change_points
from benchmarks.recognition.first_occurrences import bank_of_first_occurrences, first_occurrences, not_learned, smoothed
from benchmarks.recognition.segment_labels import Labels, read_labels
from controller.learning.recognition.experts import ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe, features
from controller.learning.recognition.viterbi_segmentation import borders_of, frame_costs, viterbi
from motiondeck_base.errors import FileFormatError, MotiondeckError
from recognition_examples import clip

GOOD = "3\n1 walking\n90 100 120 \n2 jump forward\n180 200 220\n\n3 walking\n300\n"


def write(tmp_path, text):
    path = tmp_path / "labels.txt"
    path.write_text(text)
    return path


def test_labels_are_read_with_their_tolerances(tmp_path):
    labels = read_labels(write(tmp_path, GOOD))
    assert labels.names == ("walking", "jump_forward", "walking")
    assert labels.classes == ("walking", "jump_forward")
    assert labels.borders.tolist() == [[90, 100, 120], [180, 200, 220]]
    assert labels.frames == 300
    assert np.bincount(labels.of_frames(4.0)).tolist() == [50, 25]
    assert labels.of_frames(4.0)[[24, 25, 49, 50]].tolist() == [0, 1, 1, 0]


def test_a_border_whose_frames_are_out_of_order_is_read_in_its_widest_sense(tmp_path):
    labels = read_labels(write(tmp_path, GOOD.replace("90 100 120", "100 90 120")))
    assert labels.borders[0].tolist() == [90, 100, 120]


@pytest.mark.parametrize(("wrong", "said"), [
    ("hello\n", "number of its segments"),
    ("2\n1 walking\n90 100 120\n", "announces 2 segments"),
    (GOOD.replace("90 100 120", "90 x 120"), "line 3: expected frame numbers"),
    (GOOD.replace("90 100 120", "90 100"), "line 3: expected earliest"),
    (GOOD.replace("90 100 120", "90 1e400 120"), "line 3: expected frame numbers"),
    (GOOD.replace("1 walking", "1"), "line 2: expected a segment's number and name"),
    (GOOD.replace("300", "150"), "do not follow each other"),
])  # fmt: skip
def test_wrong_labels_are_refused_with_file_and_line(tmp_path, wrong, said):
    with pytest.raises(FileFormatError, match=said) as caught:
        read_labels(write(tmp_path, wrong))
    assert "labels.txt" in str(caught.value)


@given(st.text(alphabet="0123456789 abc.-e\n", max_size=60))
def test_any_text_is_read_or_refused(tmp_path, text):
    path = write(tmp_path, text or " ")
    try:
        labels = read_labels(path)
    except FileFormatError:
        return
    assert len(labels.borders) == len(labels.names) - 1


@given(st.integers(0, 10_000), st.floats(0.0, 3.0))
def test_viterbi_finds_the_cheapest_of_all_sequences(seed, change):
    costs = np.random.default_rng(seed).uniform(0, 2, (5, 3))

    def price(path):
        return costs[np.arange(5), list(path)].sum() + change * np.count_nonzero(np.diff(path))

    best = min(price(path) for path in itertools.product(range(3), repeat=5))
    assert price(viterbi(costs, change)) == pytest.approx(best)


def test_a_dear_change_is_never_made_and_a_free_one_always():
    costs = np.random.default_rng(0).uniform(size=(30, 4))
    assert len(borders_of(viterbi(costs, 1e6))) == 0
    assert np.array_equal(viterbi(costs, 0.0), costs.argmin(1))


def test_smoothing_keeps_the_mean_and_calms():
    costs = np.random.default_rng(0).normal(size=(200, 2))
    assert smoothed(costs, 30.0).std() < 0.5 * costs.std()
    assert np.allclose(smoothed(costs, 30.0, 0.01), costs)


def test_borders_count_inside_their_tolerance_and_once():
    accepted = np.array([[10, 15, 20], [18, 25, 30], [50, 55, 60]])
    assert score_borders(np.array([19, 20, 70]), accepted) == BorderScore(2, 3, 3)
    assert score_borders(np.array([12, 13]), accepted) == BorderScore(1, 2, 3)
    score = score_borders(np.array([15, 25, 55]), accepted)
    assert (score.f1, score.precision, score.recall) == (1.0, 1.0, 1.0)
    nothing = score_borders(np.array([], dtype=int), accepted)
    assert (nothing.precision, nothing.recall, nothing.f1) == (1.0, 0.0, 0.0)


def test_only_first_occurrences_are_learned():
    labels = Labels(("a", "b", "a"), np.array([[90, 100, 110], [190, 200, 210]]), 300)
    learn = first_occurrences(labels, 1.0)
    assert np.flatnonzero(np.diff(learn.astype(int))).tolist() == [149]
    assert learn[:150].all()  # all of the first 'a', half of the only 'b'


def stream():
    """Marching, waving, marching and waving again, at 30 Hz, with where the motion changes."""
    look = FeatureRecipe(velocity=False)
    parts = [features(clip(name, "ann", pace), look) for name, pace in (("march", 1.0), ("wave", 1.1))]
    once = [np.tile(part, (3, 1)) for part in parts]
    signal = np.concatenate([once[0], once[1], once[0][7:], once[1][5:]])
    borders = np.cumsum([len(once[0]), len(once[1]), len(once[0]) - 7])
    return signal + 0.01 * np.random.default_rng(0).normal(size=signal.shape), borders


def test_experts_of_the_first_occurrences_cut_the_rest():
    signal, at = stream()
    labels = Labels(("march", "wave", "march", "wave"), np.column_stack([at - 4, at, at + 4]), len(signal))
    bank = bank_of_first_occurrences(signal, labels, 1.0, ExpertRecipe(neurons=40, leak=1.0))
    path = viterbi(frame_costs(bank, signal), 20.0)
    assert score_borders(borders_of(path), labels.borders).f1 == 1.0
    assert (path == labels.of_frames()).mean() > 0.97


@pytest.mark.parametrize("cut", [kernel_change_points, cross_prediction])
def test_borders_are_found_without_labels(cut):
    signal, at = stream()
    score = score_borders(cut(signal, 30.0), np.column_stack([at - 12, at, at + 12]))
    assert score.hits == 3
    assert score.f1 > 0.8


@pytest.mark.parametrize("cut", [kernel_change_points, cross_prediction])
def test_where_nothing_changes_nothing_is_cut(cut):
    assert len(cut(np.tile(stream()[0][:50], (8, 1)), 30.0)) == 0
    assert len(cut(np.zeros((4, 2)), 30.0)) == 0


def test_a_stream_too_long_for_all_pairs_is_refused(monkeypatch):
    monkeypatch.setattr(change_points, "LARGEST_GRAM", 10)
    with pytest.raises(MotiondeckError, match="too many"):
        kernel_change_points(np.zeros((11, 2)), 30.0)


def test_labels_of_one_class_or_a_moment_teach_nothing():
    signal, _ = stream()
    with pytest.raises(MotiondeckError, match="only one class"):
        bank_of_first_occurrences(signal, Labels(("a",), np.empty((0, 3), dtype=int), len(signal)), 1.0)
    short = Labels(("a", "b"), np.array([[1, 2, 3]]), len(signal))
    with pytest.raises(MotiondeckError, match="'a' first occurs for only 1 frames"):
        bank_of_first_occurrences(signal, short, 1.0)


def test_experts_are_scored_only_on_borders_that_are_new_to_them():
    """Walk and jump are learned where they first occur; between the second walk and the second jump all is new."""
    borders = np.array([[90, 100, 110], [190, 200, 210], [290, 300, 310]])
    labels = Labels(("walk", "jump", "walk", "jump"), borders, 400)
    # Found late at each mark, and once where nothing is marked.
    found, marked = not_learned(np.array([105, 205, 305, 350]), labels)
    assert marked.tolist() == [[290, 300, 310]]
    assert found.tolist() == [305, 350]
    assert score_borders(found, marked) == BorderScore(hits=1, found=2, marked=1)
