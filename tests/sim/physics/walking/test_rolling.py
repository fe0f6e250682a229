import numpy as np
import pytest

from sim.models.robot_file import WalkSettings
from sim.physics.walking.gait import Gait
from sim.physics.walking.preview import Footfalls
from sim.physics.walking.rolling import from_flat
from walking_soles import walking_soles

DT, PREVIEW, HALF = 0.005, 1.2, 0.1
TOE, HEEL = 0.4, 0.2


@pytest.mark.parametrize("pitch", [0.3, -0.3])
def test_the_edge_that_a_turned_sole_stands_on_stays_where_it_is(pitch):
    ahead, up = from_flat(pitch, HALF)
    to_edge = np.copysign(HALF, pitch)
    # Seen from the side, x ahead and z up: a sole that is turned toes down.
    edge = ahead + to_edge * np.cos(pitch), up - to_edge * np.sin(pitch)
    assert edge == pytest.approx((to_edge, 0.0), abs=0.05 * HALF)


def rolled(seconds, toe=TOE, heel=HEEL, motion=(9.0, -9.0), **walk):
    """A gait that walks after a motion whose soles are turned so far as they leave the floor and land.

    At each tick: which foot swings, 2 if none does; and the pitches of the soles.
    """
    settings = WalkSettings(share=1.0, longest=0.5, fastest=9.0, width=0.2, toe=toe, heel=heel)
    gait, footfalls, rows = (
        Gait(settings, 1.0, 2.0 * HALF, np.array([1.0, -1.0]), 2.2 * settings.width),
        Footfalls(1.0, DT),
        [],
    )
    gait.start(np.zeros(2), 0.0, np.zeros(2))
    for k, row in enumerate(zip(*walking_soles(seconds + PREVIEW, DT, **walk), strict=True)):
        swinging = bool(footfalls.swings and footfalls.swings[-1].end is None)
        footfalls.add(k * DT, *row, np.full(2, motion[int(swinging)]))
        ended = gait.advance((k + 1) * DT - PREVIEW, footfalls.swings, PREVIEW)
        if ended is not None:
            footfalls.forget(ended)
        rows.append((2 if gait.step is None else gait.step.foot, *gait.rolling.pitches))
    rows = np.array(rows)
    return rows[:, 0].astype(int), rows[:, 1:]


def test_feet_leave_over_their_toes_and_land_on_their_heels():
    swings, pitches = rolled(7.0, length=0.5, step=0.6)
    for foot in range(2):
        own = swings == foot
        leaves = np.flatnonzero(~own[:-1] & own[1:])[2:]
        lands = np.flatnonzero(own[:-1] & ~own[1:])[2:]
        assert len(lands) > 1
        # The longest step is 0.5 heights long.
        assert pitches[leaves, foot] == pytest.approx(TOE, abs=0.05)
        assert pitches[lands, foot] == pytest.approx(-HEEL, abs=0.05)
        # The foot that carries the body alone is flat until shortly before it leaves.
        alone = swings == 1 - foot
        assert np.mean(np.abs(pitches[alone, foot]) < 0.01) > 0.5


def test_soles_turn_without_jumps():
    _, pitches = rolled(6.0, length=0.5, step=0.6)
    assert np.abs(pitches).max() > 0.5 * TOE
    assert np.abs(np.diff(pitches, axis=0)).max() / DT < 10.0


@pytest.mark.parametrize("walk", [{"length": 0.0, "lift": 0.1}, {"begins": 100.0}, {"length": -0.25}])
def test_who_does_not_go_ahead_keeps_the_soles_flat(walk):
    _, pitches = rolled(4.0, step=0.6, **walk)
    assert np.abs(pitches).max() < 0.02


@pytest.mark.parametrize("motion", [(0.0, 0.0), (-0.2, 0.2)])
def test_feet_roll_no_farther_than_in_the_motion(motion):
    # A boxer's step is as long as a walker's, but his soles stay flat.
    _, pitches = rolled(4.0, motion=motion, length=0.5, step=0.6)
    assert not pitches.any()


def test_a_robot_that_does_not_roll_its_feet_keeps_them_flat():
    _, pitches = rolled(4.0, toe=0.0, heel=0.0, length=0.5, step=0.6)
    assert not pitches.any()
