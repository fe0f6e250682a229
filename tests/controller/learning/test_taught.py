"""What a rig was taught by hand, learned: it plays for ever in joint angles and switches like any other motion."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.learning.evaluation.transitions import all_crossings
from controller.learning.fit import fit
from controller.learning.preparation.takes import by_motion, is_periodic, join_takes, read_takes
from controller.learning.recipe import gesture_recipe
from controller.learning.training_set import TrainingSet, prepare
from controller.library.motion_library import load_library, save_library
from controller.motion.canonical.canonical_body import carried
from controller.motion.encodings.joint_angles import JointRetargeter, angles_of
from controller.motion.formats.taught_clip import read_taught_clip, save_taught_clip, taught_clip
from motiondeck_base.errors import FileFormatError, MotiondeckError

pytestmark = pytest.mark.thorough

JOINTS = ("pan", "tilt")
RATE = 100.0


def teach(path, hz, phase, joints=JOINTS):
    t = np.arange(500) / RATE
    rng = np.random.default_rng(1)
    angles = np.stack([0.7 * np.sin(2 * np.pi * hz * t + phase), 0.3 * np.cos(2 * np.pi * hz * t)], axis=1)
    save_taught_clip(taught_clip(path.stem, joints, RATE, angles + 0.001 * rng.standard_normal(angles.shape)), path)


def reach(path, seconds, seed):
    """A motion that ends elsewhere than it began, at a pace of its own."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, round(seconds * RATE))
    s = s + 0.06 * rng.normal() * np.sin(np.pi * s)
    angles = np.stack([0.8 * s**2 * (3 - 2 * s), 0.3 * np.sin(np.pi * s) ** 2], axis=1)
    drift = 0.04 * rng.normal(size=2) * np.sin(np.pi * s[:, None]) ** 2
    save_taught_clip(taught_clip(path.stem, JOINTS, RATE, angles + drift), path, "once")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("taught")
    clips = [folder / "wave.clip", folder / "nod.clip"]
    teach(clips[0], 0.7, 0.0)
    teach(clips[1], 0.45, 1.5)
    for number, name in enumerate(("reach.clip", "reach.2.clip", "reach.3.clip")):
        clips.append(folder / name)
        reach(clips[-1], 1.6 + 0.2 * number, number)
    fitted = fit(gesture_recipe("gestures", clips), folder)
    save_library(fitted, folder / "gestures.safetensors")
    return load_library(folder / "gestures.safetensors")


def test_every_motion_passes_its_self_test_and_survives_the_file(library):
    assert library.info.encoding == library.encoding.name == "joint angles"
    assert [motion.name for motion in library.info.motions if motion.passed] == ["wave", "nod", "reach"]
    assert [motion.plays for motion in library.info.motions] == ["loop", "loop", "once"]
    assert library.skeleton.bones == JOINTS


def test_it_plays_for_ever_and_switches_without_a_jump(library):
    deck = Deck(library, JointRetargeter(library.skeleton, JOINTS, np.zeros(2)), "wave")
    played = []
    for tick in range(6000):
        if tick == 3000:
            deck.switch("nod")
        played.append(deck.update(1.0 / RATE)[0].copy())
    played = np.array(played)
    assert np.abs(np.diff(played, axis=0)).max() * RATE < 8.0  # rad/s; the wave itself has 3.1
    tail = played[-1000:, 0]
    assert 0.6 < tail.max() < 0.8
    crossings = np.count_nonzero(np.diff(np.signbit(tail)))
    assert crossings == pytest.approx(2 * 0.45 * 10.0, abs=1)
    assert deck.settled


def test_what_happened_once_is_played_once_and_held(library):
    deck = Deck(library, JointRetargeter(library.skeleton, JOINTS, np.zeros(2)), "wave")
    deck.switch("reach")
    played = np.array([deck.update(1.0 / RATE)[0].copy() for _ in range(800)])
    assert played[-1] == pytest.approx([0.8, 0.0], abs=0.06)
    assert np.ptp(played[-200:], axis=0).max() < 0.01


