"""Feet that stand stay where they are when a loop is closed; all else is as it was closed."""

import numpy as np
import pytest

from controller.learning.preparation.loops import Seam, close_loop, pinned
from controller.motion.clip import Clip, walked_clip
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.rotations import between, continuous
from controller.motion.skeleton import thesis_skeleton

RATE = 120.0
LENGTHS = [0.1, 0.4, 0.4, 0.15, 0.1, 0.4, 0.4, 0.15, 0.2, 0.25, 0.2, 0.15, 0.3, 0.25, 0.1, 0.15, 0.3, 0.25, 0.1]
BODY = thesis_skeleton(np.array(LENGTHS), "someone")
BEHIND = 0.08  # m: the root from the line between the hips, and not in its middle
HIPS = {"lhip": (BEHIND, 0.15, 0.0), "rhip": (BEHIND, -0.05, 0.0)}
for hip, place in HIPS.items():
    BODY.length[BODY.index(hip)] = np.linalg.norm(place)
    BODY.rest_direction[BODY.index(hip)] = place / np.linalg.norm(place)
ENCODING = BoneDirections.of(BODY)
LEGS = [[BODY.index(side + end) for end in ("hip", "kne", "ank", "foo")] for side in "lr"]
TIME = np.arange(301) / RATE


def standing(twist, lean):
    """A body on straight legs whose toes stay while its hips turn by `twist`, rad, or go ahead by `lean`, m, (T,)."""
    length = sum(LENGTHS[bone] for bone in LEGS[0][1:])
    cos, sin = np.cos(twist), np.sin(twist)
    toes = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
    hips = np.stack([np.stack([x * cos - y * sin, x * sin + y * cos, 0.0 * cos], -1) for x, y, _ in HIPS.values()])
    root = np.stack([lean, 0.0 * lean, 0.0 * lean], axis=-1) - hips.mean(axis=0)
    root[:, 2] = np.sqrt(length**2 - np.square((root + hips[0] - toes[0])[:, :2]).sum(axis=-1))
    direction = np.tile(BODY.rest_direction, (len(TIME), 1, 1))
    for leg, (hip, *bones) in enumerate(LEGS):
        direction[:, hip] = hips[leg] / BODY.length[hip]
        direction[:, bones] = ((toes[leg] - root - hips[leg]) / length)[:, None]
    rotation = np.concatenate([np.zeros((len(TIME), 1, 4)), between(BODY.rest_direction, direction)], axis=1)
    rotation[:, 0, 0], rotation[:, 0, 3] = np.cos(0.5 * twist), np.sin(0.5 * twist)
    return Clip("stands", BODY, RATE, root, continuous(rotation))


def toes_of(loop):
    joints = walked_clip("played", ENCODING.skeleton, ENCODING.decode(np.tile(loop, (3, 1))), RATE).joints()
    return joints[:, [1 + leg[-1] for leg in LEGS], :2]


@pytest.mark.parametrize(
    ("twist", "lean"),
    [
        (0.0 * TIME, 0.05 * np.sin(5.0 * TIME) + 0.06 * TIME / TIME[-1]),
        (0.15 * TIME**2, 0.0 * TIME),
    ],
)
def test_feet_that_stand_stay_for_three_rounds(twist, lean):
    clip = standing(twist, lean)
    own = clip.joints()[:, [1 + leg[-1] for leg in LEGS]]
    assert np.ptp(own, axis=0).max() < 1e-9  # they stand in the recording
    channels = ENCODING.encode(clip)
    cut = Seam(0, len(channels) - 1, 0.0)
    closed = close_loop(channels, cut, ENCODING.velocities, RATE)
    loop = pinned(ENCODING, closed, channels, cut, RATE)
    before, after = (np.ptp(toes_of(one), axis=0).max() for one in (closed, loop))
    assert before > 0.03
    assert after < 0.1 * before
    assert np.array_equal(np.delete(loop, [1, 2, 3], axis=1), np.delete(closed, [1, 2, 3], axis=1))


def test_a_body_in_the_air_moves_as_it_did():
    clip = standing(0.3 * TIME, 0.05 * TIME)
    position = clip.root_position + np.stack([0.0 * TIME, 3.0 * TIME, 0.0 * TIME], axis=-1)  # feet move at 3 m/s
    channels = ENCODING.encode(Clip("flies", BODY, RATE, position, clip.rotation))
    cut = Seam(20, 280, 0.0)
    closed = close_loop(channels, cut, ENCODING.velocities, RATE)
    assert np.array_equal(pinned(ENCODING, closed, channels, cut, RATE), closed)


def test_a_loop_that_returns_exactly_is_left_alone():
    phase = 2.0 * np.pi * TIME / TIME[-1]
    channels = ENCODING.encode(standing(0.1 * np.sin(phase), 0.02 * np.cos(phase)))
    cut = Seam(0, len(channels) - 1, 0.0)
    closed = close_loop(channels, cut, ENCODING.velocities, RATE)
    assert np.abs(pinned(ENCODING, closed, channels, cut, RATE) - closed)[5:].max() < 0.05
