"""The thesis's networks are trained from its recipes and come out as it says."""

import numpy as np
import pytest

from benchmarks.papers.thesis import accuracy, with_failure_figures, with_training_figures
from benchmarks.papers.thesis_figures import NOISE_CHANNELS, THESIS, noisy_targets
from controller.learning.evaluation.evaluation import read_evaluation
from controller.learning.evaluation.failure_rates import Count
from controller.learning.evaluation.tables import Table, failure_table
from controller.learning.recipe import read_recipe
from controller.learning.training_set import prepare
from motiondeck_base.errors import FileFormatError
from motiondeck_base.shipped import shipped_configs

PAPER = shipped_configs() / "libraries" / "paper"


def paper(name):
    return read_recipe(PAPER / f"{name}.toml")


@pytest.mark.parametrize("name", list(THESIS))
def test_every_network_of_the_thesis_has_its_recipe(name):
    recipe = paper(name)
    assert recipe.name == name
    assert recipe.as_recorded
    assert len(recipe.motions) == 15
    assert set(THESIS[name].robustness) <= {motion.name for motion in recipe.motions}


def test_training_errors_are_the_thesis_s_to_5_percent(mocap_data):
    name = "conceptor-4.3"
    table = accuracy(read_evaluation(str(PAPER / f"{name}.toml"), mocap_data), range(1), mocap_data)
    assert [row["network"] for row in table.rows] == ["seed 0", "mean", "thesis", "off by %"]
    for figure, value in THESIS[name].accuracy.items():
        assert table.rows[0][figure] == pytest.approx(value, rel=0.05), figure
        assert table.rows[2][figure] == value


def test_failure_rates_stand_beside_the_thesis_s_with_one_average():
    names = list(THESIS["esn-4.1"].robustness)
    counts = [Count(name, True, 0, 0, 10, 1, None, "freezes") for name in names]
    ours = failure_table("esn-4.1: robustness", counts, [])
    table = with_failure_figures(ours, "esn-4.1", "robustness")
    assert table.title == "table 4.2, esn-4.1: robustness"
    assert [row["motion"] for row in table.rows] == [*names, "average"]
    assert [row["thesis %"] for row in table.rows] == [0.0, 16.0, 35.0, 84.0, 87.0, pytest.approx(44.4)]
    assert {row["intrinsic %"] for row in table.rows} == {10.0}
    assert list(table.rows[0])[:3] == ["motion", "runs", "thesis %"]
    assert with_failure_figures(ours, "another", "robustness") is ours
    assert with_training_figures(Table("t", [], ()), "another").rows == []


def test_recordings_are_taken_as_they_are(mocap_data):
    recipe = paper("conceptor-4.1")
    syllabus = prepare(recipe, mocap_data)
    assert {name: len(part) for name, part in syllabus.before.items()} == dict.fromkeys(syllabus.frames, 50)
    assert len(syllabus.frames["waltz"]) == 850
    lessons = syllabus.lessons()
    everything = np.concatenate([np.concatenate([lesson.before, lesson.frames]) for lesson in lessons.motions])
    varies = lessons.normalisation.scaling > 0.0
    assert np.allclose(everything.min(0)[varies], -1.0)
    assert np.allclose(everything.max(0)[varies], 1.0)


def test_the_noise_of_two_channels_is_blown_up_and_nothing_else_changed(mocap_data):
    recipe = paper("conceptor-4.1")
    lessons = prepare(recipe, mocap_data).lessons().motions
    targets = noisy_targets(lessons, [mocap_data / motion.file for motion in recipe.motions])
    rest = np.setdiff1d(np.arange(61), NOISE_CHANNELS)
    for lesson, target in zip(lessons, targets, strict=True):
        assert np.array_equal(target[:, rest], lesson.frames[:, rest])
        assert not lesson.frames[:, NOISE_CHANNELS].any()
    assert np.abs(np.concatenate(targets)[:, NOISE_CHANNELS]).max() <= 1.0
    assert np.concatenate(targets)[:, NOISE_CHANNELS].std() > 0.05


def test_recordings_of_another_kind_have_no_such_noise(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        noisy_targets([], [tmp_path / "no.mat"])
