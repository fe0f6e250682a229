import numpy as np
import pytest

from controller.networks.reservoirs.reservoir import drive, largest_eigenvalue, random_reservoir


def make(neurons=150, leak=1.0, seed=3):
    return random_reservoir(
        neurons,
        4,
        spectral_radius=1.4,
        input_scale=0.7,
        bias_scale=0.2,
        rng=np.random.default_rng(seed),
        leak=leak,
    )


@pytest.mark.parametrize("neurons", [20, 150, 300])
def test_the_spectral_radius_is_what_was_asked_for(neurons):
    assert np.abs(np.linalg.eigvals(make(neurons).weights)).max() == pytest.approx(1.4, rel=1e-3)


def test_arnoldi_agrees_with_the_full_spectrum():
    weights = np.random.default_rng(0).uniform(-1, 1, (200, 200))
    full = np.abs(np.linalg.eigvals(weights)).max()
    assert largest_eigenvalue(weights, np.random.default_rng(1)) == pytest.approx(full, rel=1e-3)


def test_signals_of_different_lengths_are_driven_as_if_each_were_alone():
    rng = np.random.default_rng(5)
    reservoir = make(leak=0.6)
    signals = [rng.standard_normal((length, 4)) for length in (7, 30, 1, 30, 12)]
    together = drive(reservoir, signals)
    for signal, states in zip(signals, together, strict=True):
        assert states.shape == (len(signal), 150)
        np.testing.assert_allclose(states, drive(reservoir, [signal])[0], atol=1e-12)


def test_a_step_is_the_equation():
    reservoir, p = make(leak=0.3), np.array([[0.1, -0.2, 0.3, 0.4], [0.5, 0.0, -0.1, 0.2]])
    x = np.zeros(150)
    for row, state in zip(p, drive(reservoir, [p])[0], strict=True):
        x = 0.7 * x + 0.3 * np.tanh(reservoir.weights @ x + reservoir.input_weights @ row + reservoir.bias)
        np.testing.assert_allclose(state, x, atol=1e-12)


def test_the_same_seed_gives_the_same_reservoir_and_noise():
    first, second = make(), make()
    assert np.array_equal(first.weights, second.weights)
    signal = [np.ones((20, 4))]
    noisy = [drive(r, signal, state_noise=0.1, rng=np.random.default_rng(9))[0] for r in (first, second)]
    assert np.array_equal(*noisy)
    assert not np.allclose(noisy[0], drive(first, signal)[0])
