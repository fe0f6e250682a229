"""Held frames are taken out, single ones bridged, and missing ones filled in; a good recording stays as it is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.clip import Clip
from controller.motion.rotations import from_rotation_vector
from controller.motion.take.timing import timed, timing_of
from simulated_bodies import human


def dance(count=120, rate=30.0):
    """Joints that turn to and fro, each at its own pace, while the body goes ahead."""
    body, time = human(), np.arange(count) / rate
    random = np.random.default_rng(3)
    axis, pace = random.normal(0.0, 0.5, (20, 3)), random.uniform(1.0, 2.5, (20, 1))
    rotation = from_rotation_vector(axis * np.sin(pace * time[:, None, None] + axis))
    position = np.stack([0.5 * time, 0.1 * np.sin(3.0 * time), np.full(count, 0.9)], axis=1)
    return Clip("dance", body, rate, position, rotation, "dance.bvh")


def picked(clip, frames, rate=None):
    rate = clip.rate if rate is None else rate
    return replace(clip, rate=rate, root_position=clip.root_position[frames], rotation=clip.rotation[frames])


def held(clip, rate):
    """The clip in a file of a higher rate, whose frames are the last recorded ones."""
    count = int(len(clip) * rate / clip.rate)
    return picked(clip, (np.arange(count) * clip.rate / rate + 1e-9).astype(int), rate)


@given(pair=st.sampled_from([(30.0, 60.0), (30.0, 120.0), (24.0, 60.0), (25.0, 30.0), (50.0, 60.0), (29.97, 59.94)]))
def test_a_pattern_of_held_frames_is_left_out(pair):
    clip = dance(rate=pair[0])
    found, decision = timed(held(clip, pair[1]), "auto")
    assert found.rate == pytest.approx(pair[0], rel=1e-6)
    assert abs(len(found) - len(clip)) <= 1
    count = min(len(found), len(clip))
    np.testing.assert_array_equal(found.rotation[:count], clip.rotation[:count])
    assert decision.notable
    assert "repeat the one before" in decision.evidence


def test_single_held_frames_are_bridged_at_the_rate_of_the_file():
    clip = dance()
    frames = np.arange(len(clip))
    frames[[20, 50, 81]] -= 1
    found, decision = timed(picked(clip, frames), "auto")
    assert (found.rate, len(found)) == (clip.rate, len(clip))
    assert (
        np.abs(found.joints() - clip.joints()).max() < 0.3 * np.abs(picked(clip, frames).joints() - clip.joints()).max()
    )
    assert decision.decided == "3 held frames bridged"


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_missing_frames_are_filled_in(missing):
    clip = dance()
    found, decision = timed(picked(clip, np.delete(np.arange(len(clip)), np.arange(60, 60 + missing))), "auto")
    assert len(found) == len(clip)
    assert np.abs(found.joints() - clip.joints()).max() < 0.01
    assert decision.decided.startswith(f"{missing} missing frame")


def test_missing_frames_of_a_kick_are_found_where_the_foot_is_fastest():
    """Over four frames a foot goes farther than the steps beside it say, and the body no farther."""
    frame = np.arange(60)
    foot = np.cumsum(2.0 * np.exp(-(((frame - 30) / 4.0) ** 2))) / 60.0
    body = frame / 60.0
    points = np.stack([np.stack([one, 0.0 * one, 0.0 * one], axis=1) for one in (foot, body)], axis=1)
    found = timing_of(np.delete(points, [29, 30, 31], axis=0), 60.0)
    assert found.decided == "4 missing frames filled in"  # of 3: the foot is faster there
    assert not timing_of(points, 60.0).decided


def test_a_body_that_stands_still_to_the_last_digit_is_no_held_frame():
    clip = dance()
    paused = picked(clip, np.concatenate([np.arange(60), np.full(45, 59), np.arange(60, 120)]))
    found, _ = timed(paused, "auto")
    assert len(found) == len(paused)
    assert found.rate == 30.0


@given(seed=st.integers(0, 30))
def test_noise_is_no_gap(seed):
    points = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.01, (100, 20, 3)), axis=0)
    assert timing_of(points, 60.0).decided == ""


def test_a_given_rate_takes_as_many_frames():
    clip = held(dance(), 60.0)
    found, decision = timed(clip, 30.0)
    assert (found.rate, len(found)) == (30.0, 120)
    assert decision.evidence == "as given"
    assert timed(clip, "none")[0] is clip


def test_a_body_that_was_lost_for_a_while_is_not_bridged():
    clip = dance(rate=60.0)
    place = clip.root_position.copy()
    place[60:66] = [40.0, 0.0, 0.0]
    rotation = clip.rotation.copy()
    rotation[60:66] = [1.0, 0.0, 0.0, 0.0]
    lost = replace(clip, root_position=place, rotation=rotation)
    assert timed(lost, "auto")[0] is lost
