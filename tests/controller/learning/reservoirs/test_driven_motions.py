"""Motions with an input besides the phase: one motion over speed, learned from recordings that differ in it."""

import msgspec
import numpy as np
import pytest

import synthetic
from controller.deck.deck import ACROSS_SECONDS, Deck
from controller.deck.motion_generator import MotionGenerator
from controller.learning.preparation.cycles import ground_speed, one_cycle, phase_lag, stretched
from controller.learning.preparation.training_motion import TrainingMotion, Variant
from controller.learning.recipe import LibraryRecipe, MotionRecipe, check_recipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.encodings.normalisation import Normalisation
from controller.networks.storage import DrivingInput
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError

ENCODING = synthetic.small_encoding()
FRAMES = 120  # as in the slower recording
SPEEDS = {0.8: 120, 2.0: 72}  # m/s, and frames of a stride


def stride(speed, frames=FRAMES):
    """A stride whose limbs reach as far as its speed asks for, with its share of the height."""
    t = 2 * np.pi * np.arange(frames) / frames
    reach = 0.35 * speed
    legs = synthetic.swing(reach * np.sin(t), 0), synthetic.swing(-reach * np.sin(t), 0)
    return synthetic.frames_of(0.8 + 0.03 * np.cos(2 * t), speed + 0 * t, 0 * t, legs, legs[::-1])


RECIPES = {
    "phase-conceptor": PhaseRecipe(neurons=300, rank=60),
    "phase-echo-state": PhaseEchoStateRecipe(neurons=150),
}


@pytest.fixture(scope="module", params=RECIPES)
def library(request):
    variants = [Variant(speed, frames / synthetic.RATE, stride(speed)) for speed, frames in SPEEDS.items()]
    wave = synthetic.wave()
    normalisation = Normalisation.fit([*(one.frames for one in variants), wave])
    driving = DrivingInput("speed", tuple(SPEEDS), tuple(one.seconds for one in variants), 0.8)
    normalised = tuple(Variant(one.value, one.seconds, normalisation.apply(one.frames)) for one in variants)
    taught = [
        TrainingMotion("gait", normalised[0].frames, True, None, driving, normalised),
        TrainingMotion("wave", normalisation.apply(wave), True),
    ]
    network = synthetic.trained(RECIPES[request.param], taught, normalisation)
    plain = synthetic.small_library()
    gait, wave_info = (
        msgspec.structs.replace(one, name=name) for one, name in zip(plain.info.motions, ("gait", "wave"), strict=False)
    )
    info = msgspec.structs.replace(
        plain.info,
        network=request.param,
        scales=network.scales,
        motions=[msgspec.structs.replace(gait, frames=FRAMES, input=driving), wave_info],
    )
    return MotionLibrary(info, network, plain.encoding)


def off(played, speed):
    """The mean distance of joints from the nearest place in a stride at a speed, mm."""
    there = joint_features(ENCODING, stride(speed, 240))
    return float(np.abs(joint_features(ENCODING, played)[:, None] - there).mean(-1).min(1).mean())


def ahead(channels):
    """How far ahead the right leg points at most."""
    return float(channels[:, 7].max())


@pytest.mark.parametrize("speed", SPEEDS)
def test_each_learned_value_is_played_as_recorded(library, speed):
    played = MotionGenerator(library, "gait", inputs={"speed": speed}).frames(3.0, synthetic.RATE)[120:]
    assert off(played, speed) < 1.0
    assert ahead(played) == pytest.approx(ahead(stride(speed)), rel=0.05)
    assert ground_speed(played) == pytest.approx(speed, abs=0.02)


def test_between_two_values_the_motion_lies_between_them(library):
    middle = np.sqrt(0.8 * 2.0)
    played = MotionGenerator(library, "gait", inputs={"speed": middle}).frames(3.0, synthetic.RATE)[120:]
    assert ground_speed(played) == pytest.approx(middle, rel=0.1)
    assert ahead(played) == pytest.approx(ahead(stride(middle)), rel=0.15)


def test_the_pace_follows_the_input(library):
    generator = MotionGenerator(library, "gait")
    slow = [generator.phase for _ in range(60) if generator.step(1.0 / 120.0) is not None]
    generator.set_input("speed", 2.0)
    fast = [generator.phase for _ in range(30) if generator.step(1.0 / 120.0) is not None]
    assert slow[-1] - slow[0] == pytest.approx(59 / 120, abs=0.02)
    turned = (fast[-1] - fast[0]) % 1.0
    assert turned == pytest.approx(29 / 72, abs=0.02)


