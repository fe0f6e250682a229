"""`motiondeck evaluate` on a library made up for tests: recordings are only needed where a recipe is read."""

import csv
import json
from dataclasses import replace

import msgspec
import pytest

import synthetic
from command_line import invoked
from controller.learning.evaluation.evaluation import Evaluation
from controller.learning.evaluation.failure_rates import Count
from controller.learning.evaluation.tables import Table, failure_table
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.library.motion_library import save_library
from motiondeck.cli.common.tables import print_measurements, write_csv
from motiondeck.cli.evaluate import accuracy
from motiondeck.pictures.figures import check_picture
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.files import check_folder
from motiondeck_base.shipped import shipped_configs
from shipped_libraries import shipped


def invoke(*words):
    return invoked("evaluate", *words)


def counts():
    return [Count("walk", True, seed, seed, 50, seed, 0, "moves too slowly" if seed else "") for seed in range(3)]


def test_a_table_prints_intervals_and_goes_into_csv(tmp_path, capsys):
    table = failure_table("three networks", counts(), ["a note"])
    print_measurements(table)
    shown = capsys.readouterr().out
    assert "three networks" in shown
    assert "2.0 (0.7-5.8)" in shown
    assert "a note" in shown
    write_csv(table, tmp_path / "table.csv")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["intrinsic by seed"] == "0 1 2"
    assert rows[0]["why the first failed"] == "moves too slowly"


def test_a_network_that_was_drawn_again_is_named_by_the_seed_that_draws_it():
    first, second, _ = counts()
    assert "drawn with seed" not in failure_table("as asked", [first, second], []).rows[0]
    table = failure_table("drawn again", [first, replace(second, drawn=10_001)], [])
    assert {row["drawn with seed"] for row in table.rows} == {"0 10001"}


def test_a_plot_is_drawn_where_matplotlib_is(tmp_path):
    pytest.importorskip("matplotlib")
    from motiondeck.pictures.table_plots import draw_bars

    draw_bars(failure_table("three networks", counts(), []), tmp_path / "plot.png")
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_training_errors_of_another_size_have_panels_of_their_own(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    from motiondeck.pictures import table_plots

    drawn = []
    monkeypatch.setattr(table_plots, "save", lambda figure, path: drawn.append(figure))
    rows = [{"network": "seed 0", "a": 0.001, "b": 0.5}, {"network": "off by %", "a": -3.0, "b": None}]
    table_plots.draw_bars(Table("t", rows, ("a", "b")), tmp_path / "plot.png")
    panels = drawn[0].axes
    assert [axes.get_ylabel() for axes in panels] == ["a", "b"]
    assert [label.get_text() for label in panels[0].get_xticklabels()] == ["seed 0"]


def test_without_matplotlib_a_plot_names_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(MotiondeckError, match=r"pip install 'motiondeck\[plot\]'"):
        check_picture(tmp_path / "plot.png")


def test_a_folder_that_takes_no_files_is_refused_before_anything_is_computed(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: False)  # as on a read-only file system
    with pytest.raises(MotiondeckError, match=r"mine\.safetensors: nothing can be written to the folder .* Give"):
        check_folder(tmp_path / "mine.safetensors")


def test_a_picture_that_cannot_be_written_is_refused_before_anything_is_computed(tmp_path):
    pytest.importorskip("matplotlib")
    with pytest.raises(MotiondeckError, match="pictures end in"):
        check_picture(tmp_path / "plot.doc")
    with pytest.raises(MotiondeckError, match="no such folder"):
        check_picture(tmp_path / "none" / "plot.png")


def test_a_folder_that_is_not_there_is_named(tmp_path):
    result = invoke("thesis15", "robustness", "--data", tmp_path / "none")
    assert isinstance(result.exception, MotiondeckError)
    assert "there is no such folder; --data" in str(result.exception)


def test_a_library_without_its_recipe_cannot_be_judged(tmp_path):
    save_library(synthetic.small_library(), tmp_path / "small.safetensors")
    result = invoke(tmp_path / "small.safetensors", "stability", "--data", tmp_path)
    assert isinstance(result.exception, FileFormatError)
    assert "(its recipe)" in str(result.exception)


def test_accuracy_is_a_matter_of_training(tmp_path, mocap_data):
    result = invoke("thesis15", "accuracy", "--data", mocap_data)
    assert isinstance(result.exception, MotiondeckError)
    assert "give the recipe" in str(result.exception)


def test_accuracy_ends_with_a_clip_that_is_as_near_in_fewer_bytes():
    motions = [MotionRecipe(name=name, file=name) for name in synthetic.LOOPS]
    recipe = LibraryRecipe(name="small", motions=motions, network=PhaseEchoStateRecipe())
    *networks, player, keyed = accuracy(Evaluation("small", recipe, None, synthetic.training_set()), range(1)).rows
    assert (networks[0]["network"], player["network"], keyed["network"]) == ("seed 0", "clip player", "clip of keys")
    assert player["free run mm"] == pytest.approx(0.0, abs=1e-3)
    assert keyed["free run mm"] <= networks[0]["free run mm"]
    assert keyed["kB"] < min(player["kB"], networks[0]["kB"])


def test_what_is_unknown_is_refused(tmp_path):
    result = invoke("thesis15", "beauty", "--data", tmp_path)
    assert str(result.exception) == (
        "unknown measure 'beauty'. There are: accuracy, robustness, stability, transitions."
    )


@pytest.mark.thorough
def test_a_library_that_was_learned_from_other_frames_says_so(mocap_data, tmp_path):
    library = shipped()
    recipe = library.info.recipe
    motions = [one | ({"frames": [150, 300]} if one["name"] == "walk" else {}) for one in recipe["motions"]]
    info = msgspec.structs.replace(library.info, recipe=recipe | {"motions": motions})
    save_library(replace(library, info=info), tmp_path / "other.safetensors")
    result = invoke(
        tmp_path / "other.safetensors", "stability", "--data", mocap_data, "--runs", 1, "--jobs", 1, "--json"
    )
    assert result.exception is None
    assert any("not right undisturbed either" in note for note in json.loads(result.stdout)["notes"])


@pytest.mark.thorough
def test_the_network_of_the_shipped_recipe_survives_noise(mocap_data):
    recipe = shipped_configs() / "libraries" / "thesis15.toml"
    result = invoke(recipe, "stability", "--data", mocap_data, "--seeds", 1, "--runs", 1, "--jobs", 1, "--json")
    assert result.exception is None
    report = json.loads(result.stdout)
    assert not any("not right" in note for note in report["notes"])
    rows = {row["motion"]: row for row in report["rows"]}
    assert len(rows) == 18
    assert rows["clip player"]["intrinsic %"] == 0.0
    assert rows["all loops"]["intrinsic %"] <= 10.0
    assert "guarded %" not in rows["everything"], "a guard broke runs of a phase-driven network that had not failed"
