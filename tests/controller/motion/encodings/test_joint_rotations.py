"""Joint rotations come back exactly, twists included, and say of bone directions what those say."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import synthetic
from controller.motion.clip import Clip, walked_clip
from controller.motion.encodings.bone_directions import FIRST_BONE, BoneDirections, JointRotations
from controller.motion.encodings.encoding import encoding_of
from controller.motion.rotations import conjugate, from_rotation_vector, multiply, normalise, to_rotation_vector


def clip(seed, frames=12):
    skeleton = synthetic.small_skeleton()
    rng = np.random.default_rng(seed)
    rotation = normalise(rng.normal(size=(frames, 1 + len(skeleton), 4)))
    # Hips that do not stand on end, so that there is a heading.
    rotation[:, [1, 3]] = from_rotation_vector(rng.normal(scale=0.2, size=(frames, 2, 3)))
    return Clip("any", skeleton, 120.0, rng.normal(size=(frames, 3)), rotation)


@given(st.integers(0, 10_000))
def test_every_rotation_comes_back(seed):
    recording = clip(seed)
    encoding = encoding_of(recording.skeleton, twist=True)
    assert isinstance(encoding, JointRotations)
    channels = encoding.encode(recording)
    assert channels.shape == (len(recording), encoding.channels)
    pose = walked_clip("back", encoding.skeleton, encoding.decode(channels), recording.rate)
    # The path begins where the heading does: only the turn about the vertical may differ, the same for all bones.
    apart = multiply(pose.rotation, conjugate(recording.rotation))
    assert np.allclose(np.abs(np.sum(apart * apart[:, :1], axis=-1)), 1.0, atol=1e-7)
    assert np.allclose(to_rotation_vector(apart)[..., :2], 0.0, atol=1e-5)
    assert np.allclose(pose.root_position[:, 2], recording.root_position[:, 2])


@given(st.integers(0, 10_000))
def test_its_first_channels_are_the_bone_directions(seed):
    recording = clip(seed)
    plain, full = BoneDirections.of(recording.skeleton), JointRotations.of(recording.skeleton)
    bones = slice(0, FIRST_BONE + 3 * len(recording.skeleton))
    seen, said = plain.encode(recording), full.encode(recording)[:, bones]
    loud = np.setdiff1d(np.arange(seen.shape[1]), plain.silent)
    assert np.allclose(seen[:, loud], said[:, loud])
    assert np.allclose(full.directions(full.encode(recording)), said[:, FIRST_BONE:].reshape(len(said), -1, 3))


def test_one_frame_is_decoded_like_many_and_lengths_do_not_matter():
    recording = clip(3)
    encoding = JointRotations.of(recording.skeleton)
    channels = encoding.encode(recording)
    many = encoding.decode(channels).rotation
    longer = channels.copy()
    longer[:, FIRST_BONE:] *= 1.7
    assert np.allclose(encoding.decode(longer).rotation, many)
    for frame, rotation in zip(channels, many, strict=True):
        assert np.allclose(encoding.decode(frame).rotation, rotation)
