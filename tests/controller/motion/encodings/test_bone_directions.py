from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bodies import random_clip, small_body
from controller.motion.clip import Clip, walked_clip
from controller.motion.encodings.bone_directions import FIRST_BONE, HEIGHT, LEFT, TURN_RATE, BoneDirections
from controller.motion.rotations import from_rotation_vector, multiply, normalise, rotate, yaw
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError
from simulated_bodies import human, smooth_poses

seeds = st.integers(0, 2**32 - 1)


def wandering(seed, skeleton=None, frames=40):
    """A clip that walks and turns smoothly, its hips level enough for the heading to be well defined."""
    rng = np.random.default_rng(seed)
    skeleton = skeleton or small_body()
    time = np.linspace(0.0, 3.0, frames)[:, None, None]
    bend = 0.3 * np.sin(time + rng.uniform(0.0, 6.0, (1, 1 + len(skeleton), 3)))
    bend[:, [0, 1, 4]] = bend[:, :1]  # the hips are rigid with the root
    heading = np.cumsum(rng.normal(size=frames) * 0.1) + rng.uniform(-3.0, 3.0)
    rotation = multiply(yaw(heading)[:, None, :], from_rotation_vector(bend))
    return Clip("wandering", skeleton, 100.0, np.cumsum(rng.normal(size=(frames, 3)), axis=0) * 0.01, rotation)


def on_the_spot(clip):
    """Joints (T, 1 + B, 3) with the first frame's root at the origin and its heading along x."""
    encoding = BoneDirections(clip.skeleton)
    back = yaw(-encoding.heading(clip.rotation[0]))
    start = clip.root_position[0] * [1.0, 1.0, 0.0]
    return rotate(back, clip.joints() - start)


@given(seeds)
def test_channels_survive_the_way_to_a_clip_and_back(seed):
    rng = np.random.default_rng(seed)
    encoding = BoneDirections(small_body())
    channels = rng.normal(size=(8, encoding.channels))
    for hip, side in (("rhip", -1.0), ("lhip", 1.0)):
        at = FIRST_BONE + 3 * encoding.skeleton.index(hip)
        channels[:, at] = 0.0
        channels[:, at + 1] = side * (0.2 + np.abs(channels[:, at + 1]))
    directions = channels[:, FIRST_BONE:].reshape(8, -1, 3)
    channels[:, FIRST_BONE:] = normalise(directions).reshape(8, -1)
    back = encoding.encode(walked_clip("there and back", encoding.skeleton, encoding.decode(channels), 100.0))
    assert np.allclose(back[1:], channels[1:], rtol=0.0, atol=1e-9)
    assert np.allclose(back[0, FIRST_BONE:], channels[0, FIRST_BONE:], rtol=0.0, atol=1e-9)


@given(seeds)
def test_a_clip_survives_the_way_to_channels_and_back(seed):
    clip = wandering(seed)
    encoding = BoneDirections(clip.skeleton)
    back = walked_clip(clip.name, encoding.skeleton, encoding.decode(encoding.encode(clip)), clip.rate)
    assert np.allclose(on_the_spot(back), on_the_spot(clip), atol=1e-9)


@given(seeds, st.floats(-7.0, 7.0))
def test_channels_do_not_depend_on_where_the_clip_starts_and_which_way_it_faces(seed, angle):
    clip = wandering(seed)
    encoding = BoneDirections(clip.skeleton)
    turn = yaw(angle)
    position = rotate(turn, clip.root_position) + np.array([3.0, -2.0, 0.0])
    moved = replace(clip, root_position=position, rotation=multiply(turn, clip.rotation))
    assert np.allclose(encoding.encode(moved), encoding.encode(clip), atol=1e-9)


@given(st.floats(-3.1, 3.1))
def test_the_heading_is_across_the_hips(angle):
    body = small_body()
    rotation = np.tile(yaw(angle), (1 + len(body), 1))
    assert BoneDirections(body).heading(rotation) == pytest.approx(angle)