def test_a_motion_without_an_input_does_not_notice_it(library):
    plain = MotionGenerator(library, "wave").frames(1.0, synthetic.RATE)
    assert np.array_equal(MotionGenerator(library, "wave", inputs={"speed": 2.0}).frames(1.0, synthetic.RATE), plain)


def test_a_library_keeps_its_inputs(library, tmp_path):
    save_library(library, tmp_path / "gait.safetensors")
    back = load_library(tmp_path / "gait.safetensors")
    assert back.info == library.info
    given = {"speed": 1.3}
    assert np.array_equal(
        MotionGenerator(back, "gait", inputs=given).frames(1.0, 120.0),
        MotionGenerator(library, "gait", inputs=given).frames(1.0, 120.0),
    )
    bad = msgspec.structs.replace(library.info.motions[0], input=DrivingInput("speed", (2.0, 1.0), (1.0, 1.0), 1.0))
    spoilt = msgspec.structs.replace(library.info, motions=[bad, library.info.motions[1]])
    save_library(MotionLibrary(spoilt, library.network, library.encoding), tmp_path / "bad.safetensors")
    with pytest.raises(FileFormatError, match="'gait' cannot have the input"):
        load_library(tmp_path / "bad.safetensors")


def test_what_a_motion_computes_before_it_plays_is_computed_before_the_first_tick(library):
    """Its states at each value of its input took a tick many times its time, at the first switch to it."""
    library.network.rest()
    fresh = MotionLibrary(library.info, library.network.only(("wave", "gait")), library.encoding)
    deck = Deck(fresh, lambda pose: pose.rotation.ravel(), "wave")
    before = {name: set(vars(fresh.network[name])) for name in fresh.network.motions}
    deck.set_input("speed", 2.0)
    deck.switch("gait")
    for _ in range(300):
        deck.update(0.01)
    assert deck.playing == "gait"
    assert {name: set(vars(fresh.network[name])) for name in fresh.network.motions} == before


def test_the_deck_leads_an_input_smoothly_to_its_value(library):
    def joints(pose):
        return library.skeleton.joints(np.zeros(3), pose.rotation).ravel()

    deck = Deck(library, joints, "gait")
    assert deck.inputs == {"speed": 0.8}
    deck.set_input("speed", 2.0)
    before = deck.update(0.01)[0].copy()
    steps = []
    for _ in range(round(1.5 * ACROSS_SECONDS / 0.01)):
        now = deck.update(0.01)[0].copy()
        steps.append(float(np.abs(now - before).max()))
        before = now
    assert deck.inputs["speed"] == pytest.approx(2.0)
    assert max(steps) < 0.1
    with pytest.raises(MotiondeckError, match=r"speed was learned from 0\.8 to 2"):
        deck.set_input("speed", 9.0)
    with pytest.raises(UnknownNameError, match=r"unknown input 'sped'\. Did you mean speed"):
        deck.set_input("sped", 1.0)
    with pytest.raises(UnknownNameError, match="no motion of this library was learned with one"):
        Deck(synthetic.small_phase_library(), lambda pose: pose.rotation.ravel(), "march").set_input("speed", 1.0)


def test_one_stride_of_several_is_cut_out_and_brought_into_step():
    frames = np.tile(stride(1.0, 80), (3, 1))[:230]
    cut = one_cycle(joint_features(ENCODING, frames), synthetic.RATE, "walk")
    assert cut.end - cut.start == 80
    behind = np.roll(stride(1.0), -17, axis=0)
    assert phase_lag(behind, stride(1.0)) == 17
    assert np.allclose(stretched(stride(1.0, 48), 96), stride(1.0, 96), atol=1e-3)
    with pytest.raises(FileFormatError, match=r"walk: 0\.33 s are too short"):
        one_cycle(np.zeros((40, 3)), 120.0, "walk")


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"plays": "once"}, "has to be a loop with takes"),
        ({"takes": ()}, "has to be a loop with takes"),
        ({"input": "mood"}, "give the values of 'mood' in the 2 recordings"),
        ({"values": (1.0, 1.0)}, "need as many values, 2 of them different"),
        ({"values": (1.0, 1.0), "people": ("a", "b")}, "2 of them different"),
        ({"input": "", "values": (1.0, 2.0)}, "has values, but no input"),
        ({"input": "", "people": ("a", "b")}, "has people, but no input"),
        ({"people": ("a",)}, "give as many people"),
    ],
)
def test_a_recipe_names_what_is_wrong_with_an_input(tmp_path, changed, problem):
    motion = msgspec.structs.replace(
        MotionRecipe(name="gait", file="a.bvh", takes=("b.bvh",), input="speed"), **changed
    )
    with pytest.raises(FileFormatError, match=problem):
        check_recipe(LibraryRecipe(name="x", network=PhaseRecipe(), motions=[motion]), tmp_path)
