import json
import tracemalloc

import msgspec
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

import synthetic
from controller.learning.recipe import read_recipe
from controller.learning.trainers.random_feature import RandomFeatureRecipe, conception_weights
from controller.library.motion_library import MotionLibrary, load_library, save_library
from motiondeck_base.errors import FileFormatError, MotiondeckError
from synthetic import run

RECIPE = RandomFeatureRecipe(
    neurons=300,
    features=400,
    features_each=150,
    spectral_radius=1.4,
    input_scale=0.5,
    ridge=0.01,
    washout=60,
    state_noise=0.01,
    teacher_noise=0.01,
    drives=2,
)


@pytest.fixture(scope="module")
def network():
    return synthetic.trained(RECIPE)


@pytest.fixture(scope="module")
def library(network):
    small = synthetic.small_library()
    return MotionLibrary(msgspec.structs.replace(small.info, network="random-feature"), network, small.encoding)


@pytest.mark.parametrize("name", ["march", "wave"])
def test_a_loop_runs_free_and_stays_on_its_motion(network, name):
    taught = synthetic.MOTIONS[name]()
    network.cue(name, 0)
    played = run(network, len(taught) * 4)[-len(taught) :]
    assert min(np.abs(np.roll(taught, shift, axis=0) - played).mean() for shift in range(len(taught))) < 0.03


def test_a_motion_that_happens_once_ends_and_holds(network):
    network.cue("bow", 0)
    assert np.abs(run(network, 900)[-1] - synthetic.bow()[-1]).max() < 0.05


def test_a_step_is_the_equation(network):
    network.cue("wave", 3)
    shared, part = network.reservoir, network["wave"]
    conception, offset = np.zeros((2, len(shared.features)))
    conception[part.uses], offset[part.uses] = part.conception, part.offset
    z = np.zeros(len(shared.features))
    z[part.uses] = part.states[3]
    z = conception * (shared.features @ np.tanh(z @ shared.feedback + shared.bias)) + offset
    assert np.allclose(run(network, 1)[0], z @ shared.readout + shared.rest, atol=1e-4)


def test_conception_weights_come_to_rest_where_the_rule_stands_still():
    rng = np.random.default_rng(0)
    features = rng.standard_normal((40, 60)).astype(np.float32)
    features /= np.linalg.norm(features, axis=1)[:, None]
    signal = np.sin(2 * np.pi * (np.arange(50)[:, None] / 50 + rng.random(60))).astype(np.float32)
    recipe = RandomFeatureRecipe(aperture=2.0, learning_rate=0.01, adapt_frames=3000)
    conception, mean = conception_weights(signal, features, np.zeros_like(features), recipe)
    seen = np.tanh(signal) @ features.T
    energy = seen.var(0)
    assert np.allclose(mean, seen.mean(0), atol=0.03)
    assert np.allclose(conception, energy / (energy + 0.25), atol=0.05)


def test_a_motion_of_its_own_is_told_by_few_numbers(network):
    part = network["march"]
    assert len(part.uses) == len(part.conception) == len(part.offset) == RECIPE.features_each
    assert len(set(part.uses.tolist())) == RECIPE.features_each
    assert ((part.conception >= 0.0) & (part.conception < 1.0)).all()


def test_the_same_seed_gives_the_same_bytes():
    lessons = synthetic.lessons()
    quick = msgspec.structs.replace(RECIPE, neurons=50, features=60, features_each=30, adapt_frames=50)
    first, second, other = (synthetic.trained(quick, *lessons, seed=seed) for seed in (4, 4, 5))
    assert first.reservoir.feedback.tobytes() == second.reservoir.feedback.tobytes()
    assert first["bow"].states.tobytes() == second["bow"].states.tobytes()
    assert first["bow"].states.tobytes() != other["bow"].states.tobytes()


def test_an_impossible_state_is_known(network):
    network.cue("march", 0)
    assert not network.astray()
    part, bound, z = network.snapshot()
    network.restore((part, bound, 10.0 * z + 10.0))
    assert network.astray()


