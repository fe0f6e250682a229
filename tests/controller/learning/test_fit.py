from pathlib import Path

import numpy as np
import pytest

from bodies import waving
from command_line import invoked
from controller.learning.fit import fit, steps
from controller.learning.recipe import read_recipe, warnings
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.training_set import prepare
from controller.library.motion_library import load_library, save_library
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import bvh_text
from motiondeck_base.errors import FileFormatError
from motiondeck_base.shipped import shipped_configs

pytestmark = pytest.mark.smoke

RECIPES = shipped_configs() / "libraries"

SMALL = """
name = "three"
body = "jaeger/nnRawWalk.mat"
licence = "for tests"
seeds = [0, 1, 2]
[network]
type = "conceptor"
neurons = 500
aperture = 50.0
[[motions]]
name = "walk"
file = "jaeger/nnRawWalk.mat"
[[motions]]
name = "waltz"
file = "jaeger/nnRawWaltz.mat"
frames = [0, 170]
[[motions]]
name = "standup"
file = "jaeger/nnRawStandup.mat"
plays = "once"
"""


def recipe_of(tmp_path, text):
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    return read_recipe(path)


def test_a_small_library_is_trained_from_recordings(tmp_path, mocap_data):
    recipe = recipe_of(tmp_path, SMALL)
    said = []
    library = fit(recipe, mocap_data, said.append)
    assert [motion.passed for motion in library.info.motions] == [True] * 3
    assert max(motion.error_mm for motion in library.info.motions) < 40.0
    assert len(said) >= steps(recipe)
    save_library(library, tmp_path / "three.safetensors")
    assert load_library(tmp_path / "three.safetensors").info == library.info


@pytest.mark.thorough
def test_a_phase_driven_library_needs_one_seed_and_is_exact(tmp_path, mocap_data):
    recipe = recipe_of(
        tmp_path, SMALL.replace('type = "conceptor"', 'type = "phase-conceptor"').replace("aperture", "#")
    )
    library = fit(recipe, mocap_data)
    assert library.info.seed == 0
    assert [motion.passed for motion in library.info.motions] == [True] * 3
    assert max(motion.error_mm for motion in library.info.motions) < 2.0
    save_library(library, tmp_path / "three.safetensors")
    assert load_library(tmp_path / "three.safetensors").info == library.info


def test_a_recipe_need_only_name_its_recordings(tmp_path):
    recipe = recipe_of(tmp_path, '[[motions]]\nfile = "my walks/old (1).bvh"\n')
    assert (recipe.name, recipe.motions[0].name) == ("recipe", "old-1")
    assert recipe.network == PhaseRecipe()


def test_two_recordings_of_one_name_need_names_of_their_own(tmp_path):
    with pytest.raises(FileFormatError, match="two motions are called 'walk'"):
        recipe_of(tmp_path, '[[motions]]\nfile = "a/walk.bvh"\n[[motions]]\nfile = "b/walk.bvh"\n')


def test_motions_are_carried_to_one_body(tmp_path, mocap_data):
    syllabus = prepare(recipe_of(tmp_path, SMALL), mocap_data)
    assert syllabus.rate == 120.0
    heights = {name: frames[:, 0].max() for name, frames in syllabus.frames.items()}
    assert abs(heights["walk"] - heights["waltz"]) < 0.12


@pytest.mark.parametrize(
    "name",
    ["thesis15", *(f"thesis15-{kind}" for kind in ("conceptor", "echo-state", "phase-echo-state", "phase-conceptor"))],
)
def test_shipped_recipes_are_good(name):
    recipe = read_recipe(RECIPES / f"{name}.toml")
    assert len(recipe.motions) == 15
    assert "NSF EIA-0196217" in recipe.acknowledgement


def test_the_shipped_library_is_small_sound_and_says_whom_to_thank():
    path = RECIPES / "thesis15.safetensors"
    library = load_library(path)
    channels = 4 * library.encoding.channels * sum(motion.frames for motion in library.info.motions)
    assert path.stat().st_size < channels
    assert max(motion.error_mm for motion in library.info.motions) < 2.0
    assert len(library.info.motions) == 15
    assert all(motion.passed for motion in library.info.motions)
    assert "mocap.cs.cmu.edu" in library.info.acknowledgement


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"nnRawWalk\.mat: there is no such file; --data"):
        fit(recipe_of(tmp_path, SMALL), tmp_path)


def test_frames_outside_a_recording_are_refused(tmp_path, mocap_data):
    with pytest.raises(FileFormatError, match="'waltz': frames 0 to 1700 are not in a clip of 900"):
        prepare(recipe_of(tmp_path, SMALL.replace("[0, 170]", "[0, 1700]")), mocap_data)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("neurons = 500", "neuron = 500", "unknown key 'neuron'.*'neurons'"),
        ("neurons = 500", "neurons = -5", "network.neurons is -5"),
        ("neurons = 500", "neurons = 500\nridge = nan", "network.ridge is nan"),
        ('name = "waltz"', 'name = "walk"', "two motions are called 'walk'"),
        ('plays = "once"', 'plays = "twice"', "twice"),
        ("seeds = [0, 1, 2]", "seeds = []", r"seeds is \[\]"),
        ("seeds = [0, 1, 2]", "seeds = [-1]", r"seeds is \[-1\]"),
        ('name = "waltz"', 'name = "a, b"', "'a, b' cannot be typed"),
        ("seeds = [0, 1, 2]", "loop_keeps = 2.0", "loop_keeps is 2.0"),
        ('type = "conceptor"', 'type = "perceptron"', "perceptron"),
        ("neurons = 500", "apertures = { wlak = 4.0 }", "network.apertures names 'wlak'"),
        ("neurons = 500", "apertures = { walk = -1.0 }", "the aperture of 'walk' is -1.0"),
        ("neurons = 500", 'form = "round"', "round"),
    ],
)
def test_a_bad_recipe_is_refused_in_one_line(tmp_path, old, new, says):
    with pytest.raises(FileFormatError, match=says) as caught:
        recipe_of(tmp_path, SMALL.replace(old, new))
    assert "\n" not in str(caught.value)


