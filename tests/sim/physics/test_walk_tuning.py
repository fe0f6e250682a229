import numpy as np
import pytest

from sim.models.robot_file import WalkSettings, read_robot_file, with_walk_table
from sim.physics.walk_trial import Trial, pushes
from sim.physics.walk_tuning import EDGE, SEARCHED, changed, steps, tune_walk
from simulated_bodies import ROBOTS

SECONDS = 10.0


def falls_beyond(share, seeds=None):
    """Walks two courses with a robot that falls at once if its steps are longer than a share of the motion's."""

    def walks(tried, first):
        if seeds is not None:
            seeds.append((first, first + 1))
        stood = [SECONDS if settings.share <= share else 1.0 for settings in tried]
        return [[Trial(s, 10.0, 10.0 * t.share, 0.0, 0.0, 0.0)] * 2 for s, t in zip(stood, tried, strict=True)]

    return walks


@pytest.mark.parametrize("edge", [0.3, 0.7, 1.0])
def test_what_is_kept_stays_away_from_the_edge(edge):
    lines = []
    tuned = tune_walk(WalkSettings(), falls_beyond(edge), 2 * SECONDS, 30, lines.append)
    assert tuned.stood
    assert edge - 0.1 < tuned.settings.share / EDGE <= edge
    assert tuned.walked == (10.0 * tuned.settings.share,) * 2
    assert len(lines) == steps(30)


def test_what_is_told_is_of_pushes_that_nothing_was_chosen_by():
    seeds = []
    tune_walk(WalkSettings(), falls_beyond(1.0, seeds), 2 * SECONDS, 3, lambda words: None)
    assert not set(seeds[-1]) & {seed for tried in seeds[:-1] for seed in tried}


def test_a_robot_that_always_falls_is_told_so():
    tuned = tune_walk(WalkSettings(), falls_beyond(-1.0), 2 * SECONDS, 3, lambda words: None)
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