def test_several_runs_play_what_one_plays(network):
    network.cue("march", 0)
    several, frames = network.twin(3), np.empty((3, network.channels))
    several.cue("march", 0)
    played = run(network, 60)
    for _ in range(60):
        several.advance(frames)
    assert np.allclose(frames, played[-1], atol=2e-3)
    several.displace(np.full((3, network.neurons), 50.0, dtype=np.float32))
    assert several.astray().all()
    several.cue("march", np.zeros(3, dtype=np.int64), np.arange(3))
    several.advance(frames)
    assert np.allclose(frames, played[0], atol=1e-4)


def test_a_morph_begins_as_the_source_and_ends_as_the_target(network):
    network.cue("march", 5)
    alone = run(network, 3)
    network.cue("march", 5)
    going = network.morph("march", "wave")
    frame = np.empty(network.channels)
    for step in range(3):
        going.advance(0.0, frame)
        assert np.allclose(frame, alone[step], atol=1e-4)
    for mu in np.linspace(0.0, 1.0, 60):
        going.advance(mu, frame)
    for _ in range(300):
        going.advance(1.0, frame)
    going.settle()
    assert network.snapshot()[0] is network["wave"]
    assert np.abs(synthetic.wave() - run(network, 1)[0]).mean(1).min() < 0.05


def test_a_morph_in_a_tick_asks_for_no_memory_worth_mentioning(network):
    network.cue("march", 5)
    tracemalloc.start()
    try:
        going = network.morph("march", "wave")
        going.advance(1.0, np.empty(network.channels))
        going.settle()
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    gathered = RECIPE.features_each * network.neurons * 4
    assert most < gathered / 2


def test_a_library_keeps_it(library, tmp_path):
    save_library(library, tmp_path / "small.safetensors")
    loaded = load_library(tmp_path / "small.safetensors").network
    library.network.cue("bow", 2)
    loaded.cue("bow", 2)
    assert np.array_equal(run(loaded, 40), run(library.network, 40))


def test_a_library_that_names_features_which_are_not_there_is_refused(library, tmp_path):
    path = tmp_path / "small.safetensors"
    save_library(library, path)
    with safe_open(path, framework="numpy") as file:
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        header = json.loads(file.metadata()["motiondeck"])
    arrays["motion/wave/uses"] = arrays["motion/wave/uses"] + 400
    save_file(arrays, path, metadata={"motiondeck": json.dumps(header)})
    with pytest.raises(FileFormatError, match=r"'motion/wave/uses' names a feature that is not among the 400"):
        load_library(path)


def test_a_recipe_that_wants_more_features_than_there_are_is_refused(tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text(
        'name = "x"\nbody = "b.bvh"\nlicence = ""\n[network]\ntype = "random-feature"\nfeatures = 100\n'
        'features_each = 200\n[[motions]]\nname = "walk"\nfile = "b.bvh"\n'
    )
    with pytest.raises(FileFormatError, match=r"features_each is 200, but network\.features is 100"):
        read_recipe(path)


def test_a_recipe_whose_learning_would_not_come_to_rest_is_refused(tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text(
        'name = "x"\nbody = "b.bvh"\nlicence = ""\n[network]\ntype = "random-feature"\naperture = 0.1\n'
        '[[motions]]\nname = "walk"\nfile = "b.bvh"\n'
    )
    with pytest.raises(
        FileFormatError, match=r"network\.learning_rate = 0\.02 is too large for network\.aperture = 0\.1"
    ):
        read_recipe(path)


def test_conception_weights_that_diverge_are_refused():
    lessons = synthetic.lessons()
    quick = msgspec.structs.replace(RECIPE, neurons=50, features=60, features_each=30, learning_rate=10.0)
    with pytest.raises(MotiondeckError, match=r"learning_rate = 10\.0 and network\.aperture = 10\.0"):
        synthetic.trained(quick, *lessons)
