from dataclasses import replace

import numpy as np
import pytest

from controller.motion.rotations import from_rotation_vector, multiply
from sim.physics.rehearsal.plant import Plant, Variation
from sim.physics.rehearsal.rehearse import FALLEN, cost, rehearse
from sim.physics.rehearsal.verdict import repeated
from sim.physics.rehearsal.wanted_motion import WantedMotion
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

SERVO20 = load_robot(ROBOTS / "servo20.toml", human(), dt=0.01)
STANDING = SERVO20.model.qpos0.copy()
SERVO20.layout.place(SERVO20.rest, STANDING)


def held(joint, angle, count=60):
    """A robot that stands and is to hold a joint at an angle, from there on."""
    targets = np.tile(SERVO20.rest, (count, 1))
    targets[:, SERVO20.joints.index(joint)] = angle
    start = STANDING.copy()
    SERVO20.layout.place(targets[0], start)
    return WantedMotion(targets, np.tile(start, (count, 1)))


def test_a_posture_costs_nothing_where_it_is_wanted_and_more_the_farther_it_is_off():
    goal = STANDING[None]
    raised, turned, fallen, broken = (STANDING.copy() for _ in range(4))
    raised[SERVO20.layout.hinge_qpos[4]] += 0.3
    turned[3:7] = multiply(from_rotation_vector(np.array([0.0, 0.3, 0.0])), STANDING[3:7])
    fallen[2] = 0.1
    broken[0] = np.nan
    found = [float(cost(SERVO20, one[None], goal)[0]) for one in (STANDING, raised, turned, fallen, broken)]
    assert found[0] == 0.0
    assert 0.0 < found[1] < found[2] < FALLEN < found[3] < found[4] == 1e3


def plant(threads=1):
    found = Plant(SERVO20, STANDING, threads)
    found.put([Variation(), Variation(strength=0.9, friction=0.8, off=0.01, seed=1)])
    return found


def test_who_would_fall_learns_to_stand():
    # Ankles that are bent by so much tip the robot over.
    targets = held("l_ankle_pitch", 0.2).targets
    targets[:, SERVO20.joints.index("r_ankle_pitch")] = 0.2
    costs = []
    wanted = WantedMotion(targets, np.tile(STANDING, (60, 1)))
    found = rehearse(SERVO20, wanted, plant(), 12, 6, 0, costs.append)
    assert len(costs) == 6
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.7 * costs[0]
    assert found.targets.shape == targets.shape
    # It begins where the motion does, so that nothing jumps.
    assert np.array_equal(found.targets[0], targets[0])
    assert (found.targets >= SERVO20.limits.lower).all()
    assert (found.targets <= SERVO20.limits.upper).all()


def test_the_same_seed_finds_the_same():
    wanted = held("l_knee", 0.2, 30)

    def found(seed):
        return rehearse(SERVO20, wanted, plant(threads=2), 6, 2, seed).targets

    assert np.array_equal(found(3), found(3))
    assert not np.array_equal(found(3), found(4))


def test_it_is_told_how_long_a_motion_was_kept_and_how_far_it_was_off():
    still = WantedMotion(np.tile(SERVO20.rest, (60, 1)), np.tile(STANDING, (60, 1)))
    stood = repeated(SERVO20, still.targets, still, Variation(off=0.005, seed=1))
    assert stood.kept
    assert stood.kept_s == pytest.approx(0.59, abs=0.01)
    assert 0.0 < stood.joints_deg < 3.0
    assert stood.tilt_deg < 3.0
    tipped = still.targets.copy()
    for side in "rl":
        tipped[:, SERVO20.joints.index(f"{side}_ankle_pitch")] = np.linspace(0.0, 1.2, 60)
    fell = repeated(SERVO20, tipped, WantedMotion(tipped, np.tile(STANDING, (60, 1))), Variation())
    assert fell.tilt_deg > 3.0 * stood.tilt_deg
    assert stood.asked == 0.0
    ahead = np.tile(STANDING, (60, 1))
    ahead[:, 0] += np.linspace(0.0, 0.3, 60)
    fell = repeated(SERVO20, tipped, WantedMotion(tipped, ahead), Variation())
    assert fell.asked == pytest.approx(0.3)
    assert fell.went < -0.005  # toes that are pressed down tip it over backwards


def test_who_has_fallen_before_anything_moved_kept_to_nothing():
    still = held("l_knee", 0.5)
    above = still.qpos.copy()
    above[:, 2] += 1.0
    fell = repeated(SERVO20, still.targets, WantedMotion(still.targets, above), Variation())
    assert (fell.kept, fell.kept_s) == (False, 0.0)


@pytest.mark.parametrize("robot", [SERVO20, replace(SERVO20, servo=None)], ids=["servos", "as the model has them"])
def test_a_weaker_robot_is_farther_off(robot):
    still = held("l_knee", 0.5)
    strong, weak = (repeated(robot, still.targets, still, Variation(strength=share)) for share in (1.0, 0.1))
    assert weak.joints_deg > 1.2 * strong.joints_deg


def test_a_motion_of_any_length_is_repeated():
    for count in (204, 7):
        still = WantedMotion(np.tile(SERVO20.rest, (count, 1)), np.tile(STANDING, (count, 1)))
        assert repeated(SERVO20, still.targets, still, Variation()).seconds == pytest.approx(0.01 * count, abs=0.016)