def wave(seconds, period, phase, seed):
    """A wave of a hand that is never twice the same."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    turned = 2 * np.pi * (t + 0.06 * np.sin(2 * np.pi * t / seconds + rng.normal())) / period + phase
    slip = 0.05 * rng.normal(size=2) * np.sin(np.pi * t[:, None] / seconds + rng.normal())
    return np.stack([0.5 * np.sin(turned), 0.3 * np.cos(turned) + 0.1 * np.sin(2 * turned)], axis=1) + slip


def shape_error(loop):
    """How far a loop leaves the curve that the hand had in mind, rad on average."""
    turned = np.linspace(0.0, 2 * np.pi, 720)
    curve = np.stack([0.5 * np.sin(turned), 0.3 * np.cos(turned) + 0.1 * np.sin(2 * turned)], axis=1)
    return np.mean([np.linalg.norm(curve - place, axis=1).min() for place in loop])


def test_takes_of_a_loop_are_nearer_to_what_was_meant_than_each_alone():
    joined, alone = [], []
    for seed in (200, 210, 220):
        hands = [(6, 1.5, 0.0), (5, 1.7, 1.0), (8, 1.4, 2.0), (7, 1.6, 4.0)]
        takes = [wave(*hand, seed + number) for number, hand in enumerate(hands)]
        motion = join_takes(takes, list("abcd"), RATE, loop=True)
        assert all(is_periodic(take, RATE, at_least=0.5) for take in takes)
        joined.append(shape_error(motion.channels))
        alone += [shape_error(take) for take in takes]
    assert np.mean(joined) < 0.75 * np.mean(alone)


def test_takes_of_a_motion_that_happens_once_keep_its_ends(tmp_path):
    files = [tmp_path / name for name in ("reach.clip", "reach.2.clip", "reach.10.clip")]
    for number, file in enumerate(files):
        reach(file, 1.5 + 0.3 * number, number)
    assert by_motion([files[2], files[0], files[1]]) == [files]
    clip = read_takes(files)
    angles = angles_of(clip.rotation[:, 1:])
    assert clip.plays == "once"
    assert len(clip) == 180  # the pace of the middle one
    assert angles[-1] == pytest.approx([0.8, 0.0], abs=0.05)
    assert not is_periodic(angles, RATE, at_least=0.5)


def test_a_take_of_another_motion_is_refused_by_its_name(tmp_path):
    with pytest.raises(FileFormatError, match=r"b is not the motion of c: they differ by [1-9]\d* % more than"):
        join_takes(
            [wave(6, 1.5, 0.0, 0), wave(6, 1.5, 0.0, 1)[:, ::-1], wave(6, 1.5, 0.0, 2)], list("abc"), RATE, loop=True
        )
    reach(tmp_path / "reach.clip", 2.0, 0)
    teach(tmp_path / "reach.2.clip", 0.5, 0.0)
    with pytest.raises(FileFormatError, match=r"reach\.2\.clip is not a take of .*reach\.clip"):
        read_takes([tmp_path / "reach.clip", tmp_path / "reach.2.clip"])


def test_all_of_a_loop_is_learned_where_the_recipe_keeps_all(tmp_path):
    teach(tmp_path / "wave.clip", 0.7, 0.0)  # 3.5 turns in 5 s: it comes back best after three of them
    recipe = gesture_recipe("gestures", [tmp_path / "wave.clip"])
    whole = msgspec.structs.replace(recipe, loop_keeps=1.0)
    frames = [len(prepare(one, Path()).frames["wave"]) for one in (recipe, whole)]
    assert frames[0] == pytest.approx(3 / 0.7 * RATE, abs=3)
    assert frames[1] == 499


def test_its_transitions_are_not_judged_as_a_body_s_would_be(library):
    nothing = TrainingSet(library.encoding, RATE, {}, {}, {})
    with pytest.raises(MotiondeckError, match="'gestures' holds the joint angles of a rig"):
        all_crossings(library, nothing)


def test_clips_whose_names_cannot_be_typed_are_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    for name in ("my wave.clip", "wave.clip", "elsewhere/wave.clip"):
        teach(tmp_path / name, 0.5, 0.0)
    with pytest.raises(FileFormatError, match="cannot be typed"):
        gesture_recipe("gestures", [tmp_path / "my wave.clip"])
    with pytest.raises(FileFormatError, match="two motions"):
        gesture_recipe("gestures", [tmp_path / "wave.clip", tmp_path / "elsewhere" / "wave.clip"])
    with pytest.raises(FileFormatError, match="no such file"):
        gesture_recipe("gestures", [tmp_path / "none.clip"])


def test_clips_of_different_joints_are_refused_by_their_names(tmp_path):
    clips = [tmp_path / "wave.clip", tmp_path / "nod.clip"]
    teach(clips[0], 0.5, 0.0)
    teach(clips[1], 0.5, 0.0, ("grip", "tilt"))
    with pytest.raises(FileFormatError, match=r"nod\.clip: beside .*wave\.clip it lacks pan and has also grip;"):
        gesture_recipe("gestures", clips)


def test_joints_in_another_order_are_put_in_order(tmp_path):
    clips = [tmp_path / "wave.clip", tmp_path / "nod.clip"]
    teach(clips[0], 0.5, 0.0)
    teach(clips[1], 0.5, 0.0, ("tilt", "pan"))
    assert len(gesture_recipe("gestures", clips).motions) == 2
    one, other = (read_taught_clip(path) for path in clips)
    ordered = carried(other, one.skeleton)
    assert ordered.skeleton.bones == JOINTS
    assert np.allclose(angles_of(ordered.rotation[:, 1:]), angles_of(other.rotation[:, 1:])[:, ::-1])
