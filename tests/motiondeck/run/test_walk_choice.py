"""Which robots are let walk: those that stood in a trial, with the settings with which they did."""

import re
from dataclasses import replace

import numpy as np
import pytest

from motiondeck.run.robots import walk_choice
from motiondeck.run.robots.walk_choice import WALKS, able_to_walk
from motiondeck_base.errors import MotiondeckError
from shipped_libraries import shipped
from sim.models.robot_file import WalkSettings
from sim.physics.walk_trial import Course, Trial
from sim.robots.robot import DT, load_robot
from simulated_bodies import ROBOTS


@pytest.fixture(scope="module")
def untuned(tmp_path_factory):
    """The file of a servo20 that has no table [walk], and the robot."""
    file = tmp_path_factory.mktemp("untuned") / "untuned.toml"
    text = re.sub(r"\[walk\]\n(?:\w.*\n)*", "", (ROBOTS / "servo20.toml").read_text())
    file.write_text(text.replace('"servo20.xml"', f'"{ROBOTS / "servo20.xml"}"'))
    return file, load_robot(file, shipped().skeleton)


@pytest.fixture
def trials(monkeypatch, tmp_path):
    """The settings that were tried; a test says in `stood` how long each stands."""
    tried, stood = [], {}
    course = Course(np.zeros((400, 1)), np.zeros((400, 7)), np.zeros(400))

    def trial(robot, course, settings):
        tried.append(settings)
        seconds = stood[settings]
        if isinstance(seconds, MotiondeckError):
            raise seconds
        return Trial(seconds, 1.0, 1.0, 0.0, 0.0, 0.0, "r_knee" if seconds < 1.0 else "")

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(walk_choice, "play_course", lambda *_: course)
    monkeypatch.setattr(walk_choice, "walk_trial", trial)
    return tried, stood


WHOLE = 400 * DT


def test_the_first_settings_with_which_it_stands_are_taken_and_kept(untuned, trials):
    file, robot = untuned
    tried, stood = trials
    stood.update(dict.fromkeys(WALKS, WHOLE) | {WALKS[0]: 0.5})
    assert able_to_walk(robot, file).walk == WALKS[1]
    assert tried == [*WALKS[:2]]
    assert able_to_walk(robot, file).walk == WALKS[1]
    assert len(tried) == 2


def test_a_robot_that_falls_with_all_is_refused_in_one_line_with_its_weakest_joint(untuned, trials):
    file, robot = untuned
    tried, stood = trials
    stood.update(dict.fromkeys(WALKS, 0.5))
    for _ in range(2):
        with pytest.raises(MotiondeckError, match=r"falls after 0\.5 s, with r_knee at its torque limit") as refused:
            able_to_walk(robot, file)
        assert "\n" not in str(refused.value)
    assert len(tried) == len(WALKS)


def test_what_a_walker_refuses_at_once_is_the_reason(untuned, trials):
    file, robot = untuned
    _, stood = trials
    stood.update(dict.fromkeys(WALKS, MotiondeckError("it has no ankle")))
    with pytest.raises(MotiondeckError, match="it has no ankle"):
        able_to_walk(robot, file)


@pytest.mark.parametrize("change", ["range", "mass"])
def test_another_body_is_tried_anew(untuned, trials, change):
    file, robot = untuned
    tried, stood = trials
    stood.update(dict.fromkeys(WALKS, WHOLE))
    able_to_walk(robot, file)
    other = replace(robot, limits=replace(robot.limits, upper=robot.limits.upper + 0.1))
    if change == "mass":
        spec = robot.spec.copy()
        spec.body("r_shank").geoms[0].mass = 1.0
        other = replace(robot, spec=spec, model=spec.compile())
    able_to_walk(other, file)
    assert len(tried) == 2


def test_a_robot_whose_file_says_how_it_walks_is_not_tried(untuned, trials):
    file, robot = untuned
    tuned = replace(robot, walk=WalkSettings(share=0.5))
    assert able_to_walk(tuned, file) is tuned
    assert trials[0] == []


def test_where_nothing_can_be_kept_it_is_tried_each_time(untuned, trials, tmp_path, monkeypatch):
    file, robot = untuned
    tried, stood = trials
    stood.update(dict.fromkeys(WALKS, WHOLE))
    (tmp_path / "no folder").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "no folder"))
    assert able_to_walk(robot, file).walk == able_to_walk(robot, file).walk == WALKS[0]
    assert len(tried) == 2
