import numpy as np
import pytest

from sim.physics.walking.capture_point import LastingError

DT, HEIGHT = 0.005, 0.9
LEFT, RIGHT = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def learned(errors, step, height=HEIGHT):
    """The learned error by tick, shape (K, 2), m, standing on one foot for `step` seconds, then on the other."""
    lasting = LastingError(height, DT)
    feet = [LEFT if (number * DT) % (2.0 * step) < step else RIGHT for number in range(len(errors))]
    return np.array([lasting.learn(np.array(off), foot).copy() for off, foot in zip(errors, feet, strict=True)])


@pytest.mark.parametrize("step", [0.4, 1.0, 2.0])
def test_an_error_that_changes_sides_with_the_feet_is_not_learned(step):
    ticks = np.arange(0.0, 20.0, DT)
    aside = np.where(ticks % (2.0 * step) < step, 0.01, -0.01)
    seen = learned(np.column_stack([np.zeros(len(ticks)), aside]), step)
    after = seen[round(2.0 * step / DT) :, 1]
    assert np.ptp(after) < 1e-3


@pytest.mark.parametrize("step", [0.4, 1.0])
def test_an_error_that_lasts_is_learned_until_it_is_made_up_for(step):
    ticks = np.arange(0.0, 10.0, DT)
    seen = learned(np.tile([0.01, -0.004], (len(ticks), 1)), step)
    speed = (seen[-1] - seen[len(seen) // 2]) / 5.0
    assert speed == pytest.approx([0.005, -0.002], rel=0.02)


def test_a_push_is_hardly_learned():
    """It moves the capture point by 0.3 m for half a second."""
    errors = np.zeros((round(10.0 / DT), 2))
    errors[200:300, 1] = 0.3
    assert np.abs(learned(errors, 0.5)).max() < 0.01


@pytest.mark.parametrize("height", [0.25, 0.9])
def test_no_more_is_learned_than_a_step_can_bear(height):
    seen = learned(np.tile([1.0, -1.0], (round(60.0 / DT), 1)), 0.5, height)
    assert seen[-1] == pytest.approx([0.12 * height, -0.12 * height])
