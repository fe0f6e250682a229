"""A phase-driven echo-state network that is stored by keys: as near as asked for, as small as the clip, and no clip."""

import msgspec
import numpy as np
import pytest

import synthetic
from controller.learning.fit import fit_prepared
from controller.learning.measures.self_test import Judge, run_free, self_test
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers import clip
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.trainer import NewMotion, trainer_of
from controller.learning.training_set import TrainingSet
from controller.library.motion_library import load_library, save_library
from motiondeck_base.errors import FileFormatError

LOOPS = {"march": True, "bow": False}
RECIPE = PhaseEchoStateRecipe(neurons=100, piece_seconds=0.5, tolerance_mm=1.0)


def known():
    """One loop and one one-shot."""
    frames = {name: synthetic.MOTIONS[name]() for name in LOOPS}
    return TrainingSet(synthetic.small_encoding(), synthetic.RATE, frames, LOOPS, least_range=1.0)


def learned():
    motions = [MotionRecipe(name=name, file=name, plays="loop" if loop else "once") for name, loop in LOOPS.items()]
    recipe = LibraryRecipe(name="small", motions=motions, network=RECIPE, seeds=[1])
    return fit_prepared(recipe, known())


@pytest.fixture(scope="module")
def library():
    return learned()


def test_it_keeps_to_its_tolerance_and_passes_disturbed(library):
    assert all(motion.passed and motion.error_mm <= 1.0 for motion in library.info.motions)


def test_it_is_about_as_small_as_the_clip_and_far_smaller_than_its_readouts(library):
    rival = clip.TRAINER.settle(clip.ClipRecipe(tolerance_mm=1.0), known().lessons(), 0, known().judge).network
    assert library.network.stored_bytes <= 1.1 * rival.stored_bytes
    plain = synthetic.trained(msgspec.structs.replace(RECIPE, neurons=library.info.scales.neurons))
    assert library.network.stored_bytes < 0.05 * plain.stored_bytes


def test_a_loaded_one_plays_bit_by_bit_the_same(library, tmp_path):
    save_library(library, tmp_path / "small.safetensors")
    loaded = load_library(tmp_path / "small.safetensors")
    for name in library.network.motions:
        assert np.array_equal(run_free(loaded.network, name, 200), run_free(library.network, name, 200))


def test_it_has_neurons_that_a_push_reaches_and_that_forget_it(library):
    network = library.network.twin()
    network.cue("march", 0)
    network.displace(np.random.default_rng(1).uniform(-5, 5, network.neurons).astype(np.float32))
    pushed, alone = synthetic.run(network, 300), run_free(library.network, "march", 300)
    assert np.abs(pushed[0] - alone[0]).max() > 0.01
    assert np.abs(pushed[-1] - alone[-1]).max() < 1e-3


def test_a_motion_that_is_added_is_stored_by_keys_too(library, tmp_path):
    frames = synthetic.wave(90)
    network = library.network
    lengths = {motion.name: motion.frames for motion in library.info.motions}
    new = NewMotion("small", library.encoding, synthetic.RATE, 1, lengths, "more", frames, loop=True)
    grown = trainer_of(RECIPE).add(msgspec.structs.replace(RECIPE, neurons=network.neurons), network, new)
    assert "motion/more/packed" in grown.arrays()
    verdict = self_test(grown, Judge(library.encoding, {"more": frames}, {"more": True}, synthetic.RATE))["more"]
    assert verdict.passed
    assert verdict.error_mm <= 1.0


def test_readouts_without_their_normalisation_are_refused(tmp_path):
    plain = synthetic.small_phase_echo_state_library()
    arrays = plain.network.arrays
    plain.network.arrays = lambda: {name: array for name, array in arrays().items() if name != "shift"}
    save_library(plain, tmp_path / "plain.safetensors")
    with pytest.raises(FileFormatError, match="shift"):
        load_library(tmp_path / "plain.safetensors")
