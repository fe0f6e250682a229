import mujoco
import numpy as np
import pytest

from sim.models.surface import LowestPoint
from sim.physics.played_motions import DT, PlayedMotion
from sim.physics.rehearsal.wanted_motion import HOLDS, JOINS, wanted_motion
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human

SERVO20 = load_robot(ROBOTS / "servo20.toml", human(), dt=DT)
BEAT = np.sqrt(0.24 / 9.81)


def played(loop=False, crouch=0.4, count=50):
    """A body that goes into its knees, or stands on one leg for a crouch of 0."""
    poses = [
        bent_pose(human(), rkne=(0, -a, 0), lkne=(0, -a, 0), rank=(0, 2 * a, 0), lank=(0, 2 * a, 0))
        for a in np.linspace(0.0, crouch, count)
    ]
    targets = np.array([SERVO20.retarget(pose).copy() for pose in poses])
    return PlayedMotion("crouch", loop, targets, tuple(poses))


def parts(wanted):
    """How long what comes before and after the 49 samples of the motion is, s."""
    return (len(wanted) - 49) * DT


def test_what_is_played_once_begins_at_rest_and_ends_there_if_it_ends_on_its_feet():
    up = wanted_motion(SERVO20, played(crouch=0.1))
    assert parts(up) == pytest.approx((2 * JOINS + HOLDS) * BEAT, abs=0.05)
    assert np.allclose(up.targets[[0, -1]], SERVO20.rest, atol=0.02)
    down = wanted_motion(SERVO20, played(crouch=1.2))
    assert parts(down) == pytest.approx(JOINS * BEAT, abs=0.02)
    assert np.abs(down.targets[-1] - SERVO20.rest).max() > 0.5


def test_its_lowest_point_is_on_the_floor():
    wanted, lowest = wanted_motion(SERVO20, played()), LowestPoint(SERVO20.model)
    data = mujoco.MjData(SERVO20.model)
    for qpos in wanted.qpos[::20]:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(SERVO20.model, data)
        assert abs(lowest(data)) < 1e-6


def test_a_loop_goes_round_and_is_not_brought_to_rest():
    wanted = wanted_motion(SERVO20, played(loop=True, crouch=1.2), rounds=3)
    assert len(wanted) == pytest.approx(3 * 49 + JOINS * BEAT / DT, abs=2)


def test_a_slower_tempo_takes_longer():
    fast, slow = (len(wanted_motion(SERVO20, played(loop=True, crouch=1.2), tempo=tempo)) for tempo in (1.0, 0.5))
    assert slow - fast == pytest.approx(49, abs=2)
