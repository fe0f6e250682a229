"""The networks on time series of one's own: loaded, driven with an input, running free."""

import numpy as np
import pytest

from motiondeck import MotiondeckError, UnknownNameError
from motiondeck import networks as net


def sine(period, frames=400, channels=1):
    """A sine of some period in frames, each channel a quarter turn behind the last, shape (T, D)."""
    return 3.0 + 2.0 * np.sin(2 * np.pi * np.arange(frames)[:, None] / period - np.arange(channels) * np.pi / 2)


def period_of(signal):
    """The period of a signal (T, D) in frames, by its zero crossings."""
    centred = signal[:, 0] - signal[:, 0].mean()
    up = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
    at = up - centred[up] / (centred[up + 1] - centred[up])
    return float(np.diff(at).mean())


@pytest.fixture(scope="module")
def loaded():
    return net.load_signals({"slow": sine(9.8), "fast": sine(8.1)})


def test_each_conceptor_plays_its_own_signal(loaded):
    for name, period in (("slow", 9.8), ("fast", 8.1)):
        played = loaded.run(loaded.conceptor(name, 10.0), 400)[200:]
        assert period_of(played) == pytest.approx(period, rel=0.01)
        assert (played.min(), played.max()) == pytest.approx((1.0, 5.0), abs=0.3)


def test_a_morph_half_way_lies_between(loaded):
    first, second = (loaded.conceptor(name, 10.0) for name in ("slow", "fast"))
    played = loaded.morph(first, second, np.full(400, 0.5))
    assert 8.2 < period_of(played[200:]) < 9.7
    assert played == pytest.approx(loaded.run(0.5 * (first + second), 400))
    assert loaded.morph(first, second, np.ones(50)) == pytest.approx(loaded.run(second, 50))


def test_conceptors_are_computed_with(loaded):
    slow, fast = (loaded.conceptor(name, 10.0) for name in ("slow", "fast"))
    either, both = net.disjunction(slow, fast), net.conjunction(slow, fast)
    assert net.quota(both) < net.quota(slow) < net.quota(either) < 1.0
    assert net.quota(net.negation(slow)) == pytest.approx(1.0 - net.quota(slow))
    assert net.similarity(slow, slow) == pytest.approx(1.0)
    assert net.adapt_aperture(slow, 2.0) == pytest.approx(loaded.conceptor("slow", 20.0), abs=1e-9)


def test_what_does_not_fit_is_refused(loaded):
    with pytest.raises(UnknownNameError, match="unknown signal 'slwo'"):
        loaded.conceptor("slwo", 10.0)
    with pytest.raises(MotiondeckError, match=r"shape \(3, 3\)"):
        loaded.run(np.eye(3), 10)
    with pytest.raises(MotiondeckError, match="aperture -1"):
        loaded.conceptor("slow", -1.0)
    with pytest.raises(MotiondeckError, match="too few"):
        net.load_signals({"short": sine(5.0, 50)})
    with pytest.raises(MotiondeckError, match="not among the signals"):
        net.learn_signals({"one": sine(5.0)}, net.ConceptorRecipe(), loops=["two"])
    with pytest.raises(MotiondeckError, match="no signals"):
        net.load_signals({})
    with pytest.raises(MotiondeckError, match=r"name: array of shape \(T, D\)., not a ndarray"):
        net.load_signals(sine(5.0))


@pytest.mark.parametrize(
    "recipe",
    [
        net.ConceptorRecipe(neurons=200, rank=20, ridge=0.01, aperture=30.0),
        net.EchoStateRecipe(neurons=200, spectral_radius=0.9),
        net.SharedConceptorRecipe(neurons=200, rank=20),
        net.CentralizedRecipe(satellites=15, iterations=20),
    ],
    ids=lambda recipe: type(recipe).__name__,
)
def test_every_kind_of_network_learns_a_loop_and_runs_free(recipe):
    loops = {"slow": sine(60.0, 60, channels=2), "fast": sine(40.0, 40, channels=2)}
    network = net.learn_signals(loops, recipe, rate=100.0, loops=["slow", "fast"])
    for name, period in (("slow", 60.0), ("fast", 40.0)):
        played = net.run_free(network, name, 600)
        assert period_of(played[100:]) == pytest.approx(period, rel=0.05)
        assert np.ptp(played[100:], axis=0) == pytest.approx([4.0, 4.0], rel=0.15)


def test_a_driven_reservoir_answers_an_input():
    rng = np.random.default_rng(1)
    inputs = rng.uniform(-1.0, 1.0, (1500, 1))
    delayed = np.roll(inputs, 5, axis=0)
    reservoir = net.random_reservoir(100, 1, spectral_radius=0.9, input_scale=0.1, bias_scale=0.0, rng=rng)
    learned = net.learn_response(reservoir, inputs[:1000], delayed[:1000], regulariser=1e-9)
    answer = learned.respond(inputs[1000:])[100:]
    assert np.sqrt(np.mean((answer - delayed[1100:]) ** 2)) < 0.01
    with pytest.raises(MotiondeckError, match="equally many"):
        net.learn_response(reservoir, inputs, delayed[:10])


