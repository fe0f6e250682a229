import numpy as np
import pytest

import synthetic
from controller.learning.preparation.training_motion import Lessons
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, conceptor_network, load_reservoir
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.networks.conceptor.network import ConceptorNetwork
from motiondeck_base.errors import MotiondeckError, UnknownNameError

PLAIN = ConceptorRecipe(
    neurons=120, input_scale=0.5, aperture=20.0, ridge=0.01, rank=120, washout=60, form="plain", learns="weights"
)


def conceptors():
    return synthetic.small_network()


def echo():
    lessons, normalisation = synthetic.lessons()
    return synthetic.trained(EchoStateRecipe(neurons=150, washout=60), lessons, normalisation)


def run(step, frames, channels):
    out = np.empty((frames, channels))
    for frame in out:
        step(frame)
    return out


@pytest.mark.parametrize("make", [conceptors, echo])
def test_mu_zero_is_the_source(make):
    network, other = make(), make()
    for each in (network, other):
        each.cue("march", 0)
        run(each.advance, 20, each.channels)
    mixed = network.morph("march", "wave")
    plain = run(other.advance, 30, other.channels)
    assert np.allclose(run(lambda out: mixed.advance(0.0, out), 30, network.channels), plain, atol=1e-3)


def test_a_ramp_ends_in_the_target():
    network = conceptors()
    network.cue("march", 0)
    mixed, out = network.morph("march", "wave"), np.empty(network.channels)
    for mu in np.linspace(0.0, 1.0, 60):
        mixed.advance(float(mu), out)
    mixed.settle()
    played = run(network.advance, 720, network.channels)[-120:]
    taught = synthetic.wave()
    assert min(np.abs(np.roll(taught, shift, axis=0) - played).mean() for shift in range(120)) < 0.05


def test_low_rank_morphing_is_the_equation_of_the_thesis():
    """x(n+1) = (mu C_j + (1 - mu) C_i) tanh(W x(n) + b) with dense matrices, outside [0, 1] as well."""
    lessons, normalisation = synthetic.lessons()
    loaded = load_reservoir(lessons, PLAIN, 1)
    network = conceptor_network(loaded, Lessons(lessons, normalisation, synthetic.RATE), PLAIN)
    network.cue("march", 0)

    def matrix(name):
        states = loaded.states[network.motions.index(name)]
        r = states.T @ states / PLAIN.neurons
        return r @ np.linalg.inv(r + PLAIN.aperture**-2 * np.eye(PLAIN.neurons))

    source, target = matrix("march"), matrix("wave")
    x = loaded.states[0][0]
    mixed, out = network.morph("march", "wave"), np.empty(network.channels)
    for mu in (-0.2, 0.0, 0.3, 0.7, 1.0, 1.2):
        x = (mu * target + (1.0 - mu) * source) @ np.tanh(loaded.weights @ x + loaded.reservoir.bias)
        mixed.advance(mu, out)
        assert np.allclose(out, normalisation.invert(loaded.readout @ x), atol=2e-3)


@pytest.mark.parametrize("make", [conceptors, echo])
def test_a_morph_starts_from_what_is_played(make):
    network = make()
    network.cue("bow", 0)
    with pytest.raises(MotiondeckError, match="plays 'march'; cue it first"):
        network.morph("march", "wave")
    with pytest.raises(UnknownNameError, match="wave"):
        network.morph("bow", "wafe")


def test_settling_leaves_an_ordinary_network():
    network = synthetic.small_network()
    network.cue("march", 0)
    mixed, out = network.morph("march", "bow"), np.empty(network.channels)
    mixed.advance(1.0, out)
    mixed.settle()
    assert isinstance(network, ConceptorNetwork)
    assert not network.astray()
    kept = network.snapshot()
    first = run(network.advance, 50, network.channels)
    network.restore(kept)
    assert np.array_equal(first, run(network.advance, 50, network.channels))
