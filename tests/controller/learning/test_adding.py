"""One motion more: what was stored stays as it is, and the new one plays."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

import synthetic
from bodies import waving
from controller.learning.adding import add_motion
from controller.learning.fit import fit_prepared
from controller.learning.measures.self_test import run_free
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.learning.training_set import prepare
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.motion.canonical.clip_edits import mirrored
from controller.motion.clip import Clip
from controller.motion.rotations import multiply
from motiondeck_base.errors import MotiondeckError

FILE = Path("small.safetensors")
LENGTHS = {name: len(frames) for name, frames in synthetic.references().items()}


def skip(period=108):
    """A third loop: one leg leads, the arms swing up together."""
    t = 2 * np.pi * np.arange(period) / period
    legs = synthetic.swing(0.5 * np.sin(t), 0), synthetic.swing(0.3 * np.cos(t), 0)
    arms = synthetic.swing(0.8 * np.sin(t), 0), synthetic.swing(0.8 * np.sin(t) - 0.2, 0)
    return synthetic.frames_of(0.78 + 0.04 * np.cos(t), 0.9 + 0.1 * np.cos(t), 0.1 * np.sin(t), legs, arms)


def clip_of(channels, rate=synthetic.RATE):
    """A recording of channels (T, C) that begins at the origin."""
    encoding = synthetic.small_encoding()
    heading, at = 0.0, np.zeros(2)
    positions, rotations = [], []
    for frame in channels:
        posture = encoding.decode(frame)
        heading += float(posture.turn_rate) / rate
        cos, sin = np.cos(heading), np.sin(heading)
        forward, left = posture.velocity / rate
        at = at + np.array([cos * forward - sin * left, sin * forward + cos * left])
        positions.append((*at, float(posture.height)))
        turn = np.array([np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)])
        rotations.append(multiply(turn, posture.rotation))
    return Clip("skip", encoding.skeleton, rate, np.array(positions), np.array(rotations))


def described(network_recipe, network):
    """A library of the synthetic motions with the recipe that it came from."""
    library = synthetic.small_library()
    kind = {
        "ConceptorRecipe": "conceptor",
        "EchoStateRecipe": "echo-state",
        "CentralizedRecipe": "centralized",
        "PhaseRecipe": "phase-conceptor",
        "PhaseEchoStateRecipe": "phase-echo-state",
        "SharedConceptorRecipe": "shared-conceptor",
    }
    motions = [
        MotionRecipe(name=name, file=f"{name}.bvh", plays="once" if name == "bow" else "loop") for name in LENGTHS
    ]
    recipe = LibraryRecipe(
        name="small", network=network_recipe, motions=motions, body="march.bvh", licence="none needed"
    )
    info = msgspec.structs.replace(
        library.info,
        network=kind[type(network_recipe).__name__],
        recipe=msgspec.json.decode(msgspec.json.encode(recipe)),
        leak=getattr(network_recipe, "leak", 1.0),
    )
    return MotionLibrary(info, network, library.encoding)


def conceptor_library(**changes):
    plan = msgspec.structs.replace(synthetic.SMALL_RECIPE, **changes)
    return described(plan, synthetic.small_network(recipe=plan))


def echo_state_library():
    plan = EchoStateRecipe(neurons=300, drives=2, washout=60, wrong_starts=2)
    return described(plan, synthetic.trained(plan))


def centralized_library():
    plan = CentralizedRecipe(satellites=30, iterations=10)
    return described(plan, synthetic.trained(plan))


def phase_library():
    plan = PhaseRecipe(**synthetic.SMALL_PHASE)
    network = synthetic.small_phase_network()
    library = described(plan, network)
    return replace(library, info=msgspec.structs.replace(library.info, scales=network.scales))


def phase_echo_state_library():
    network = synthetic.small_phase_echo_state()
    library = described(PhaseEchoStateRecipe(), network)
    return replace(library, info=msgspec.structs.replace(library.info, scales=network.scales))


def shared_library(**recipe):
    network = synthetic.small_shared_conceptor(**recipe)
    library = described(SharedConceptorRecipe(**synthetic.SMALL_SHARED, **recipe), network)
    return replace(library, info=msgspec.structs.replace(library.info, scales=network.scales))


@pytest.fixture(scope="module")
def library():
    return phase_library()


NEW = MotionRecipe(name="skip", file="skip.bvh")


def library_of_waving(network):
    """A library of one motion in which trunk, head and left arm stand still, but for rounding."""
    clip = waving(60.0, 3.0)
    recipe = LibraryRecipe(name="wave", network=network, motions=[MotionRecipe(name="wave", file="")], seeds=[0])
    return fit_prepared(recipe, prepare(recipe, Path(), read=lambda _: clip))


def waving_left():
    """The same with the other arm."""
    return replace(mirrored(waving(60.0, 3.0)), name="left")


@pytest.mark.parametrize("network", [PhaseRecipe(neurons=100, rank=20), PhaseEchoStateRecipe()])
def test_a_motion_may_move_what_stands_still_in_all_others(network):
    library = library_of_waving(network)
    added = add_motion(library, FILE, waving_left(), MotionRecipe(name="left", file=""))
    assert added.motion.passed


def test_a_network_without_a_scale_for_it_refuses_the_motion():
    library = library_of_waving(EchoStateRecipe(neurons=60, washout=60, drives=1))
    with pytest.raises(MotiondeckError, match="moves parts that stand still in all motions of the library 'wave'"):
        add_motion(library, FILE, waving_left(), MotionRecipe(name="left", file=""))


@pytest.mark.thorough
@pytest.mark.parametrize(
    "make",
    [
        shared_library,
        lambda: shared_library(readout="shared"),
        phase_library,
        phase_echo_state_library,
        echo_state_library,
        centralized_library,
    ],
)
def test_a_motion_is_added_and_nothing_else_changes(make, tmp_path):
    save_library(make(), tmp_path / "small.safetensors")
    before = load_library(tmp_path / "small.safetensors")
    added = add_motion(before, FILE, clip_of(np.tile(skip(), (2, 1))), NEW)
    assert added.motion.passed, added.motion.reason
    save_library(added.library, tmp_path / "longer.safetensors")
    after = load_library(tmp_path / "longer.safetensors")
    assert after.network.motions == (*before.network.motions, "skip")
    assert after.info.motions[:3] == before.info.motions
    stored = after.network.arrays()
    for name, array in before.network.arrays().items():
        assert np.array_equal(array, stored[name]) or not name.startswith("motion/"), name
    for name in before.network.motions:
        first, second = (run_free(library.network.twin(), name, 300) for library in (before, after))
        assert np.array_equal(first, second)
    assert "'skip' was added from skip.bvh" in after.info.acknowledgement


def test_a_second_addition_builds_on_the_first(library):
    once = add_motion(library, FILE, clip_of(np.tile(skip(), (2, 1))), NEW).library
    twice = add_motion(once, FILE, clip_of(np.tile(skip(90), (2, 1))), msgspec.structs.replace(NEW, name="quick-skip"))
    assert twice.library.network.motions[-2:] == ("skip", "quick-skip")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "march"}, "there is a motion 'march' in it already"),
        ({"name": "a b"}, "cannot be typed"),
        ({"frames": (0, 30)}, "too few"),
    ],
)
def test_what_cannot_be_added_is_refused(library, change, said):
    with pytest.raises(MotiondeckError, match=said):
        add_motion(library, FILE, clip_of(skip()), msgspec.structs.replace(NEW, **change))


def test_another_rate_is_resampled(library):
    every_other = skip()[::2]
    found = add_motion(library, FILE, replace(clip_of(every_other), rate=60.0), NEW)
    at_once = add_motion(library, FILE, clip_of(skip()), NEW)
    assert found.motion.passed
    assert found.library.info.motions[-1].frames == pytest.approx(at_once.library.info.motions[-1].frames, abs=2)


def test_a_network_that_cannot_be_added_to_says_so():
    with pytest.raises(MotiondeckError, match="learns all motions at once; name the clip in its recipe"):
        add_motion(conceptor_library(), FILE, clip_of(skip()), NEW)
