import pytest

from controller.library.motion_library import load_library, save_library
from controller.training.fit import fit, steps
from controller.training.recipe import read_recipe
from controller.training.training_set import prepare
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
aperture = 50.0   # with less it takes a short cut in the waltz
[[motions]]
name = "walk"
file = "jaeger/nnRawWalk.mat"
[[motions]]
name = "waltz"
file = "jaeger/nnRawWaltz.mat"
frames = [0, 450]
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


def test_motions_are_carried_to_one_body(tmp_path, mocap_data):
    syllabus = prepare(recipe_of(tmp_path, SMALL), mocap_data)
    assert syllabus.rate == 120.0
    heights = {name: frames[:, 0].max() for name, frames in syllabus.frames.items()}
    assert abs(heights["walk"] - heights["waltz"]) < 0.12


@pytest.mark.parametrize("name", ["thesis15", "thesis15-conceptor", "thesis15-echo-state"])
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
    with pytest.raises(FileFormatError, match="'waltz': frames 0 to 4500 are not in a clip of 900"):
        prepare(recipe_of(tmp_path, SMALL.replace("[0, 450]", "[0, 4500]")), mocap_data)


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
        prepare(recipe_of(tmp_path, SMALL.replace("[0, 450]", "[0, 3]")), mocap_data)
