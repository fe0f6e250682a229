import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.networks.ridge import ridge


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 4), st.floats(1e-3, 10.0))
def test_the_normal_equations_hold_in_either_form(frames, neurons, channels, regulariser):
    rng = np.random.default_rng(frames * 1000 + neurons)
    states, targets = rng.standard_normal((frames, neurons)), rng.standard_normal((frames, channels))
    weights = ridge(states, targets, regulariser)
    residual = states.T @ (targets - states @ weights.T) - regulariser * weights.T
    assert np.abs(residual).max() < 1e-7 * (1 + np.abs(weights).max()) * max(frames, 10)


def test_a_strong_regulariser_shrinks_the_weights():
    rng = np.random.default_rng(0)
    states, targets = rng.standard_normal((50, 8)), rng.standard_normal((50, 2))
    weak, strong = (np.abs(ridge(states, targets, g)).mean() for g in (1e-3, 1e3))
    assert strong < 0.1 * weak


def test_without_noise_a_linear_law_is_found():
    rng = np.random.default_rng(1)
    law, states = rng.standard_normal((3, 5)), rng.standard_normal((200, 5))
    assert ridge(states, states @ law.T, 1e-9) == pytest.approx(law, abs=1e-6)
