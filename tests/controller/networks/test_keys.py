"""Keys of a motion: drawn again within half a step, packed, and refused where they cannot be drawn."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

import synthetic
from controller.learning.measures.self_test import self_test
from controller.learning.trainers.clip import TRAINER, ClipRecipe, error_mm, fitted_keys, held_frames, keys_within
from controller.learning.trainers.trainer import NewMotion
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.networks.keys import STEPS_PER_BIT, Keys
from motiondeck_base.errors import FileFormatError


def library(network):
    small = synthetic.small_library()
    return MotionLibrary(msgspec.structs.replace(small.info, network="clip"), network, small.encoding)


@given(st.integers(4, 20), st.integers(1, 5), st.integers(0, 100), st.integers(0, 2**32 - 1))
def test_keys_are_kept_to_half_a_step(count, channels, fineness, seed):
    keys = np.random.default_rng(seed).uniform(-1.5, 1.5, (count, channels))
    exact = drawn_by_scipy(keys, 3 * count)
    drawn = Keys.of(keys, 0, fineness).drawn(3 * count, loop=False)
    assert np.abs(drawn - exact).max() <= 0.5 * 2.0 ** (-fineness / STEPS_PER_BIT) + 1e-9


def drawn_by_scipy(keys, frames):
    return BSpline(np.arange(-3.0, len(keys) + 1), keys, 3)(np.linspace(0, len(keys) - 3, frames))


def test_a_packed_key_takes_the_bits_of_its_channels_range():
    keys = Keys.of(np.array([[0.0, 5.0], [1.0, 5.0], [2.0, 5.0], [9.0, 5.0]]), 0, 0)
    assert keys.bits.tolist() == [4, 0]
    assert keys.packed.nbytes == 2


def test_keys_too_large_for_their_step_take_a_coarser_one():
    keys = np.array([[-90.0], [0.0], [1.0], [90.0]])
    drawn = Keys.of(keys, 0, 15 * STEPS_PER_BIT).drawn(12, loop=False)
    assert np.abs(drawn - drawn_by_scipy(keys, 12)).max() < 0.005


def test_a_loop_is_drawn_without_a_seam():
    frames = synthetic.march()
    drawn = Keys.of(fitted_keys(frames, 8, loop=True), 0, 12 * STEPS_PER_BIT).drawn(len(frames), loop=True)
    turned = np.roll(frames, 48, axis=0)
    again = Keys.of(fitted_keys(turned, 8, loop=True), 0, 12 * STEPS_PER_BIT).drawn(len(frames), loop=True)
    assert np.abs(drawn - frames).max() < 1e-3
    assert np.abs(again - np.roll(drawn, 48, axis=0)).max() < 1e-3


def test_the_pose_that_a_one_shot_holds_takes_no_keys():
    frames = synthetic.references()["bow"]
    held = held_frames(frames, loop=False)
    assert held > 50
    keys = Keys.of(fitted_keys(frames, 5, loop=False), held, 80)
    drawn = keys.drawn(len(frames), loop=False)
    assert len(drawn) == len(frames)
    assert (drawn[-held:] == drawn[-held - 1]).all()


def test_a_smaller_error_takes_more_bytes_and_is_kept():
    known = synthetic.training_set()
    sizes = []
    for tolerance in (0.2, 2.0):
        player = TRAINER.settle(ClipRecipe(tolerance_mm=tolerance), known.lessons(), 0, synthetic.judge()).network
        verdicts = self_test(player, synthetic.judge())
        assert all(one.passed and one.error_mm <= tolerance for one in verdicts.values())
        sizes.append(player.stored_bytes)
    assert sizes[0] > 1.2 * sizes[1]


@pytest.mark.parametrize("name", ["wave", "bow"])
def test_with_a_key_a_frame_noise_is_kept(name):
    frames, loop = synthetic.references()[name], synthetic.LOOPS[name]
    moving = len(frames) - held_frames(frames, loop=loop)
    frames[:moving] += np.random.default_rng(1).normal(scale=0.01, size=(moving, frames.shape[1]))
    frames[moving:] = frames[moving - 1]
    drawn = Keys.of(fitted_keys(frames, 1, loop=loop), len(frames) - moving, 100).drawn(len(frames), loop=loop)
    assert np.abs(drawn - frames).max() < 0.003


def test_where_no_keys_are_near_enough_the_most_are_taken():
    keys = keys_within(0.0, synthetic.march(), synthetic.judge(), "march", loop=True)
    assert keys.course[0] == 96


@pytest.mark.parametrize(("recipe", "most"), [(ClipRecipe(keys_every=8), 1.5), (ClipRecipe(tolerance_mm=0.3), 0.3)])
def test_a_motion_that_is_added_has_the_keys_of_the_recipe(recipe, most):
    player, frames = synthetic.trained(recipe), synthetic.wave(90)
    lengths = {name: len(part) for name, part in synthetic.references().items()}
    new = NewMotion("small", synthetic.small_encoding(), synthetic.RATE, 1, lengths, "more", frames, loop=True)
    grown = TRAINER.add(recipe, player, new)
    assert set(grown.motions) == {*player.motions, "more"}
    assert 0.0 < error_mm(new.judge, "more", grown.anchors("more")) <= most


def test_a_clip_is_stored_and_plays_bit_by_bit_the_same(tmp_path):
    player: Any = synthetic.trained(ClipRecipe())
    save_library(library(player), tmp_path / "clip.safetensors")
    loaded = load_library(tmp_path / "clip.safetensors").network
    for motion in player.motions:
        assert np.array_equal(loaded.anchors(motion), player.anchors(motion))


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"course": [3, 0, 80, 1]}, "3 keys"),
        ({"course": [24, 200, 80, 1]}, "200 frames held"),
        ({"course": [24, 0, 80, 0]}, "0 pieces"),
        ({"course": [24, 0, 999, 1]}, "2\\^-124"),
        ({"bits": 17}, "17 bits"),
        ({"packed": 1}, "packed"),
    ],
)
def test_keys_that_cannot_be_drawn_are_refused(tmp_path, change, names):
    player: Any = synthetic.trained(ClipRecipe())
    keys = player.keys["march"]
    for field, value in change.items():
        old = getattr(keys, field)
        new = (
            np.array(value, dtype=old.dtype)
            if isinstance(value, list)
            else np.full_like(old[:1] if field == "packed" else old, value)
        )
        player.keys["march"] = replace(keys, **{field: new})
    save_library(library(player), tmp_path / "clip.safetensors")
    with pytest.raises(FileFormatError, match=names):
        load_library(tmp_path / "clip.safetensors")
