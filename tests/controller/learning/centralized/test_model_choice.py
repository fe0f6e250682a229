"""Errors are measured as the paper's equations say, and the criterion weighs them against parameters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.learning.centralized.model_choice import aicc, mean_absolute, mean_distance, relative_accuracy


def test_errors_of_one_marker_by_hand():
    markers = np.array([[[1.0, 2.0, 2.0]], [[1.0, 0.0, 2.0]]])
    output = markers + np.array([[[0.0, 0.4, 0.3]], [[0.0, 0.0, -0.3]]])
    # (0 / 2 + 0.16 / 4 + 0.18 / 8) / 3, the square root of it
    assert relative_accuracy(output, markers) == pytest.approx([np.sqrt((0.04 + 0.0225) / 3)])
    assert mean_absolute(output, markers) == pytest.approx(1.0 / 6)
    assert mean_distance(output, markers) == pytest.approx((0.5 + 0.3) / 2)


@given(st.floats(1.1, 50))
def test_relative_accuracy_has_no_unit(factor):
    rng = np.random.default_rng(0)
    markers, output = rng.normal(size=(20, 4, 3)), rng.normal(size=(20, 4, 3))
    assert relative_accuracy(output * factor, markers * factor) == pytest.approx(relative_accuracy(output, markers))
    assert mean_absolute(output * factor, markers * factor) == pytest.approx(factor * mean_absolute(output, markers))


def test_the_criterion_prefers_less_error_and_fewer_parameters():
    assert aicc(1.0, 500, 20) < aicc(2.0, 500, 20)
    assert aicc(1.0, 500, 20) < aicc(1.0, 500, 40)
    assert aicc(1.0, 500, 499) == np.inf
    assert aicc(1.0, 100, 10) == pytest.approx(100 * np.log(0.01) + 20 + 220 / 89)


def test_a_coordinate_that_is_always_zero_has_nothing_to_miss():
    markers = np.zeros((4, 1, 3))
    markers[:, 0, 0] = [1.0, 2.0, 3.0, 4.0]
    assert relative_accuracy(markers, markers).tolist() == [0.0]
    assert relative_accuracy(0.9 * markers, markers) == pytest.approx([0.1 / np.sqrt(3.0)])
