import numpy as np
import pytest

from sim.models.robot_file import read_robot_file
from sim.models.walk_settings import WalkSettings, with_walk_table
from sim.physics import walk_tuning
from sim.physics.walk_trial import Course, Trial, pushes
from sim.physics.walk_tuning import EDGE, SEARCHED, changed, tune_walk
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

COURSE = Course(np.zeros((2000, 1)), np.zeros((2000, 7)), np.zeros(2000))


@pytest.fixture
def robot():
    return load_robot(ROBOTS / "servo20.toml", human())


def falls_beyond(share):
    """A walk trial of a robot that falls at once if its steps are longer than a share of the motion's."""

    def trial(robot, course, impulse, seed, settings):
        stood = course.seconds if settings.share <= share else 1.0
        return Trial(stood, 10.0, 10.0 * settings.share, 0.0, 0.0, 0.0)

    return trial


@pytest.mark.parametrize("edge", [0.3, 0.7, 1.0])
def test_what_is_kept_stays_away_from_the_edge(robot, monkeypatch, edge):
    monkeypatch.setattr(walk_tuning, "walk_trial", falls_beyond(edge))
    told = []
    tuned = tune_walk(robot, [COURSE, COURSE], 0.24, 20, told.append)
    assert tuned.stood
    assert edge - 0.1 < tuned.settings.share / EDGE <= edge
    assert tuned.walked == (10.0 * tuned.settings.share,) * 2
    assert len(told) == 20 + walk_tuning.HALVINGS + 1


def test_what_is_told_is_of_pushes_that_nothing_was_chosen_by(robot, monkeypatch):
    seeds = []

    def trial(robot, course, impulse, seed, settings):
        seeds.append(seed)
        return Trial(course.seconds, 10.0, 10.0, 0.0, 0.0, 0.0)

    monkeypatch.setattr(walk_tuning, "walk_trial", trial)
    tune_walk(robot, [COURSE, COURSE], 0.24, 3, lambda words: None)
    assert not set(seeds[-2:]) & set(seeds[:-2])


def test_a_robot_that_always_falls_is_told_so(robot, monkeypatch):
    monkeypatch.setattr(walk_tuning, "walk_trial", falls_beyond(-1.0))
    tuned = tune_walk(robot, [COURSE], 0.24, 3, lambda words: None)
    assert not tuned.stood
    assert tuned.edge == 0.0


def test_settings_change_within_what_makes_sense():
    random = np.random.default_rng(3)
    for _ in range(50):
        found = changed(WalkSettings(), 2.0, random)
        for name, (least, most) in SEARCHED.items():
            assert least <= getattr(found, name) <= most
        assert found.share == WalkSettings().share


@pytest.mark.parametrize("name", ["servo20", "mannequin"])
def test_a_robot_file_gets_its_table_and_keeps_the_rest(tmp_path, name):
    text = (ROBOTS / f"{name}.toml").read_text()
    settings = WalkSettings(share=0.25, roll=0.5)
    for before in (text, text[: text.index("[walk]")], text + "\n# the end\n"):
        file = tmp_path / "robot.toml"
        new = with_walk_table(before, settings)
        file.write_text(new)
        assert read_robot_file(file).walk == settings
        assert new.startswith(text[: text.index("[walk]")].rstrip())
    assert "# the end" in new


def test_pushes_come_from_four_sides_in_turn():
    times = np.arange(0.0, 30.0, 0.005)
    forces = np.array([pushes(0.5, 0)(now) for now in times])
    assert np.allclose(forces.sum(axis=0) * 0.005, [0.5, 0.0, 0.0], atol=0.03)
    pushed = [tuple(np.sign(np.round(pushes(0.5, 0)(now + 0.05)))) for now in (5.0, 10.0, 15.0, 20.0, 25.0)]
    assert pushed == [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (1, 0, 0)]
    assert not np.allclose(forces, [pushes(0.5, 1)(now) for now in times])
