"""What a rig was taught by hand, learned: it plays for ever in joint angles and switches like any other motion."""

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.evaluation.transitions import all_crossings
from controller.library.motion_library import load_library, save_library
from controller.mocap.canonical.canonical_body import carried
from controller.mocap.encodings.joint_angles import (
    JointRetargeter,
    angles_of,
    read_taught_clip,
    save_taught_clip,
    taught_clip,
)
from controller.training.fit import fit
from controller.training.recipe import gesture_recipe
from controller.training.training_set import TrainingSet
from motiondeck_base.errors import FileFormatError, MotiondeckError

JOINTS = ("pan", "tilt")
RATE = 100.0


def teach(path, hz, phase, joints=JOINTS):
    t = np.arange(500) / RATE
    rng = np.random.default_rng(1)
    angles = np.stack([0.7 * np.sin(2 * np.pi * hz * t + phase), 0.3 * np.cos(2 * np.pi * hz * t)], axis=1)
    save_taught_clip(taught_clip(path.stem, joints, RATE, angles + 0.001 * rng.standard_normal(angles.shape)), path)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("taught")
    clips = [folder / "wave.clip", folder / "nod.clip"]
    teach(clips[0], 0.7, 0.0)
    teach(clips[1], 0.45, 1.5)
    fitted = fit(gesture_recipe("gestures", clips), folder)
    save_library(fitted, folder / "gestures.safetensors")
    return load_library(folder / "gestures.safetensors")


def test_every_motion_passes_its_self_test_and_survives_the_file(library):
    assert library.info.encoding == library.encoding.name == "joint angles"
    assert [motion.name for motion in library.info.motions if motion.passed] == ["wave", "nod"]
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


def test_its_transitions_are_not_judged_as_a_body_s_would_be(library):
    nothing = TrainingSet(library.encoding, RATE, {}, {}, {})
    with pytest.raises(MotiondeckError, match="'gestures' holds the joint angles of a rig"):
        all_crossings(library, nothing)


def test_clips_whose_names_cannot_be_typed_are_refused(tmp_path):
    for name in ("my wave.clip", "wave.clip"):
        teach(tmp_path / name, 0.5, 0.0)
    with pytest.raises(FileFormatError, match="cannot be typed"):
        gesture_recipe("gestures", [tmp_path / "my wave.clip"])
    with pytest.raises(FileFormatError, match="two motions"):
        gesture_recipe("gestures", [tmp_path / "wave.clip", tmp_path / "wave.clip"])
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
