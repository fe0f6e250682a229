"""Motions of CMU 86 in a centralized network: they stay in their range, and switches are no rougher than they are."""

import itertools

import numpy as np
import pytest

from controller.learning.centralized.motion_training import train_centralized
from controller.learning.preparation.loops import best_seam, close_loop
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.reading import read_clip
from controller.networks.centralized.centralized import CentralizedGenerator

CUTS = {"walk": (100, 520), "punch": (2020, 2480), "kick": (3300, 4000)}


@pytest.fixture(scope="module")
def encoding(recording):
    return BoneDirections(recording.skeleton, "rhipjoint", "lhipjoint")


@pytest.fixture(scope="module")
def recording(mocap_data):
    return read_clip(mocap_data / "cmu/86/86_01.amc")


@pytest.fixture(scope="module")
def loops(recording, encoding):
    channels = encoding.encode(recording)
    places = joint_features(encoding, channels)
    return {
        name: close_loop(
            channels[first:end], best_seam(places[first:end], 120.0, at_least=0.35), encoding.velocities, 120.0
        )
        for name, (first, end) in CUTS.items()
    }


@pytest.fixture(scope="module")
def generator(loops):
    return CentralizedGenerator(
        {name: train_centralized(frames, 120.0, loop=True, satellites=60) for name, frames in loops.items()}
    )


def accelerations(features):
    joints = features[:, :-1].reshape(len(features), -1, 3)
    return np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1).ravel()


@pytest.mark.thorough
def test_joints_are_where_they_were_taught_to_be(generator, loops, encoding):
    for name, frames in loops.items():
        played = generator[name].at(np.arange(len(frames)) / 120.0)
        assert np.abs(joint_features(encoding, played) - joint_features(encoding, frames)).mean() < 0.4
        assert generator[name].largest_weight < 1000


@pytest.mark.thorough
def test_ten_minutes_stay_within_the_range_of_training(generator, loops, encoding):
    for name, frames in loops.items():
        taught = joint_features(encoding, frames)
        room = 0.1 * np.ptp(taught, axis=0) + 0.1
        generator.cue(name)
        for _ in range(10):
            played = joint_features(encoding, np.array([generator.step(0.05).copy() for _ in range(1200)]))
            assert (played <= taught.max(0) + room).all()
            assert (played >= taught.min(0) - room).all()


def test_switches_are_no_rougher_than_their_motions(generator, loops, encoding):
    """Compared at the same moments: which moments of a motion a switch falls on is chance, and they differ a lot."""

    def rough(frames):
        return accelerations(joint_features(encoding, frames))

    rng = np.random.default_rng(0)
    switched, alone = [], []
    for source, target in itertools.permutations(loops, 2):
        for phase in rng.uniform(size=3):
            generator.cue(source, phase)
            generator.switch(target)
            entered = generator.snapshot()[1].time
            frames = []
            while not generator.settled:
                frames.append(generator.step(1 / 120).copy())
            elapsed = np.arange(1, len(frames) + 1) / 120
            left = generator[source].at(phase * generator[source].seconds + elapsed)
            switched.append(rough(np.array(frames)))
            alone.append(np.maximum(rough(left), rough(generator[target].at(entered + elapsed))))
    assert np.quantile(np.concatenate(switched), 0.999) <= np.quantile(np.concatenate(alone), 0.999)
