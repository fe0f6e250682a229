"""Networks with centers are measured as reservoirs are: training errors and disturbances."""

import msgspec
import numpy as np
import pytest

import synthetic
from controller.learning.evaluation.evaluation import training_error
from controller.learning.evaluation.failure_rates import sweep, train_network
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe

RECIPE = LibraryRecipe(
    name="small",
    network=CentralizedRecipe(satellites=16, iterations=15),
    motions=[MotionRecipe(name=name, file="") for name in synthetic.MOTIONS],
    body="",
    licence="",
)


@pytest.fixture(scope="module")
def syllabus():
    return synthetic.training_set()


@pytest.fixture(scope="module")
def subject(syllabus):
    return train_network(RECIPE, syllabus, 0)


@pytest.mark.parametrize("motion", list(synthetic.MOTIONS))
def test_several_runs_play_what_one_plays(subject, motion):
    network = subject.network
    network.cue(motion, 0)
    frame = np.empty(network.channels)
    player, frames = network.twin(3), np.empty((3, network.channels))
    player.cue(motion, 0)
    for _ in range(250):
        network.advance(frame)
        player.advance(frames)
    assert np.allclose(frames, frame, atol=1e-5)


def test_one_run_and_several_recover_alike(subject):
    """A push on the centers: the amplitude is back in the next step, the phases at the end of the round."""
    network = subject.network
    push = np.array([3.0, -1.0, 0.5, 2.0], dtype=np.float32)
    several = network.twin(1)
    several.cue("march", 0)
    several.displace(push[None])
    network.cue("march", 0)
    network.displace(push)
    frame, frames, calm = np.empty(network.channels), np.empty((1, network.channels)), []
    for _ in range(2 * round(network["march"].seconds * network.rate) + 1):
        network.advance(frame)
        several.advance(frames)
        assert np.allclose(frames[0], frame, atol=1e-5)
        calm.append(frames[0].copy())
    assert not np.allclose(calm[0], network["march"].at(np.array([1 / network.rate]))[0], atol=0.05)
    assert np.allclose(calm[-1], network["march"].at(np.array([1 / network.rate]))[0], atol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["robustness", "stability"])
def test_loops_come_back_from_every_disturbance(subject, syllabus, kind):
    counts = sweep(kind, [subject], syllabus, 5)
    assert [(one.motion, one.intrinsic) for one in counts if one.loop] == [("march", 0), ("wave", 0)]
    assert all(one.guarded is None for one in counts), "the deck plays it without a guard"


@pytest.mark.parametrize("network", [RECIPE.network, PhaseRecipe(neurons=100, rank=20), PhaseEchoStateRecipe()])
def test_training_errors(syllabus, network):
    found = training_error(msgspec.structs.replace(RECIPE, network=network), syllabus, 0)
    assert 0.0 < found.nrmse_readout < 0.1
    assert 0.0 < found.mabs_readout < 10.0
    assert found.mabs_weights is None
