"""Weights of low rank: fewer numbers than any weights of full rank need, no more than asked for, and zeros kept."""

import numpy as np
import pytest

import synthetic
from controller.learning.centralized.low_rank_learning import learn_low_rank, nested_readout
from controller.learning.centralized.motion_training import train_centralized
from controller.learning.centralized.satellite_learning import RIDGE_SHARE, learn, ridge_readout, slow_and_fast
from motiondeck_base.errors import MotiondeckError

pytestmark = pytest.mark.thorough

TIME = np.arange(240) / 120.0


def body_like(channels=40, curves=5, seed=0):
    """Many outputs that move together: smooth curves of falling size, each output with a few of them."""
    rng = np.random.default_rng(seed)
    waves = np.stack([np.sin(2 * np.pi * (0.4 + 0.5 * k) * TIME + rng.uniform(0, 6)) / (k + 1) for k in range(curves)])
    shares = rng.normal(size=(channels, curves)) * (rng.random((channels, curves)) < 0.6)
    signal = (shares @ waves).T
    return signal - signal.mean(0)


def learned(target, parameters=None, **more):
    starts = slow_and_fast(TIME[-1], 1, 30, 0)
    return learn_low_rank(target, TIME, starts, satellites=80, parameters=parameters, iterations=20, **more)


@pytest.fixture(scope="module", params=[150, 250])
def network_of(request):
    """A network, and how many numbers it was allowed."""
    return learned(body_like(), request.param), request.param


def test_it_takes_no_more_numbers_than_asked_for_and_says_more_with_them_than_full_weights(network_of):
    target = body_like()
    network, parameters = network_of
    assert network.numbers <= parameters
    weights, places = network.weights, network.satellites.satellites.places
    by_hand = np.count_nonzero(weights.shares) + np.count_nonzero(weights.curves) + 3 * len(places) + 2
    assert by_hand <= network.numbers <= by_hand + weights.rank + weights.shares.size // 32 + 1
    few = parameters // target.shape[1]
    full = learn(target, TIME, few, slow_and_fast(TIME[-1], 1, 30, 0), iterations=20)
    response = full.respond(TIME)
    left = np.square(target - response @ ridge_readout(response, target).T).sum()
    assert np.square(target - network.play(TIME)).sum() < 0.25 * left


def test_the_error_it_states_is_the_one_it_has(network_of):
    target = body_like()
    network, _ = network_of
    missed = np.square(target - network.play(TIME)).sum() / np.square(target).sum()
    assert network.satellites.error == pytest.approx(missed, rel=1e-9)


def test_akaikes_criterion_finds_the_rank_of_a_noisy_motion():
    target = body_like(curves=4) + np.random.default_rng(1).normal(0.0, 0.05, (240, 40))
    network = learned(target - target.mean(0))
    assert network.weights.rank == 4
    clean = body_like(curves=4)
    assert np.sqrt(np.square(clean - network.play(TIME)).mean()) < 0.02  # the noise has 0.05


def test_nested_weights_are_those_that_shorter_sums_have_alone():
    rng = np.random.default_rng(0)
    response, target, used = rng.normal(size=(60, 9)), rng.normal(size=(60, 3)), np.array([9, 4, 1])
    together = nested_readout(response, target, used)
    for column, count in enumerate(used):
        alone = np.linalg.solve(
            response[:, :count].T @ response[:, :count] + RIDGE_SHARE * 60 * np.eye(count),
            response[:, :count].T @ target[:, column],
        )
        assert np.allclose(together[column, :count], alone)
        assert not together[column, count:].any()


def test_what_cannot_be_learned_is_refused():
    with pytest.raises(MotiondeckError, match=r"10 parameters are too few; the smallest network has \d+"):
        learned(body_like(), 10)
    with pytest.raises(MotiondeckError, match="nothing moves"):
        learned(np.zeros((240, 3)))
    with pytest.raises(MotiondeckError, match="too few"):
        learn_low_rank(np.ones((2, 2)), np.arange(2.0), [np.array([1.0])], satellites=5)


@pytest.mark.parametrize(("name", "loop"), [("march", True), ("bow", False)])
def test_a_motion_of_low_rank_comes_back_in_fewer_numbers(name, loop):
    frames = synthetic.MOTIONS[name]()
    part = train_centralized(frames, synthetic.RATE, loop=loop, satellites=40, rank="auto", iterations=20)
    assert np.abs(part.at(np.arange(len(frames)) / synthetic.RATE) - frames).max() < 0.05
    assert part.weights.numbers < part.matrix.size
    if loop:
        assert np.allclose(part.at(np.array([10 * part.seconds])), part.at(np.array([0.0])), atol=1e-9)
