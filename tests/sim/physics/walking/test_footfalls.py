import numpy as np
import pytest

from sim.physics.walking.preview import Footfalls
from walking_soles import walking_soles

DT = 0.005


def found(soles, yaws, headings, height=1.0):
    footfalls = Footfalls(height, DT)
    for k, (places, angles, heading) in enumerate(zip(soles, yaws, headings, strict=True)):
        footfalls.add(k * DT, places, angles, heading)
    return footfalls.swings


@pytest.mark.parametrize("step", [0.3, 0.5, 1.0])
def test_every_step_of_a_walk_is_found_when_and_where_it_lands(step):
    swings = found(*walking_soles(1.0 + 5.5 * step, DT, step=step))
    assert [swing.foot for swing in swings] == [0, 1, 0, 1, 0, 1]
    for number, swing in enumerate(swings[:-1]):
        assert swing.start == pytest.approx(1.0 + number * step, abs=0.25 * step)
        assert swing.end == pytest.approx(1.0 + (number + 1) * step, abs=0.15 * step)
        assert swing.from_other[0] == pytest.approx(0.3, abs=0.03)
        assert swing.from_other[1] == pytest.approx(0.2 if swing.foot == 0 else -0.2, abs=0.01)
    assert swings[-1].end is None


def test_steps_of_who_turns_are_seen_from_the_heading():
    swings = found(*walking_soles(4.0, DT, length=0.0, turn=0.3, lift=0.08))
    assert len(swings) > 3
    for swing in swings[:-1]:
        assert np.hypot(*swing.from_other) == pytest.approx(0.2, abs=0.01)
        assert swing.yaw - swing.heading == pytest.approx(0.15, abs=0.05)


def test_who_stands_and_sways_makes_no_step():
    time = np.arange(0.0, 5.0, DT)
    soles = np.zeros((len(time), 2, 3))
    soles[:, 0, 1], soles[:, 1, 1] = 0.1, -0.1
    soles[:, :, 2] = 0.01 * np.sin(2.0 * np.pi * time)[:, None] ** 2
    assert not [swing for swing in found(soles, np.zeros((len(time), 2)), np.zeros(len(time))) if swing.end]


@pytest.mark.parametrize(("step", "steps"), [(0.135, 0), (0.2, 1)])
def test_a_foot_that_shuffles_takes_no_step(step, steps):
    soles, yaws, headings = walking_soles(1.0 + step, DT, length=0.08, step=step)
    still = [np.concatenate([rows, np.repeat(rows[-1:], 100, axis=0)]) for rows in (soles, yaws, headings)]
    assert len(found(*still)) == steps


@pytest.mark.parametrize(("pause", "swings"), [(0.2, 1), (0.5, 2)])
def test_a_foot_that_pauses_on_its_way_makes_one_step(pause, swings):
    there = walking_soles(1.5, DT, step=0.5)
    again = walking_soles(0.5, DT, step=0.5, begins=0.0)
    soles = [there[0], np.repeat(there[0][-1:], round(pause / DT), axis=0), again[0] - again[0][0] + there[0][-1]]
    soles = np.concatenate(soles)
    found_there = found(soles, np.zeros((len(soles), 2)), np.zeros(len(soles)))
    assert [swing.foot for swing in found_there] == [0] * swings


def test_a_foot_that_is_held_in_the_air_is_put_down():
    soles = walking_soles(1.25, DT, step=0.5)[0]
    soles = np.concatenate([soles, np.repeat(soles[-1:], 100, axis=0)])
    assert soles[-1, 0, 2] > 0.04
    (swing,) = found(soles, np.zeros((len(soles), 2)), np.zeros(len(soles)))
    assert swing.end == pytest.approx(1.25 + 0.2, abs=0.05)


def test_stepping_on_the_spot_is_stepping():
    swings = found(*walking_soles(4.0, DT, length=0.0, lift=0.08))
    assert [swing.foot for swing in swings[:4]] == [0, 1, 0, 1]


def test_a_swing_that_is_over_is_forgotten():
    soles, yaws, headings = walking_soles(3.0, DT)
    footfalls = Footfalls(1.0, DT)
    for k, row in enumerate(zip(soles, yaws, headings, strict=True)):
        footfalls.add(k * DT, *row)
    first, *others = footfalls.swings
    footfalls.forget(first)
    assert footfalls.swings == others
