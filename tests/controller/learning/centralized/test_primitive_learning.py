"""Movement primitives: mean and spread of what was shown, through points that are given."""

import numpy as np
import pytest

from controller.learning.centralized.motion_training import learn_primitive
from controller.networks.centralized.movement_primitive import MovementPrimitive
from motiondeck_base.errors import MotiondeckError

PHASE = np.linspace(0.0, 1.0, 101)


def reach(goal: float, frames: int = 101) -> np.ndarray:
    """A hand that goes to a goal and back a little, beside a body that leans the other way; shape (frames, 3)."""
    s = np.linspace(0.0, 1.0, frames)
    way = 10 * s**3 - 15 * s**4 + 6 * s**5
    return np.stack([goal * way, np.sin(np.pi * s) + 0.2 * goal * s, -0.5 * goal * way], axis=-1)


GOALS = (0.6, 0.8, 1.0, 1.2)


@pytest.fixture(scope="module")
def primitive() -> MovementPrimitive:
    return learn_primitive([reach(goal, 90 + 10 * k) for k, goal in enumerate(GOALS)], 100.0, satellites=15)


def test_mean_and_spread_are_those_of_what_was_shown(primitive):
    shown = np.stack([reach(goal) for goal in GOALS])
    assert np.allclose(primitive.mean(PHASE), shown.mean(0), atol=0.01)
    spread = primitive.spread(PHASE)
    expected = np.hypot(shown.std(0, ddof=1), primitive.bend)
    assert np.allclose(spread, expected, atol=0.01)
    assert spread[-1, 0] > 5 * spread[0, 0] - 5 * primitive.bend[0]


def test_an_end_that_was_not_shown_bends_the_rest_of_the_motion_as_demonstrations_do(primitive):
    wanted = reach(1.05)
    bent = primitive.ending_at(wanted[-1])
    assert np.allclose(bent.mean(PHASE)[-1], wanted[-1], atol=1e-4)
    assert np.abs(bent.mean(PHASE) - wanted).max() < 0.05
    assert np.abs(primitive.mean(PHASE) - wanted).max() > 0.1
    assert bent.spread(PHASE)[-1].max() < 1e-3 < primitive.spread(PHASE)[-1].min()


def test_one_channel_tells_of_the_others(primitive):
    """The hand's goal alone says how far the body leans."""
    wanted = reach(0.7)
    bent = primitive.through(1.0, wanted[-1, :1], channels=np.array([0]))
    assert abs(bent.mean(PHASE)[-1, 2] - wanted[-1, 2]) < 0.02 < abs(primitive.mean(PHASE)[-1, 2] - wanted[-1, 2])


def test_a_via_point_that_no_mixture_reaches_is_reached_and_forgotten(primitive):
    before = primitive.mean(PHASE)
    point = before[50] + np.array([0.0, 0.3, 0.0])
    bent = primitive.through(0.5, point)
    assert np.allclose(bent.mean(PHASE)[50], point, atol=1e-4)
    assert np.abs(bent.mean(PHASE)[:5] - before[:5]).max() < 0.03
    both = bent.ending_at(before[-1])
    assert np.allclose(both.mean(PHASE)[[50, -1]], [point, before[-1]], atol=1e-4)


def test_a_point_that_may_be_missed_is_approached(primitive):
    end = primitive.mean(PHASE)[-1]
    near = primitive.ending_at(end + 1.0, deviation=1e3).mean(PHASE)[-1]
    assert np.abs(near - end).max() < 0.05


def test_numbers_are_taken_in_any_form_and_it_prints_in_a_line(primitive):
    given = primitive.through(0.5, 0.25, channels=2).ending_at([0.1, 0.2, 0.3])
    assert given.mean(0.5)[0, 2] == pytest.approx(0.25, abs=1e-4)
    assert given.mean([0, 1])[1] == pytest.approx([0.1, 0.2, 0.3], abs=1e-4)
    assert given.spread(1).shape == (1, 3)
    assert str(primitive) == "<movement primitive: 4 demonstrations of 3 channels>"
    assert repr(given) == "<movement primitive: 4 demonstrations of 3 channels, through 4 given values>"


def test_it_lasts_as_long_as_demonstrations_or_as_is_said(primitive):
    assert primitive.play(100.0).shape == (round(100 * np.mean([0.89, 0.99, 1.09, 1.19])) + 1, 3)
    assert primitive.play(50.0, 2.0).shape == (101, 3)
    assert np.allclose(primitive.play(50.0, 2.0), primitive.mean(PHASE))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda p: p.through(1.5, np.zeros(3)), "the phase of a point is 1.5; it lies between 0 and 1"),
        (lambda p: p.through("half", np.zeros(3)), "the phase of a point is 'half'"),
        (lambda p: p.ending_at(np.zeros(2)), "a point of 2 values; 3 are needed"),
        (lambda p: p.ending_at([0.0, np.nan, 0.0]), "a point is nan; give finite numbers"),
        (lambda p: p.ending_at({}), "a point is {}; give numbers in a row"),
        (
            lambda p: p.through(0.5, np.zeros(1), channels=np.array([3])),
            r"channels \[3\]; give whole numbers from 0 to 2",
        ),
        (lambda p: p.through(0.5, [0.0], channels=[0.5]), r"channels \[0.5\]; give whole numbers"),
        (lambda p: p.ending_at(np.zeros(3), deviation=-1.0), "the deviation of a point is -1.0"),
        (lambda p: p.mean([0.0, 1.2]), "a phase is 1.2; it lies between 0 and 1"),
        (lambda p: p.spread(np.eye(2)), r"a phase is of shape \(2, 2\); give numbers in a row"),
        (lambda p: p.play(100.0, 0.0), "cannot be played"),
        (lambda p: learn_primitive([], 100.0), "one demonstration at least"),
        (lambda p: learn_primitive([reach(1.0), reach(1.0)[:, :2]], 100.0), "demonstration 1 has 2 channels"),
    ],
)
def test_what_makes_no_sense_is_refused(primitive, wrong, says):
    with pytest.raises(MotiondeckError, match=says):
        wrong(primitive)
