import numpy as np
import pytest

from sim.physics.playback import PhysicsPlayback
from sim.physics.rehearsal.plant import Plant, Variation, variations
from sim.physics.walk_trial import placed_pose
from sim.robots.robot import DT, load_robot
from simulated_bodies import ROBOTS, human

SERVO20 = load_robot(ROBOTS / "servo20.toml", human())
STANDING = SERVO20.model.qpos0.copy()
SERVO20.layout.place(SERVO20.rest, STANDING)


def plant_of(*varied, threads=1):
    plant = Plant(SERVO20, STANDING, threads)
    plant.put(varied or [Variation()])
    return plant


def raised(count, angle=2.0):
    """Both arms are raised forwards, faster than the servos can, from rest."""
    targets = np.tile(SERVO20.rest, (count, 1))
    for name in ("r_shoulder_pitch", "l_shoulder_pitch"):
        targets[5:, SERVO20.joints.index(name)] = -angle
    return targets


def test_its_servos_are_those_of_the_simulation():
    targets = raised(60)
    went = plant_of().advance(targets, targets[0])[0]
    stage = PhysicsPlayback(SERVO20, DT, "free")
    stage.write(targets[0], placed_pose(STANDING[:7], 0.0))
    stage.data.qpos[:], stage.data.qvel[:] = STANDING, 0.0
    before = targets[0]
    for k, target in enumerate(targets):
        stage.write(0.5 * (before + target), placed_pose(STANDING[:7], 0.0))
        stage.write(target, placed_pose(STANDING[:7], 0.0))
        before = target
        assert np.abs(stage.qpos - went[k]).max() < 0.03
    arm = SERVO20.layout.hinge_qpos[SERVO20.joints.index("r_shoulder_pitch")]
    # As fast as a servo turns under load and no faster.
    assert -0.95 < (went[20, arm] - went[10, arm]) / (0.1 * 4.8) < -0.7


def test_weak_servos_and_a_slippery_floor_make_a_difference():
    plant = plant_of(Variation(), Variation(strength=0.1), Variation(friction=0.01))
    plain, weak, slippery = plant.advance(raised(80), SERVO20.rest)
    assert np.abs(weak - plain).max() > 0.05
    assert np.abs(slippery - plain).max() > 1e-4


def test_what_is_tried_changes_nothing_and_comes_near_what_is_done():
    plant = plant_of(threads=2)
    before = plant.states.copy()
    courses = np.stack([raised(40, angle) for angle in (0.2, 0.4)])
    tried = plant.tried(courses, SERVO20.rest)
    assert tried.shape == (2, 1, 40, SERVO20.model.nq)
    assert np.array_equal(plant.states, before)
    done = plant.advance(courses[1], SERVO20.rest)
    assert np.abs(done[0] - tried[1, 0]).max() < 0.02
    again = plant.advance(courses[1][-1:], courses[1][-1])
    assert np.abs(again[0, 0] - done[0, -1]).max() < 0.02


def test_a_course_that_breaks_is_no_number_from_there_on_and_leaves_no_log(tmp_path, monkeypatch):
    """MuJoCo puts it back to its start, where it stands as if it had been told to: the best of all courses."""
    monkeypatch.chdir(tmp_path)
    plant = plant_of(Variation(), Variation(), Variation())
    plant.states[1, 1 + 2] = 1e12  # its height
    plant.states[2, 1 + SERVO20.model.nq] = 1e11  # how fast it flies
    sound, high, fast = plant.tried(raised(10)[None], SERVO20.rest)[0]
    assert np.isfinite(sound).all()
    assert np.isnan(high).all()
    assert np.isnan(fast).all()
    assert list(tmp_path.iterdir()) == []


def test_it_is_put_where_it_starts_again_with_other_errors():
    plant = plant_of(Variation(off=0.05, seed=1))
    first = plant.states.copy()
    plant.advance(raised(20), SERVO20.rest)
    plant.put([Variation(off=0.05, seed=2)])
    assert 1e-3 < np.abs(plant.states - first).max() < 0.3
    plant.put([Variation(off=0.05, seed=1)])
    assert np.array_equal(plant.states, first)


def test_variations_keep_within_the_worst_and_the_first_is_the_robot_itself():
    worst = Variation(strength=0.8, friction=0.6, off=0.05)
    found = variations(20, 3, worst)
    assert found[0] == Variation()
    assert all(0.8 <= one.strength <= 1.0 and 0.6 <= one.friction <= 1.0 for one in found)
    assert len({one.seed for one in found}) == 20
    assert np.array_equal(found[0].start(SERVO20, STANDING), STANDING)
    off = found[1].start(SERVO20, STANDING)
    assert 0.01 < np.abs(off - STANDING)[7:].std() < 0.1
    assert np.linalg.norm(off[3:7]) == pytest.approx(1.0)
