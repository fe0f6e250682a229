"""`learn` finds out what a recipe would have to give, and names what it had to leave out."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest

from bodies import waving
from command_line import invoked
from controller.learning.fit import fit, fit_prepared
from controller.learning.learn import learn
from controller.learning.recipe import LibraryRecipe, MotionRecipe, read_recipe, recipe_text, typeable
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.training_set import prepare
from controller.library.motion_library import KIND, load_library, save_library
from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import FittedClip, recordings_in
from controller.motion.formats.writing import bvh_text
from controller.motion.rotations import multiply
from motiondeck_base.arrays_file import write_arrays
from motiondeck_base.errors import MotiondeckError
from sim.robots.verdict import RobotVerdict

QUICK = EchoStateRecipe(neurons=60, washout=60, drives=1)


@pytest.fixture
def folder(tmp_path):
    inside = tmp_path / "recordings"
    inside.mkdir()
    (inside / "swing.bvh").write_text(bvh_text(waving(30.0, 4.0, still=1.0)))
    (inside / "my bow (1).bvh").write_text(bvh_text(waving(240.0, 1.0, ends=True)))
    (inside / "stone.bvh").write_text(bvh_text(waving(60.0, 1.0, hertz=0.0)))
    (inside / "blink.bvh").write_text(bvh_text(waving(60.0, 0.2, hertz=5.0)))
    (inside / "broken.bvh").write_text("HIERARCHY\n")
    (inside / "closed.FBX").write_text("Kaydara FBX Binary")
    (inside / "notes.txt").write_text("no recording")
    return inside


def test_a_folder_of_any_rates_is_learned_and_every_recording_has_its_line(folder):
    learned = learn([folder], "mine", network=QUICK, seeds=[0])
    rows = {motion.name: motion for motion in learned.motions}
    assert list(learned.library.network.motions) == ["my-bow-1", "swing"]
    assert rows["swing"].plays == "loop"
    swing = rows["swing"].part
    assert swing.recorded == pytest.approx(6.0)
    assert 0.8 < swing.first < swing.end < 5.2  # without the still ends
    assert rows["swing"].seconds == pytest.approx(round(rows["swing"].seconds), abs=0.02)  # whole swings
    assert swing.seam_mm < 5.0
    assert rows["my-bow-1"].plays == "once"
    assert rows["my-bow-1"].part.seam_degrees > 10.0
    assert "nothing moves" in rows["stone"].remedy
    assert "too short" in rows["blink"].remedy
    assert "no MOTION section" in rows["broken"].remedy
    assert "Convert it with FBX2glTF" in rows["closed"].remedy
    assert learned.library.info.rate == 120.0


def test_the_recipe_trains_the_same_library_again(folder, tmp_path):
    learned = learn([folder / "swing.bvh"], "mine", network=QUICK, seeds=[0])
    (tmp_path / "mine.toml").write_text(recipe_text(learned.recipe))
    recipe = read_recipe(tmp_path / "mine.toml")
    assert recipe == learned.recipe
    again = fit(recipe, tmp_path)
    assert again.info == learned.library.info


def test_files_and_folders_are_searched_once_each(folder):
    files = recordings_in([folder, folder / "swing.bvh"], convertible=True)
    assert [file.name for file in files] == [
        "blink.bvh", "broken.bvh", "my bow (1).bvh", "stone.bvh", "swing.bvh", "closed.FBX",
    ]  # fmt: skip
    with pytest.raises(MotiondeckError, match="there is no such file or folder"):
        recordings_in([folder / "none.bvh"])
    with pytest.raises(MotiondeckError, match=r"empty: no recording found\. Recordings end in"):
        recordings_in([folder.parent / "empty"] if (folder.parent / "empty").mkdir() is None else [])


def test_where_nothing_can_be_learned_the_first_reason_is_given(folder):
    with pytest.raises(MotiondeckError, match=r"none of 2 recordings can be learned\. .*stone\.bvh: nothing moves"):
        learn([folder / "stone.bvh", folder / "blink.bvh"], "mine")
    swing = folder / "swing.bvh"
    swing.write_text(swing.read_text().replace("0.0", "0,0"))
    with pytest.raises(MotiondeckError, match=r"expected a number") as caught:
        learn([swing], "mine")
    assert str(caught.value).count("swing.bvh") == 1


def test_a_body_that_jumps_is_learned_up_to_the_jump_and_the_library_can_be_opened(folder, tmp_path):
    jumping = waving(60.0, 5.0)
    jumping.root_position[200:, 0] += 5.0
    pasted = folder / "pasted.bvh"
    pasted.write_text(bvh_text(jumping))
    learned = learn([pasted], "mine", network=QUICK, seeds=[0])
    (motion,) = learned.motions
    assert motion.part.end <= 200 / 60.0
    assert motion.doubts[0].startswith(
        "the body jumps by up to 5.0 m between two frames at 3.33 s: only 0.00 to 3.33 s"
    )
    save_library(learned.library, tmp_path / "mine.safetensors")
    assert load_library(tmp_path / "mine.safetensors").network.motions == ("pasted",)
    whole = msgspec.structs.replace(learned.recipe, motions=[MotionRecipe(name="pasted", file=str(pasted))])
    with pytest.raises(
        MotiondeckError, match=r"motion 'pasted': from frame 199 to 200 the body jumps 5\.0 m\. Give it"
    ):
        prepare(whole, tmp_path)


def test_a_body_that_jumps_all_the_time_is_left_out_with_that_reason(folder):
    """It was called too short, with the 0.05 s between two jumps."""
    shaken = waving(60.0, 2.0)
    shaken.root_position[::3, 0] += 1.0
    (folder / "shaken.bvh").write_text(bvh_text(shaken))
    with pytest.raises(
        MotiondeckError,
        match=r"the body jumps by up to 1\.0 m .*; the longest piece between, 0\.\d\d s are too short; 0\.4 s are",
    ):
        learn([folder / "shaken.bvh"], "mine")


@pytest.mark.parametrize("frames", [1, 4])
def test_a_limb_that_is_elsewhere_for_a_moment_is_learned_up_to_there(folder, frames):
    spiked = waving(60.0, 5.0)
    bone = 1 + spiked.skeleton.index("lelb")
    below = [bone] + [1 + b for b in range(len(spiked.skeleton)) if spiked.skeleton.parent[b] == bone - 1]
    flip = np.array([0.0, 1.0, 0.0, 0.0])  # half a turn about x
    spiked.rotation[200 : 200 + frames, below] = multiply(flip, spiked.rotation[200 : 200 + frames, below])
    file = folder / "spiked.bvh"
    file.write_text(bvh_text(spiked))
    learned = learn([file], "mine", network=QUICK, seeds=[0])
    (motion,) = learned.motions
    assert motion.part.end <= 200 / 60.0
    said = r"the end of bone 'l\w+' is elsewhere for a moment at 3\.3\d s( and 1 more time)?: only 0\.00 to 3"
    assert re.match(said, motion.doubts[0])
    whole = msgspec.structs.replace(learned.recipe, motions=[MotionRecipe(name="spiked", file=str(file))])
    with pytest.raises(
        MotiondeckError, match=r"motion 'spiked': in frame \d+ the end of bone 'l\w+' is elsewhere.*Give it"
    ):
        prepare(whole, folder)


@pytest.fixture
def long(tmp_path):
    """A recording of 13 s: the swing, a rest, a gesture, a rest, and the swing again."""
    rest, swing = waving(30.0, 1.5, hertz=0.0), waving(30.0, 4.0)
    takes = [swing, rest, waving(30.0, 2.0, hertz=0.25), rest, swing]
    rotation = np.concatenate([take.rotation for take in takes])
    file = tmp_path / "session.bvh"
    file.write_text(
        bvh_text(replace(swing, root_position=np.tile(swing.root_position[0], (len(rotation), 1)), rotation=rotation))
    )
    return file


def test_a_long_recording_is_learned_as_its_motions_and_its_recipe_learns_them_again(long, tmp_path):
    learned = learn([long], "mine", network=QUICK, seeds=[0])
    assert [motion.name for motion in learned.motions] == ["session-1", "session-2", "session-3"]
    assert [motion.plays for motion in learned.motions] == ["loop", "once", "loop"]
    first, second, third = ((motion.part.first, motion.part.end) for motion in learned.motions)
    assert 0.0 <= first[0] < first[1] < 4.3 < 5.2 < second[0] < second[1] < 7.8 < 8.7 < third[0]
    cuts = [[one.notable for one in motion.decisions if one.step == "cuts"] for motion in learned.motions]
    assert cuts == [[True], [False], [False]]  # said once
    (tmp_path / "mine.toml").write_text(recipe_text(learned.recipe))
    assert fit(read_recipe(tmp_path / "mine.toml"), tmp_path).info == learned.library.info


def test_a_recipe_reads_a_recording_once_for_all_of_its_motions(long, monkeypatch):
    read = []
    clip = waving(30.0, 9.0)
    monkeypatch.setattr("controller.learning.training_set.read_clip", lambda *given: read.append(given) or clip)
    motions = [MotionRecipe(name=f"part-{n}", file=str(long), frames=(90 * n, 90 * n + 90)) for n in range(3)]
    other = MotionRecipe(name="other", file=str(long), frames=(0, 90), rate=60.0)
    prepare(LibraryRecipe(name="parts", network=QUICK, motions=[*motions, other]), Path())
    assert len(read) == 2


def test_a_long_recording_can_be_kept_whole(long):
    (motion,) = learn([long], "mine", network=QUICK, seeds=[0], whole=True).recipe.motions
    assert (motion.name, motion.frames) == ("session", (0, 390))


@pytest.mark.thorough
def test_a_motion_never_takes_the_name_of_another_recording(long):
    other = long.with_name("session-2.bvh")
    other.write_text(bvh_text(waving(30.0, 3.0)))
    learned = learn([long, other], "mine", network=QUICK, seeds=[0])
    assert [motion.name for motion in learned.motions] == ["session-1", "session-2-2", "session-3", "session-2"]


def test_files_with_the_same_name_get_names_of_their_own(folder):
    other = folder / "again"
    other.mkdir()
    (other / "swing.bvh").write_text((folder / "swing.bvh").read_text())
    learned = learn([folder / "swing.bvh", other], "mine", network=QUICK, seeds=[0])
    assert list(learned.library.network.motions) == ["recordings-swing", "again-swing"]


@pytest.mark.thorough
def test_the_command_writes_library_and_recipe_and_prints_what_it_found(folder, tmp_path):
    out = tmp_path / "mine.safetensors"
    result = invoked("learn", str(folder), "--out", str(out), "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert {row["name"]: row["plays"] for row in told["motions"]} == {
        "swing": "loop", "my-bow-1": "once", "stone": None, "blink": None, "broken": None, "closed": None,
    }  # fmt: skip
    assert load_library(out).info.name == "mine"
    assert read_recipe(tmp_path / "mine.toml").name == "mine"


@pytest.mark.parametrize(("given", "taken"), [("person.npz", [None, "person.npz"]), ("p.asf", ["p.asf", None])])
def test_a_skeleton_that_is_given_is_for_recordings_of_its_kind(tmp_path, monkeypatch, given, taken):
    files = [tmp_path / "a.amc", tmp_path / "b.npz"]
    for file in files:
        file.touch()
    seen = []

    def reader(file, options):
        seen.append(options.skeleton)
        return FittedClip(replace(waving(60.0, 2.0), name=file.stem), None)

    monkeypatch.setattr("controller.learning.recording_analysis.read_fitted", reader)
    learn(files, "mine", options=ReadingOptions(Path(given)), network=QUICK, seeds=[0])
    assert seen == [name and Path(name) for name in taken]


@cache
def learned_at(rate):
    """What a library knows of the same two movements, recorded and learned at a rate."""
    clips = {"wave": waving(rate, 3.3), "bow": waving(rate, 1.5, ends=True)}
    motions = [MotionRecipe(name="wave", file=""), MotionRecipe(name="bow", file="", plays="once")]
    recipe = LibraryRecipe(name="two", rate=rate, network=PhaseRecipe(neurons=100, rank=20), motions=motions)
    return fit_prepared(recipe, prepare(recipe, Path(), read=lambda motion: clips[motion.name])).info.motions


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 240.0])
def test_a_library_at_another_rate_is_alike(rate):
    for other, usual in zip(learned_at(rate), learned_at(120.0), strict=True):
        assert other.passed
        assert usual.passed
        assert other.frames / rate == pytest.approx(usual.frames / 120.0, abs=0.1)
        assert other.error_mm < usual.error_mm + 1.5


def test_what_looks_wrong_about_a_body_is_told_and_can_be_overruled(tmp_path):
    small = tmp_path / "small.bvh"
    small.write_text(bvh_text(waving(60.0, 2.0)))
    learned = learn([small], "mine", options=ReadingOptions(unit=0.002), network=QUICK, seeds=[0])
    assert any("the unit may be wrong (--unit)" in doubt for doubt in learned.motions[0].doubts)
    assert learned.recipe.motions[0].unit == 0.002
    right = learn([small], "mine", network=QUICK, seeds=[0])
    assert not any("unit" in doubt for doubt in right.motions[0].doubts)
    again = prepare(read_recipe_text(recipe_text(learned.recipe), tmp_path), tmp_path)
    assert again.encoding.skeleton.leg_length == pytest.approx(0.2 * right.library.skeleton.leg_length, rel=1e-6)


def read_recipe_text(text, folder):
    (folder / "recipe.toml").write_text(text)
    return read_recipe(folder / "recipe.toml")


def test_a_recording_of_several_things_is_no_loop_of_one_of_them(tmp_path):
    """Legs swing for 4 s, then it bows: a loop of the swings alone would lose the bow."""
    swings, bow = waving(60.0, 4.0), waving(60.0, 1.5, ends=True)
    both = replace(
        swings,
        root_position=np.concatenate([swings.root_position, bow.root_position]),
        rotation=np.concatenate([swings.rotation, bow.rotation]),
    )
    (tmp_path / "both.bvh").write_text(bvh_text(both))
    (motion,) = learn([tmp_path / "both.bvh"], "mine", network=QUICK, seeds=[0]).motions
    assert motion.plays == "once"
    assert motion.seconds > 5.0


def test_the_table_tells_parts_seams_and_doubts(folder, tmp_path):
    out = tmp_path / "mine.safetensors"
    command = ["learn", str(folder / "swing.bvh"), "--out", str(out), "--unit", "0.002"]
    stopped = invoked(*command)
    assert "the left leg is 0.1" in str(stopped.exception)
    assert str(stopped.exception).endswith("--accept swing")
    assert not out.exists()
    result = invoked(*command, "--accept", "swing")
    assert result.exit_code == 0, result.output
    words = " ".join(result.stdout.split())
    assert re.search(r"swing loop 3\.00 \d\.\d\d to \d\.\d\d of 6\.00 s \d mm, \d°", words)
    assert "doubt: swing: the left leg is 0.1" in words
    assert "warning: no licence of the recordings is given" in words


def test_the_first_motion_is_played_on_the_robot_that_is_named(folder, tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr("os.execv", lambda program, command: started.append(command))
    verdict = RobotVerdict("swing", (), 1.0)  # judging takes long, and is tested beside the verdicts
    monkeypatch.setattr("motiondeck.run.verdicts._judge", lambda judged, name: [verdict])
    out = tmp_path / "mine.safetensors"
    command = ["learn", str(folder / "swing.bvh"), "--out", str(out), "--play", "--robot", "servo20"]
    assert invoked(*command).exit_code == 0
    assert started[0][-6:] == ["play", "swing", "--library", str(out), "--robot", "servo20"]


def test_a_recipe_that_may_have_been_edited_is_replaced_only_on_request(folder, tmp_path):
    out = tmp_path / "mine.safetensors"
    out.with_suffix(".toml").write_text("# edited by hand")
    command = ["learn", str(folder / "swing.bvh"), "--out", str(out)]
    refused = str(invoked(*command).exception)
    assert "mine.toml exists already; give another --out, or --force" in refused
    assert f"motiondeck learn {out.with_suffix('.toml')}" in refused
    assert out.with_suffix(".toml").read_text() == "# edited by hand"
    assert not out.exists()
    assert invoked(*command, "--force").exit_code == 0
    assert "swing" in out.with_suffix(".toml").read_text()


def test_any_file_is_added_to_what_was_learned(folder, tmp_path):
    out = tmp_path / "mine.safetensors"
    assert invoked("learn", str(folder / "swing.bvh"), "--out", str(out)).exit_code == 0
    bow = ["library", "add", str(out), str(folder / "my bow (1).bvh"), "--name", "bow", "--once"]
    added = json.loads(invoked(*bow, "--json").stdout)
    assert [motion["name"] for motion in added["motions"]] == ["swing", "bow"]
    assert added["learned_from"]["recorded_s"] == pytest.approx(1.0, abs=0.01)
    again = invoked(*bow[:-3], "--name", "loop", "--rename", "nobody=head")
    assert "nothing to rename is called 'nobody'" in str(again.exception)
    looped = invoked("library", "add", str(out), str(folder / "swing.bvh"), "--name", "loop")
    assert re.search(r"loop: \d\.\d\d to \d\.\d\d of 6\.00 s, seam \d mm", looped.stdout)


def test_a_recipe_reports_the_learned_parts(folder, tmp_path):
    out = tmp_path / "mine.safetensors"
    learned = learn([folder / "swing.bvh"], "mine", network=PhaseRecipe(neurons=100, rank=20), seeds=[0])
    (tmp_path / "mine.toml").write_text(recipe_text(learned.recipe))
    assert 'licence = "unknown"  #' in (tmp_path / "mine.toml").read_text()
    fitted = invoked("learn", str(tmp_path / "mine.toml"), "--data", "/", "--out", str(out))
    assert "warning" in fitted.stderr
    assert "set licence in the recipe" in fitted.stderr
    part = learned.motions[0].part
    assert f"{part.first:.2f} to {part.end:.2f} of 6.00 s" in fitted.stdout


@pytest.mark.parametrize(
    ("text", "name"), [("Grüße (2)", "Grusse-2"), ("fröhlich", "frohlich"), ("niño", "nino"), ("歩く", "motion")]
)
def test_a_name_keeps_its_letters_where_they_can_be_typed(text, name):
    assert typeable(text) == name


def test_a_folder_of_archives_says_that_they_are_packed(tmp_path):
    (tmp_path / "takes.zip").write_bytes(b"PK\x03\x04")
    with pytest.raises(MotiondeckError, match=r"takes\.zip: packed\. Unpack it"):
        learn([tmp_path], "takes")


def test_a_recipe_and_its_recordings_can_be_moved_together(tmp_path):
    here, there = tmp_path / "all" / "here", tmp_path / "moved" / "here"
    (here / "takes").mkdir(parents=True)
    aside = tmp_path / "all" / "aside.bvh"
    for file in (here / "takes" / "swing.bvh", aside):
        file.write_text(bvh_text(waving(60.0, 2.0)))
    motions = [MotionRecipe(name=file.stem, file=str(file)) for file in (here / "takes" / "swing.bvh", aside)]
    (here / "mine.toml").write_text(recipe_text(LibraryRecipe(motions=motions, body=str(aside)), here))
    (tmp_path / "all").rename(tmp_path / "moved")
    read = read_recipe(there / "mine.toml", there)
    assert [motion.file for motion in read.motions] == ["takes/swing.bvh", "../aside.bvh"]
    assert read.body == "../aside.bvh"


def test_a_library_holds_no_absolute_paths(tmp_path):
    (tmp_path / "mine" / "takes").mkdir(parents=True)
    files = [tmp_path / "mine" / "takes" / "swing.bvh", tmp_path / "elsewhere.bvh"]
    for file in files:
        file.write_text(bvh_text(waving(60.0, 2.0)))
    learned = learn(files, "mine", network=PhaseRecipe(neurons=50, rank=10), seeds=[0])
    out = tmp_path / "mine" / "mine.safetensors"
    save_library(learned.library, out)
    assert str(tmp_path).encode() not in out.read_bytes()
    header = load_library(out).info
    assert [motion.source for motion in header.motions] == ["takes/swing.bvh", "elsewhere.bvh"]
    assert [motion["file"] for motion in header.recipe["motions"]] == ["takes/swing.bvh", "elsewhere.bvh"]
    # An older library, which has absolute paths, is read, and has none when it is written again.
    write_arrays(out, KIND, learned.library.info, learned.library.network.arrays())
    assert str(tmp_path).encode() in out.read_bytes()
    save_library(load_library(out), out)
    assert str(tmp_path).encode() not in out.read_bytes()
