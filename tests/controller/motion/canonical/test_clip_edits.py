"""Resampling keeps a motion where it was, trimming keeps what moves, mirroring twice changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import waving
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import mirrored, moving_part, resampled
from controller.motion.clip import Clip
from controller.motion.formats.taught_clip import taught_clip
from motiondeck_base.errors import FileFormatError
from simulated_bodies import human


def swinging(rate, seconds=2.0):
    """A smooth motion known at any time: every bone swings about one axis."""
    body = human()
    t = np.arange(round(rate * seconds)) / rate
    angle = 0.6 * np.sin(2.0 * np.pi * t)[:, None] * np.linspace(0.2, 1.0, 1 + len(body))
    rotation = np.zeros((len(t), 1 + len(body), 4))
    rotation[..., 0], rotation[..., 2] = np.cos(angle / 2), np.sin(angle / 2)
    place = np.stack([t, 0.1 * np.sin(t), 0.9 + 0.0 * t], axis=1)
    return Clip("swing", body, rate, place, rotation)


@pytest.mark.parametrize("rate", [24.0, 29.97, 60.0, 120.0, 240.0])
def test_any_rate_gives_the_motion_at_120_hertz(rate):
    found = resampled(swinging(rate), 120.0)
    true = swinging(120.0)
    frames = min(len(found), len(true))
    assert frames > 0.95 * len(true)
    off = np.linalg.norm(found.joints()[:frames] - true.joints()[:frames], axis=-1)
    # A cubic follows 1 Hz well even from 24 frames; at the ends, where there are no neighbours, nearly as well.
    assert off[10:-10].max() < 2e-3
    assert off.max() < 6e-3


@given(st.floats(10.0, 300.0), st.integers(1, 40))
def test_a_resampled_clip_is_as_long_and_starts_and_ends_as_it_did(rate, frames):
    clip = swinging(60.0)
    clip = replace(clip, root_position=clip.root_position[:frames], rotation=clip.rotation[:frames])
    found = resampled(clip, rate)
    assert found.rate == rate
    assert np.allclose(found.joints()[0], clip.joints()[0])
    assert (len(clip) - 1) / 60.0 - 1.0 / rate <= (len(found) - 1) / rate <= (len(clip) - 1) / 60.0 + 1e-9


def test_still_ends_are_trimmed_and_a_body_that_never_moves_has_no_part():
    clip = swinging(60.0)
    pause = 90
    index = np.concatenate([np.zeros(pause, int), np.arange(len(clip)), np.full(pause, len(clip) - 1)])
    padded = replace(clip, root_position=clip.root_position[index], rotation=clip.rotation[index])
    first, end = moving_part(padded)
    assert pause - 12 <= first <= pause
    assert pause + len(clip) <= end <= pause + len(clip) + 12
    still = np.zeros(50, int)
    assert moving_part(replace(clip, root_position=clip.root_position[still], rotation=clip.rotation[still])) == (0, 0)


@pytest.mark.parametrize("rate", [24.0, 60.0, 240.0])
def test_a_pose_for_reference_before_the_motion_is_no_part_of_it(rate):
    clip = waving(rate, 2.0, ends=True)
    arms = [1 + clip.skeleton.index(bone) for bone in ("lelb", "lwri", "lhan")]
    posed = clip.rotation.copy()
    posed[0, arms] = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]
    assert moving_part(replace(clip, rotation=posed))[0] == 1
    assert moving_part(clip)[0] == 0


def test_mirrored_left_and_right_change_places():
    clip = to_canonical(swinging(30.0))
    other = mirrored(clip)
    flip = np.array([1.0, -1.0, 1.0])
    left, right = (1 + clip.skeleton.index(bone) for bone in ("lwri", "rwri"))
    assert np.allclose(other.joints()[:, left], clip.joints()[:, right] * flip)
    assert np.allclose(other.joints()[:, right], clip.joints()[:, left] * flip)
    assert np.allclose(mirrored(other).joints(), clip.joints())


def test_a_rig_has_no_sides():
    with pytest.raises(FileFormatError, match="no left and right"):
        mirrored(taught_clip("wave", ("pan",), 50.0, np.zeros((5, 1))))