FREQUENCY = np.array([2 * np.pi])  # 1 Hz


@pytest.mark.parametrize(
    "satellites",
    [
        net.GaussianSatellites(net.grid_places(2, 25), np.full(25, 2.0)),
        net.HarmonicSatellites(net.lowest_orders(2, 20), 1.0),
        net.PolynomialSatellites(net.lowest_orders(2, 15)),
    ],
    ids=lambda satellites: type(satellites).__name__,
)
@pytest.mark.parametrize(
    "centers",
    [
        net.HarmonicCenters.at_phase(FREQUENCY, 0.4),
        net.NonlinearCenters.at_rest(
            net.Duffing(1.0, 0.3), np.array([net.control_for(net.Duffing(1.0, 0.3), FREQUENCY[0], 1.0)]), 1.0
        ),
        net.NonlinearCenters.at_rest(
            net.Pendulum(), np.array([net.control_for(net.Pendulum(), FREQUENCY[0], 1.0)]), 1.0
        ),
    ],
    ids=["harmonic", "Duffing", "pendulum"],
)
def test_every_kind_of_satellites_follows_every_kind_of_centers(centers, satellites):
    time = np.arange(100)[:, None] / 100.0
    signal = np.hstack([1.0 + np.cos(2 * np.pi * time) ** 2, np.sin(2 * np.pi * time)])
    start = centers.coordinates.copy()
    # Three quarters of a period, so that centers that were moved by learning would be elsewhere.
    network = net.learn_weights(np.vstack([signal, signal[:75]]), 100.0, centers, satellites, regulariser=1e-9)
    assert np.array_equal(centers.coordinates, start)
    again = network.run(200, 0.01)
    # Even functions of the coordinates alone (harmonic satellites) cannot follow an odd channel.
    channels = slice(0, 1) if isinstance(satellites, net.HarmonicSatellites) else slice(None)
    assert np.abs(again - np.tile(signal, (2, 1)))[:, channels].max() < 0.02
    assert network.step(0.01)[channels] == pytest.approx(again[0, channels], abs=0.01)


def test_a_faster_center_plays_faster():
    signal = sine(100.0, 100)
    network = net.learn_weights(
        signal, 100.0, net.HarmonicCenters.at_phase(FREQUENCY), net.PolynomialSatellites(net.lowest_orders(2, 6))
    )
    network.centers = net.HarmonicCenters.at_phase(2.0 * FREQUENCY)
    assert network.run(50, 0.01) == pytest.approx(signal[::2], abs=1e-3)
    for bad in (np.zeros(3), np.full((3, 1), np.nan)):
        with pytest.raises(MotiondeckError, match=r"\(frames, channels\)|channel 0 is nan"):
            net.learn_weights(bad, 100.0, network.centers, network.satellites)


def test_the_switching_module_goes_where_it_is_commanded():
    module = net.SwitchingModule(net.design_module(4))
    module.command(net.clamp(module.design, 2))
    for _ in range(300):
        module.advance(0.02)
    assert module.state == 2


def test_the_constructors_have_defaults_and_seeds():
    reservoir = net.random_reservoir(100, 1)
    assert np.array_equal(reservoir.weights, net.random_reservoir(100, 1, seed=0).weights)
    assert not np.array_equal(reservoir.weights, net.random_reservoir(100, 1, seed=1).weights)
    time = np.arange(600)[:, None]
    signal = np.sin(0.1 * time)
    response = net.learn_response(reservoir, signal, signal**3)
    assert net.nrmse(response.respond(signal)[200:], signal[200:] ** 3) < 0.05
    loaded = net.load_signals({"slow": signal, "fast": np.sin(0.2 * time)})
    assert np.ptp(loaded.run(loaded.conceptor("slow"), 300)[100:]) == pytest.approx(2.0, abs=0.4)
    network = net.learn_signals({"slow": signal, "fast": np.sin(0.2 * time)})
    assert np.ptp(net.run_free(network, "slow", 200)) == pytest.approx(2.0, abs=0.4)
    centers = net.NonlinearCenters.at_rest(net.Pendulum(), net.control_for(net.Pendulum(), 2.0))
    assert centers.frequency == pytest.approx([2.0])
    loop = np.sin(2 * np.pi * np.arange(120)[:, None] / 120)
    assert net.nrmse(net.learn_weights(loop, 60.0).run(120, 1 / 60), loop) < 0.05
