import numpy as np
import pytest

import synthetic
from controller.learning.evaluation.evaluation import training_error
from controller.learning.fit import TrainedNetwork, first_to_pass
from controller.learning.measures.disturbance import FREE_RUN, failures, with_trials
from controller.learning.measures.self_test import MotionVerdict
from controller.learning.preparation.training_motion import Lessons
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers import echo_state
from controller.learning.trainers.echo_state import FACTORS, TRAINER, EchoStateRecipe

RECIPE = EchoStateRecipe(neurons=120, washout=60, choose_noise=True)


@pytest.fixture(scope="module")
def judge():
    return synthetic.judge()


@pytest.fixture(scope="module")
def plain():
    return synthetic.trained(RECIPE)


def settled(judge):
    return TRAINER.settle(RECIPE, Lessons(*synthetic.lessons(), synthetic.RATE), 0, judge).network


def test_accuracy_is_of_the_network_that_fit_would_settle_on(plain, monkeypatch):
    left = iter([3, 0])
    monkeypatch.setattr(echo_state, "failures", lambda network, motion, *_: next(left) if motion == "wave" else 0)
    frames = synthetic.references()
    motions = [MotionRecipe(name=name, file="x.bvh") for name in frames]
    recipe = LibraryRecipe(name="small", network=RECIPE, motions=motions, body="x.bvh", licence="")
    network = training_error(recipe, synthetic.training_set(), 0).network
    assert list(left) == []
    assert np.array_equal(network["march"].readout, plain["march"].readout)
    assert not np.array_equal(network["wave"].readout, plain["wave"].readout)


def test_only_a_motion_that_fails_is_taught_again(plain, judge, monkeypatch):
    left = iter([3, 5, 1, 2, 1])  # wave as it was taught, and with each of FACTORS

    def said(network, motion, kinds, judge, seed):
        return next(left) if motion == "wave" else 0

    monkeypatch.setattr(echo_state, "failures", said)
    network = settled(judge)
    assert list(left) == []
    for motion in ("march", "bow"):
        assert np.array_equal(network[motion].readout, plain[motion].readout)
    assert not np.array_equal(network["wave"].readout, plain["wave"].readout)
    # What failed least was the second attempt, with more noise.
    seen = []
    learn = echo_state.learn_readouts
    monkeypatch.setattr(
        echo_state, "learn_readouts", lambda *a: seen.append((a[2].state_noise, learn(*a))) or seen[-1][1]
    )
    left = iter([3, 5, 1, 2, 1])
    kept = settled(judge)["wave"].readout
    (first, _), *again = seen
    assert first == RECIPE.state_noise
    assert [noise for noise, _ in again] == pytest.approx([factor * RECIPE.state_noise for factor in FACTORS])
    assert np.array_equal(kept, again[1][1]["wave"].readout)


def test_what_fails_too_often_does_not_pass():
    verdicts = {name: MotionVerdict(True, 1.0, 1.0, "") for name in ("a", "b")} | {
        "c": MotionVerdict(False, 1.0, 1.0, "frozen")
    }
    tested = with_trials(verdicts, {"a": 1, "b": 2, "c": FREE_RUN})
    assert tested["a"].passed
    assert tested["b"].reason == "fails 2 times when disturbed"
    assert tested["c"] == verdicts["c"]


def test_a_motion_that_does_not_run_free_is_not_disturbed(plain, judge, monkeypatch):
    monkeypatch.setattr("controller.learning.measures.disturbance.disturbed", lambda *_: pytest.fail("disturbed"))
    mute = plain.with_motions({"wave": _silent(plain["wave"])})
    assert failures(mute, "wave", ("stability",), judge, 0) == FREE_RUN


def _silent(part):
    return type(part)(np.zeros_like(part.readout), part.states, part.outputs)


def test_the_next_seed_is_tried_until_all_pass_and_else_the_best_is_kept(plain):
    def attempt(seed):
        verdicts = {str(i): MotionVerdict(i < passing[seed], 1.0, 1.0, "") for i in range(3)}
        return TrainedNetwork(seed, plain, verdicts)

    passing = {0: 1, 1: 3, 2: 3}
    assert first_to_pass([0, 1, 2], attempt).seed == 1
    passing = {0: 1, 1: 2, 2: 2}
    assert first_to_pass([0, 1, 2], attempt).seed == 1
