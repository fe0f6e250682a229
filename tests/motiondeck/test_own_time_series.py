"""What people hand to the networks: their own arrays in any form are learned, or refused in one line that says why."""

import numpy as np
import pytest

from motiondeck import MotiondeckError
from motiondeck import networks as net

WAVE = np.stack([np.sin(np.arange(240) / 5), np.cos(np.arange(240) / 7)], axis=1)
BAD = np.where(np.arange(240)[:, None] == 7, np.nan, WAVE)
CENTRALIZED = net.CentralizedRecipe(satellites=8, iterations=2)


@pytest.fixture(scope="module")
def loaded():
    return net.load_signals({"a": WAVE})


@pytest.fixture(scope="module")
def reservoir():
    rng = np.random.default_rng(0)
    return net.random_reservoir(20, 2, spectral_radius=0.9, input_scale=1.0, bias_scale=0.1, rng=rng)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "given",
    [WAVE.tolist(), np.asfortranarray(WAVE), np.repeat(WAVE, 2, axis=0)[::2], WAVE.astype(">f8")],
    ids=["list", "columns first", "every other row", "other byte order"],
)
def test_every_form_of_the_same_numbers_is_learned_alike(given, loaded, reservoir):
    assert net.load_signals({"a": given}).weights == pytest.approx(loaded.weights)
    expected = net.learn_response(reservoir, WAVE, WAVE).respond(WAVE)
    assert net.learn_response(reservoir, given, given).respond(given) == pytest.approx(expected)
    assert net.run_free(net.learn_signals({"a": given}, CENTRALIZED), "a", 5).shape == (5, 2)


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ({"a": WAVE[:, 0]}, r"signal 'a' is of shape \(240,\).*x\[:, None\]"),
        ({"a": WAVE[None]}, r"\(1, 240, 2\)"),
        ({"a": BAD}, "signal 'a': frame 7, channel 0 is nan"),
        ({"a": WAVE * 1j}, "complex"),
        ({"a": [["x"]] * 240}, "real numbers"),
        ({"a": [[1.0], [1.0, 2.0]] * 120}, "rows of different lengths"),
        ({"a": WAVE[:, :0]}, r"\(240, 0\)"),
        ({"a": WAVE, "b": WAVE[:, :1]}, "signal 'b' has 1 channels, but 2 are needed"),
        ({"a": WAVE[:1]}, "has 1 frames, too few"),
    ],
)
def test_a_signal_that_cannot_be_learned_is_refused_by_name(signals, words):
    for learn in (net.load_signals, lambda given: net.learn_signals(given, CENTRALIZED)):
        with pytest.raises(MotiondeckError, match=words):
            learn(signals)


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan"), 1e9, "fast"])
def test_a_rate_that_no_recording_has_is_refused(rate):
    # A phase-driven network leads in for 0.8 s: at 1e9 Hz that took all memory there was.
    for recipe in (net.PhaseRecipe(neurons=20), CENTRALIZED):
        with pytest.raises(MotiondeckError, match="the rate, Hz, is"):
            net.learn_signals({"a": WAVE}, recipe, rate=rate)


@pytest.mark.parametrize(
    ("recipe", "words"),
    [
        (net.ConceptorRecipe(neurons=-1), "network.neurons is -1"),
        (net.PhaseRecipe(neurons=0), "network.neurons is 0"),
        (net.EchoStateRecipe(neurons="100"), "Expected `int`, got `str`"),  # pyright: ignore[reportArgumentType]
        ("conceptor", "a recipe such as"),
    ],
)
def test_a_recipe_made_in_python_is_checked_as_one_in_a_file(recipe, words):
    with pytest.raises(MotiondeckError, match=words):
        net.learn_signals({"a": WAVE}, recipe)


def test_a_reservoir_of_impossible_sizes_is_refused():
    right = {"neurons": 20, "inputs": 1, "spectral_radius": 0.9, "input_scale": 1.0, "bias_scale": 0.1}
    rng = np.random.default_rng(0)
    wrong = [("neurons", 0), ("neurons", 50.5), ("spectral_radius", float("nan")), ("leak", 2.0), ("rng", 3)]
    for key, value in wrong:
        with pytest.raises(MotiondeckError, match=key):
            net.random_reservoir(**{**right, "rng": rng, key: value})


@pytest.mark.parametrize(
    ("attempt", "words"),
    [
        (lambda loaded, reservoir: net.drive(reservoir, list(WAVE)), "signal 0 is of shape"),
        (lambda loaded, reservoir: net.drive(reservoir, []), "no signals"),
        (lambda loaded, reservoir: net.drive(reservoir, [WAVE[:, :1]]), "1 channels, but 2 are needed"),
        (lambda loaded, reservoir: net.learn_response(reservoir, WAVE, WAVE, washout=-5), "washout"),
        (lambda loaded, reservoir: net.learn_response(reservoir, WAVE, WAVE, regulariser=-1.0), "regulariser of -1"),
        (lambda loaded, reservoir: net.learn_response(reservoir, WAVE, BAD), "output: frame 7"),
        (lambda loaded, reservoir: loaded.run(np.eye(100), -1), "steps is -1"),
        (lambda loaded, reservoir: loaded.morph(np.eye(100), np.eye(100), np.zeros((3, 2))), "shares of shape"),
        (lambda loaded, reservoir: loaded.morph(np.eye(100), np.eye(100), [0.0, np.nan]), "finite"),
        (lambda loaded, reservoir: net.conjunction(np.eye(3), np.eye(4)), r"\(4, 4\); \(3, 3\) is needed"),
        (lambda loaded, reservoir: net.similarity(np.eye(3), np.eye(4)), r"\(4, 4\); \(3, 3\) is needed"),
        (lambda loaded, reservoir: net.negation(np.zeros((2, 3))), r"\(2, 3\)"),
        (lambda loaded, reservoir: net.correlation(np.ones(5)), r"\(5,\)"),
        (lambda loaded, reservoir: net.nrmse(WAVE, WAVE[:5]), "do not compare"),
        (lambda loaded, reservoir: net.ridge(np.ones((5, 2)), np.ones((4, 1)), 0.1), "equally many frames"),
        (lambda loaded, reservoir: net.learn_primitive([BAD], 100.0), "demonstration 0: frame 7"),
        (lambda loaded, reservoir: net.train_centralized(BAD, 100.0, loop=True), "frame 7, channel 0"),
        (lambda loaded, reservoir: net.train_centralized(WAVE, 0.0, loop=True), "the rate, Hz, is 0"),
        (lambda loaded, reservoir: net.HarmonicCenters.at_phase(np.eye(2)), r"shape \(2, 2\)"),
    ],
)
def test_what_no_network_can_take_is_refused_in_words(attempt, words, loaded, reservoir):
    with pytest.raises(MotiondeckError, match=words):
        attempt(loaded, reservoir)


def test_an_anchor_that_a_network_does_not_have_is_refused():
    network = net.learn_signals({"a": WAVE}, CENTRALIZED)
    with pytest.raises(MotiondeckError, match="anchors from 0 to"):
        net.run_free(network, "a", 5, anchor=10**6)


def test_a_series_without_a_rate_is_learned_by_a_phase_driven_network():
    network = net.learn_signals({"a": WAVE}, net.PhaseRecipe(neurons=100, rank=20))
    assert net.run_free(network, "a", 200)[:-1] == pytest.approx(WAVE[1:200], abs=0.05)
