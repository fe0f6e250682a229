"""Centralized networks in library files: they come back as they were, or are refused, and the deck plays them."""

import msgspec
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

import synthetic
from controller.deck.deck import Deck
from controller.learning.measures.self_test import Judge, self_test
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.motion.encodings.motion_matching import joint_features
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.network import CentralizedNetwork
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library

RECIPE = CentralizedRecipe(satellites=16, iterations=10)


@pytest.fixture(scope="module")
def library():
    taught, normalisation = synthetic.lessons()
    network = synthetic.trained(RECIPE, taught, normalisation)
    plain = synthetic.small_library()
    return MotionLibrary(msgspec.structs.replace(plain.info, network="centralized"), network, plain.encoding)


def played(network, motion, frames=200):
    network.cue(motion, 3)
    return synthetic.run(network, frames)


def test_every_motion_passes_the_self_test(library):
    frames = synthetic.references()
    judge = Judge(library.encoding, frames, {name: name != "bow" for name in frames}, library.info.rate)
    for name, verdict in self_test(library.network, judge).items():
        assert verdict.passed, f"{name}: {verdict.reason}"
        assert verdict.error_mm < 20.0


def test_a_library_comes_back_as_it_was(library, tmp_path):
    save_library(library, tmp_path / "small.safetensors")
    loaded = load_library(tmp_path / "small.safetensors")
    assert isinstance(loaded.network, CentralizedNetwork)
    for motion in library.network.motions:
        assert np.array_equal(played(loaded.network, motion), played(library.network, motion))
        assert np.array_equal(loaded.network.anchors(motion), library.network.anchors(motion))


@pytest.fixture(scope="module")
def small_library(library):
    """The same motions, with weights of low rank."""
    taught, normalisation = synthetic.lessons()
    recipe = msgspec.structs.replace(RECIPE, rank="auto")
    network = synthetic.trained(recipe, taught, normalisation)
    return MotionLibrary(library.info, network, library.encoding)


@pytest.mark.thorough
def test_weights_of_low_rank_come_back_bit_by_bit_from_a_smaller_file(library, small_library, tmp_path):
    save_library(small_library, tmp_path / "small.safetensors")
    save_library(library, tmp_path / "full.safetensors")
    loaded = load_library(tmp_path / "small.safetensors").network
    assert isinstance(loaded, CentralizedNetwork)
    for motion in loaded.motions:
        assert isinstance(loaded[motion].weights, LowRankWeights)
        assert np.array_equal(played(loaded, motion), played(small_library.network, motion))
    assert (tmp_path / "small.safetensors").stat().st_size < (tmp_path / "full.safetensors").stat().st_size


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("spoilt", "change", "says"),
    [
        (
            "shares",
            lambda a: a[:-1],
            r"motion/march/.*shares and \d+ weights of curves, where flags and counts ask for",
        ),
        ("used", lambda a: a + 100, "curves of .* satellites, of which there are"),
        ("nonzero", lambda a: a[:-1], r"\d+ bytes of flags for \d+ channels"),
        ("curves", lambda a: np.full_like(a, np.nan), "curves' holds a number that is not finite"),
    ],
)
def test_damaged_weights_of_low_rank_are_refused(small_library, tmp_path, spoilt, change, says):
    path = tmp_path / "small.safetensors"
    save_library(small_library, path)
    with safe_open(path, framework="numpy") as file:
        arrays, metadata = {name: file.get_tensor(name) for name in file.keys()}, file.metadata()  # noqa: SIM118
    name = f"motion/march/{spoilt}"
    arrays[name] = np.ascontiguousarray(change(arrays[name]))
    save_file(arrays, path, metadata=metadata)
    with pytest.raises(FileFormatError, match=says):
        load_library(path)


def test_anchors_are_the_frames_that_are_played_from_them(library):
    network = library.network.twin()
    for motion in network.motions:
        anchors = network.anchors(motion)
        for anchor in (0, 7, len(anchors) - 2):
            network.cue(motion, anchor)
            out = np.empty(network.channels)
            network.advance(out)
            network.advance(out)
            assert np.allclose(out, anchors[anchor + 1], atol=1e-9)


def test_a_switch_in_the_middle_of_a_switch_does_not_jump(library):
    deck = Deck(library, lambda pose: pose.rotation, "march", direct=True)
    rotations = []

    def run(ticks):
        for _ in range(ticks):
            deck.update(0.005)
            rotations.append(deck.posture.rotation)

    run(100)
    own = np.abs(np.diff(np.array(rotations), axis=0)).max()
    deck.switch("wave")
    run(40)
    assert not deck.settled
    deck.switch("march")
    run(400)
    assert deck.settled
    assert deck.playing == "march"
    assert np.abs(np.diff(np.array(rotations), axis=0)).max() < 3.0 * own


def test_the_deck_plays_and_switches_it(library):
    deck = Deck(library, lambda pose: pose.rotation.ravel().copy(), "march")
    for to in ("wave", "bow", "march"):
        deck.switch(to)
        for _ in range(500):
            deck.update(0.005)
        assert deck.settled
        assert deck.motion == to
    assert deck.pose.root_position[0] > 0.5


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("motion/wave/weights", lambda a: a[:, :3], "shape"),
        ("motion/wave/frequency", lambda a: a * np.nan, "not finite"),
        ("motion/wave/frequency", lambda a: a * 1.01, "'wave'.*does not close"),
        ("motion/wave/frequency", lambda a: -a, "'wave'.*center 0"),
        ("motion/wave/sharpness", lambda a: -a, "'wave'.*satellite 0"),
        ("motion/wave/places", None, "'motion/wave/places' is missing"),
        ("motion/wave/phase", lambda a: a.astype(np.float32), "expected float64"),
    ],
)
def test_a_damaged_library_is_refused_by_its_place(library, tmp_path, name, change, words):
    arrays = {at: np.ascontiguousarray(array) for at, array in library.network.arrays().items()}
    if change is None:
        del arrays[name]
    else:
        arrays[name] = np.ascontiguousarray(change(arrays[name]))
    header = {"motiondeck": msgspec.json.encode(library.info).decode()}
    save_file(arrays, tmp_path / "damaged.safetensors", metadata=header)
    with pytest.raises(FileFormatError, match=words):
        load_library(tmp_path / "damaged.safetensors")


def test_unknown_and_missing_motions_are_refused(library):
    assert library.network.as_autonomous is None
    assert synthetic.small_library().network.as_autonomous is not None
    with pytest.raises(UnknownNameError, match="wave"):
        library.network.cue("wafe", 0)
    with pytest.raises(MotiondeckError, match="needs motions"):
        CentralizedNetwork({}, 120.0)


def test_the_shipped_library_is_small_sound_and_never_leaves_its_range():
    path = find_library("cmu86")
    assert path.stat().st_size < 2e6
    library = load_library(path)
    assert all(motion.passed for motion in library.info.motions)
    for motion in library.network.motions:
        known = joint_features(library.encoding, library.network.anchors(motion))
        run = joint_features(library.encoding, played(library.network.twin(), motion, 5000))
        room = 0.1 * np.ptp(known, axis=0) + 1.0
        assert (run <= known.max(0) + room).all()
        assert (run >= known.min(0) - room).all()