def test_a_recording_cut_to_almost_nothing_is_refused(tmp_path, mocap_data):
    with pytest.raises(FileFormatError, match="'waltz': 3 frames are too few"):
        prepare(recipe_of(tmp_path, SMALL.replace("[0, 170]", "[0, 3]")), mocap_data)


def test_all_recordings_that_cannot_be_used_are_named_at_once(tmp_path, mocap_data):
    text = SMALL.replace("[0, 170]", "[0, 1700]").replace("nnRawStandup", "nnRawNone")
    with pytest.raises(FileFormatError) as caught:
        prepare(recipe_of(tmp_path, text), mocap_data)
    waltz, standup = str(caught.value).split("\n")
    assert "'waltz': frames 0 to 1700" in waltz
    assert "nnRawNone.mat: there is no such file" in standup


def from_the_heading(clip, frame):
    """Joints of a clip seen from its root and its heading, m."""
    joints = clip.joints()[frame]
    left, right = (joints[1 + clip.skeleton.index(hip)] for hip in ("lhip", "rhip"))
    across = (left - right)[:2] / np.linalg.norm((left - right)[:2])
    axes = np.array([[across[1], -across[0], 0.0], [across[0], across[1], 0.0], [0.0, 0.0, 1.0]])
    return np.vstack([(joints[1:] - joints[0]) @ axes.T, [[0.0, 0.0, joints[0, 2]]]])


def test_a_training_set_says_which_part_of_each_recording_it_holds(tmp_path, mocap_data):
    recipe = recipe_of(tmp_path, SMALL.replace('name = "walk"', 'name = "walk"\nframes = [10, 310]'))
    known = prepare(recipe, mocap_data)
    walk, standup = known.parts["walk"], known.parts["standup"]
    clip = read_clip(mocap_data / "jaeger" / "nnRawWalk.mat")
    assert walk.recorded == pytest.approx(len(clip) / 120)
    assert 10 / 120 <= walk.first < walk.end <= 310 / 120
    assert walk.end - walk.first == pytest.approx(len(known.frames["walk"]) / 120)
    ends = [from_the_heading(clip, round(120 * moment)) for moment in (walk.first, walk.end)]
    apart = np.square(ends[1] - ends[0]).sum(1)
    assert walk.seam_mm is not None
    assert walk.seam_degrees is not None
    assert walk.seam_mm == pytest.approx(1e3 * np.sqrt(apart.sum() / (len(apart) - 2 / 3)), rel=1e-3)
    assert 1.0 < walk.seam_degrees < 45.0
    assert (standup.first, standup.end, standup.seam_mm) == (0.0, standup.recorded, None)


def test_a_recipe_without_a_licence_is_warned_about(tmp_path):
    assert warnings(recipe_of(tmp_path, SMALL)) == []
    (warning,) = warnings(recipe_of(tmp_path, SMALL.replace('licence = "for tests"', "")))
    assert "set licence in the recipe" in warning


def test_a_mirrored_copy_exchanges_left_and_right(tmp_path, mocap_data):
    copy = '[[motions]]\nname = "other"\nfile = "jaeger/nnRawStandup.mat"\nplays = "once"\nmirrored = true\n'
    known = prepare(recipe_of(tmp_path, SMALL + copy), mocap_data)
    one, other, bones = known.frames["standup"], known.frames["other"], known.encoding.skeleton.bones
    assert other[:, 0] == pytest.approx(one[:, 0], abs=0.02)  # left and right thighs differ by millimetres
    assert other[:, 1] == pytest.approx(-one[:, 1], abs=1e-6)
    for bone, partner in (("lkne", "rkne"), ("rwri", "lwri"), ("head", "head")):
        at, there = (4 + 3 * bones.index(name) for name in (bone, partner))
        assert other[:, at : at + 3] == pytest.approx(one[:, there : there + 3] * [1.0, -1.0, 1.0], abs=1e-6)


def test_what_is_wrong_with_motions_and_which_files_are_missing_is_said_at_once(tmp_path):
    (tmp_path / "here.bvh").touch()
    (tmp_path / "recipe.toml").write_text(
        "[[motions]]\nfile = 'gone.bvh'\nframes = [9, 3]\n"
        "[[motions]]\nfile = 'here.bvh'\nname = 'a b'\n"
        "[[motions]]\nfile = 'gone.amc'\nskeleton = 'gone.asf'\n"
    )
    with pytest.raises(FileFormatError) as caught:
        read_recipe(tmp_path / "recipe.toml", tmp_path)
    lines = str(caught.value).splitlines()
    for part in ("called 'gone'", "'a b' cannot be typed", "frames is [9, 3]", "gone.bvh: there is no such file"):
        assert sum(part in line for line in lines) == 1
    assert len(lines) == 6


def test_a_library_that_exists_is_only_replaced_on_request(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("wave.bvh").write_text(bvh_text(waving(60.0, 2.0)))
    Path("waves.toml").write_text(
        "[[motions]]\nfile = 'wave.bvh'\n[network]\ntype = 'phase-conceptor'\nneurons = 60\nrank = 20\n"
    )
    assert invoked("learn", "waves.toml").exit_code == 0
    assert Path("waves.safetensors").exists()
    again = invoked("learn", "waves.toml")
    assert "waves.safetensors exists already; give another --out, or --force" in str(again.exception)