def test_walking_forward_shows_in_the_channels_in_si_units():
    body = small_body()
    frames = 50
    position = np.stack([np.zeros(frames), np.arange(frames) * 0.01, np.full(frames, 0.8)], axis=-1)
    rotation = np.tile(yaw(np.pi / 2), (frames, 1 + len(body), 1))
    channels = BoneDirections(body).encode(Clip("north", body, 100.0, position, rotation))
    assert channels.shape == (frames, 4 + 3 * len(body))
    assert np.allclose(channels[:, HEIGHT : LEFT + 1], [0.8, 0.0, 1.0, 0.0])
    assert np.allclose(channels[:, FIRST_BONE:].reshape(frames, -1, 3), body.rest_direction)


def test_a_turn_across_the_seam_of_the_angle_is_a_small_turn():
    body = small_body()
    rotation = np.tile(yaw(np.array([3.1, -3.1]))[:, None, :], (1, 1 + len(body), 1))
    channels = BoneDirections(body).encode(Clip("seam", body, 10.0, np.zeros((2, 3)), rotation))
    assert np.allclose(channels[:, TURN_RATE], 10.0 * (2.0 * np.pi - 6.2))


def test_a_clip_of_one_frame_stands_still():
    clip = random_clip(np.random.default_rng(0), small_body(), 1)
    channels = BoneDirections(clip.skeleton).encode(clip)
    assert np.array_equal(channels[0, TURN_RATE : LEFT + 1], np.zeros(3))


def test_directions_of_any_length_decode_to_unit_rotations():
    encoding = BoneDirections(small_body())
    channels = np.random.default_rng(1).normal(size=encoding.channels)
    longer = channels.copy()
    longer[FIRST_BONE:] *= 3.0
    posture = encoding.decode(longer)
    assert np.allclose(posture.rotation, encoding.decode(channels).rotation)
    assert np.allclose(np.linalg.norm(posture.rotation, axis=-1), 1.0)


def test_one_frame_decodes_as_it_does_among_many():
    encoding = BoneDirections(small_body())
    channels = np.random.default_rng(2).normal(size=(5, encoding.channels))
    many, one = encoding.decode(channels), encoding.decode(channels[3])
    assert np.allclose(one.rotation, many.rotation[3], atol=1e-9)
    assert one.height == many.height[3]
    assert one.turn_rate == many.turn_rate[3]
    assert np.array_equal(one.velocity, many.velocity[3])


def test_hip_channels_across_the_heading_are_silent():
    encoding = BoneDirections(small_body())
    assert encoding.silent.tolist() == [4, 13]
    assert np.array_equal(encoding.encode(wandering(0))[:, [4, 13]], np.zeros((40, 2)))


def test_nothing_is_silenced_where_the_root_lies_off_the_hip_line():
    body = small_body()
    rest = body.rest_direction.copy()
    rest[[0, 3]] = normalise(np.array([[0.4, -0.7, -0.6], [0.3, 0.7, -0.6]]))
    pelvis = Skeleton("pelvis", body.bones, body.parent, rest, body.length)
    clip = wandering(3, pelvis)
    encoding = BoneDirections(pelvis)
    assert encoding.silent.size == 0
    back = walked_clip(clip.name, encoding.skeleton, encoding.decode(encoding.encode(clip)), clip.rate)
    assert np.allclose(on_the_spot(back), on_the_spot(clip), atol=1e-9)


def test_hips_that_the_skeleton_lacks_are_a_key_error():
    with pytest.raises(KeyError, match="lhipjoint"):
        _ = BoneDirections(small_body(), right_hip="rhip", left_hip="lhipjoint").silent


def test_hips_are_found_whatever_they_are_called():
    body = human()
    names = tuple(f"bone {bone}" for bone in range(len(body)))
    renamed = Skeleton("other", names, body.parent, body.rest_direction, body.length)
    found, usual = BoneDirections.of(renamed), BoneDirections.of(body)
    assert found.leading.tolist() == usual.leading.tolist()
    poses = smooth_poses(body, np.random.default_rng(5), 20)
    clip = Clip(
        "swing", renamed, 60.0, *(np.array([getattr(p, k) for p in poses]) for k in ("root_position", "rotation"))
    )
    assert np.array_equal(found.encode(clip), usual.encode(replace(clip, skeleton=body)))


def test_a_skeleton_without_hips_is_refused():
    body = small_body()
    trunk = Skeleton("trunk", ("chest", "head"), np.array([-1, 0]), body.rest_direction[5:7], body.length[5:7])
    with pytest.raises(FileFormatError, match="'trunk' has no bones that lead from its root to a right and a left hip"):
        BoneDirections.of(trunk)
