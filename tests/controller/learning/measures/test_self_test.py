import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import synthetic
from controller.learning.measures.self_test import Judge, self_test
from controller.motion.encodings.motion_matching import Matcher, joint_features, rising_length, windows

NAMES = list(synthetic.MOTIONS)


@pytest.fixture(scope="module")
def features():
    encoding = synthetic.small_encoding()
    return [joint_features(encoding, make()) for make in synthetic.MOTIONS.values()]


@pytest.fixture(scope="module")
def judge():
    return synthetic.judge()


def test_a_trained_network_passes(judge):
    verdicts = self_test(synthetic.small_network(), judge)
    assert [name for name, verdict in verdicts.items() if not verdict.passed] == []
    assert max(verdict.error_mm for verdict in verdicts.values()) < 30.0


class Tape:
    """Plays given frames round and round."""

    as_phase_network = None

    def __init__(self, frames):
        self.motions, self.channels, self._frames = ("both",), frames.shape[1], frames

    def cue(self, motion, anchor):
        self._n = anchor

    def advance(self, out):
        out[:] = self._frames[self._n % len(self._frames)]
        self._n += 1


def test_a_loop_that_takes_a_short_cut_fails():
    """It swings its arms to the left and then to the right; between the two it comes near to itself."""
    t = 2 * np.pi * np.arange(240) / 120
    side = np.where(np.arange(240) < 120, 1.0, -1.0) * (1.0 - np.cos(t))
    arms = synthetic.swing(0.5 * side, 0), synthetic.swing(0.5 * side, 1)
    legs = synthetic.swing(0.1 * side, 1), synthetic.swing(0.1 * side, 1)
    both = synthetic.frames_of(0.8 + 0 * t, 0 * t, 0 * t, legs, arms)
    judge = Judge(synthetic.small_encoding(), {"both": both}, {"both": True}, synthetic.RATE)
    assert self_test(Tape(both), judge)["both"].passed
    verdict = self_test(Tape(both[:120]), judge)["both"]
    assert not verdict.passed
    assert "of the motion only" in verdict.reason


class PhaseTape(Tape):
    """The same, and it knows its phase."""

    @property
    def as_phase_network(self):
        return self


def beckon():
    """The same wave of a hand three times, and then a step."""
    t = 2 * np.pi * np.arange(240) / 60
    waving = (np.arange(240) < 180) * np.sin(t)
    arms = synthetic.swing(-1.0 + 0.5 * waving, 0), synthetic.swing(0 * t, 0)
    step = (np.arange(240) >= 180) * (1.0 - np.cos(t))
    legs = synthetic.swing(0.3 * step, 0), synthetic.swing(-0.3 * step, 0)
    return synthetic.frames_of(0.8 + 0 * t, 0 * t, 0 * t, legs, arms)


@pytest.mark.parametrize("loop", [True, False])
def test_a_repeated_gesture_passes_where_the_phase_is_known(loop):
    judge = Judge(synthetic.small_encoding(), {"both": beckon()}, {"both": loop}, synthetic.RATE)
    tape = PhaseTape(np.concatenate([beckon(), *([] if loop else [beckon()[-1:]] * 480)]))
    tape.cue = lambda motion, anchor: setattr(tape, "_n", anchor + 1)  # the frame after the anchor comes first
    verdict = self_test(tape, judge)["both"]
    assert verdict.passed
    assert verdict.error_mm < 1e-6


@pytest.mark.parametrize(("played", "passes"), [(slice(None), True), (slice(60, None), False), (slice(1), False)])
def test_a_gesture_that_is_repeated_before_the_end_passes_if_each_one_comes_in_its_time(played, passes):
    """The waves are alike, so to which of them a moment of the run is nearest says nothing."""
    run = beckon()[played]
    judge = Judge(synthetic.small_encoding(), {"both": beckon()}, {"both": False}, synthetic.RATE)
    tape = Tape(np.concatenate([run, *[beckon()[-1:]] * (720 - len(run))]))
    assert self_test(tape, judge)["both"].passed is passes


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda frames: np.roll(frames, 30, axis=0), "off at the same phase"),
        (lambda frames: np.where(np.arange(240)[:, None] == 100, np.roll(frames, 120, axis=0), frames), "at one frame"),
        (lambda frames: np.repeat(frames[:1], 240, axis=0), "off at the same phase"),
        (lambda frames: frames * np.nan, "ran away"),
    ],
)
def test_what_is_not_at_its_phase_fails(change, reason):
    judge = Judge(synthetic.small_encoding(), {"both": beckon()}, {"both": True}, synthetic.RATE)
    tape = PhaseTape(np.roll(change(beckon()), -1, axis=0))
    verdict = self_test(tape, judge)["both"]
    assert not verdict.passed
    assert reason in verdict.reason


def test_a_frozen_loop_fails(features, judge):
    frozen = np.repeat(features[0][:1], 300, axis=0)
    assert not judge.of_features("march", frozen).passed


def test_another_motion_fails(features, judge):
    verdict = judge.of_features("march", np.tile(features[1], (4, 1)))
    assert not verdict.passed
    assert "looks like" in verdict.reason


def test_the_motion_itself_passes_at_another_tempo(features, judge):
    slower = np.repeat(np.tile(features[0], (3, 1)), 2, axis=0)
    slower = 0.5 * (slower[1:] + slower[:-1])
    assert judge.of_features("march", slower).passed


def test_a_motion_that_never_starts_fails(features, judge):
    verdict = judge.of_features("bow", np.repeat(features[2][:1], 600, axis=0))
    assert not verdict.passed
    assert "went through" in verdict.reason


def test_a_motion_that_does_not_hold_its_end_fails(features, judge):
    run = np.concatenate([features[2], features[2][::-1]])
    verdict = judge.of_features("bow", run)
    assert not verdict.passed
    assert "holds" in verdict.reason


def test_a_run_that_is_not_finite_fails(features, judge):
    run = np.tile(features[0], (3, 1))
    run[-1, 0] = np.nan
    assert judge.of_features("march", run).reason == "the network ran away"


@given(st.lists(st.integers(0, 30), max_size=25))
def test_rising_length_is_that_of_the_longest_rising_subsequence(places):
    lengths = []
    for i, place in enumerate(places):
        lengths.append(1 + max((lengths[j] for j in range(i) if places[j] < place), default=0))
    assert rising_length(np.array(places, dtype=np.int64)) == max(lengths, default=0)


@given(st.integers(1, 80), st.sampled_from([24.0, 30.0, 60.0, 120.0, 240.0]))
def test_windows_start_every_thirtieth_of_a_second_at_any_rate(count, rate):
    stride = Matcher([np.zeros((count, 3))], [True], rate).stride
    assert stride / rate == pytest.approx(1.0 / 30.0, rel=0.3)
    assert windows(np.zeros((count, 3)), stride, wrap=True).shape == (count // stride + 1, 18)
