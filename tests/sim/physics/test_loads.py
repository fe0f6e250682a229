"""Tests of the balance that inverse dynamics predicts, on numbers that can be worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.physics.loads import Loads

SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])


def moving(height, velocity, support=SQUARE):
    """One sample of a body whose centre of mass is above the middle of its support and moves along x."""
    row = np.zeros((1, 1))
    return Loads(
        velocity=row, gravity=row, damping=row, inertia=row, friction=row,
        collision=np.zeros(1), colliding="", lowest=np.zeros(1), slide=np.zeros(1), support=(support,),
        lies=np.zeros(1, dtype=bool), com=np.array([[0.0, 0.0, height]]), com_velocity=np.array([[velocity, 0.0]]),
    )  # fmt: skip


@given(st.floats(0.05, 1.5), st.floats(0.0, 1.0), st.floats(0.1, 3.0))
def test_the_capture_point_is_ahead_by_the_speed_over_the_pendulums_frequency(height, velocity, tempo):
    """x + v / sqrt(g / h) (Pratt et al. 2006, eq. 3), so a body four times as high needs twice the room."""
    ahead = tempo * velocity * np.sqrt(height / 9.81)
    assert moving(height, velocity).balance(tempo) == pytest.approx(0.1 - ahead, abs=1e-9)


def test_nothing_stands_without_feet():
    assert moving(0.5, 0.0, np.empty((0, 2))).balance() == -np.inf
