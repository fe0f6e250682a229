"""The judge of robots in the world, on a written robot and a written recording."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.recordings.faithful_files import recorded
from benchmarks.robots.world_measure import RobotPoints, human, measure
from benchmarks.robots.world_robots import ROBOTS, written_robot
from benchmarks.robots.written_bend import BEND, ELBOW, PELVIS, SHANK, THIGH, written_bend

BY_NAME = {robot.name: robot for robot in ROBOTS}
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.fixture
def person(tmp_path):
    path = tmp_path / "deposit.bvh"
    path.write_text(written_bend(root_pitch=18.0))
    return human(recorded(path), slice(None))


def standing(name):
    model = mujoco.MjModel.from_xml_string(written_robot(name))
    return model, RobotPoints(BY_NAME[name], model, UPRIGHT), model.qpos0.copy()


def pitch_of(line):
    return np.degrees(np.arctan2(line[..., 0], line[..., 2]))


def test_a_written_bend_is_read_as_it_was_written_though_its_root_is_pitched(person):
    lowest = len(person.hands) // 2
    assert pitch_of(person.lines["trunk"])[0] == pytest.approx(0.0, abs=0.1)
    assert 55.0 < pitch_of(person.lines["trunk"])[lowest] < PELVIS + 2.0 * BEND + 2.0
    assert pitch_of(-person.lines["r_thigh"])[lowest] == pytest.approx(THIGH, abs=0.1)
    assert pitch_of(-person.lines["l_shank"])[lowest] == pytest.approx(SHANK, abs=0.1)
    assert person.hands.min() < 0.35
    assert person.stands.all()


@pytest.mark.parametrize("name", ["no_waist", "ball_forearm"])
def test_a_standing_robot_points_up_and_down(name):
    _, points, qpos = standing(name)
    lines, hand, places = points(qpos)
    assert pitch_of(lines["trunk"]) == pytest.approx(0.0, abs=1e-6)
    for side in "rl":
        for limb in ("thigh", "shank", "upper_arm", "forearm"):
            assert lines[f"{side}_{limb}"] @ [0.0, 0.0, -1.0] > 0.999
    assert points.hip_height == pytest.approx(0.72, abs=0.01)
    assert 0.8 < hand < 1.2
    assert points.heights(places).min() == pytest.approx(0.02, abs=1e-6)


def test_a_tilted_pelvis_a_turned_elbow_and_a_slide_are_seen(person):
    model, points, qpos = standing("no_waist")
    elbows = [int(model.joint(f"{side}_elbow").qposadr[0]) for side in ("left", "right")]
    qpos[elbows] = np.radians(ELBOW)
    frames = np.tile(qpos, (20, 1))
    before = measure(points, frames, person, 60.0)
    assert before["trunk"] < 1.0
    assert before["slide"] == before["beyond"] == 0.0
    frames[:, 3:7] = Rotation.from_euler("y", 20.0, degrees=True).as_quat(scalar_first=True)
    frames[:, elbows] = 2.6  # of a range up to 2.5
    frames[:, 0] = 0.01 * np.arange(20)
    after = measure(points, frames, person, 60.0)
    assert after["trunk"] == pytest.approx(20.0, abs=1.0)
    assert after["forearm"] > before["forearm"] + 50.0
    assert after["slide"] == pytest.approx(600.0)
    assert after["beyond"] == 40
