import numpy as np
import pytest

import synthetic
from controller.learning.trainers.echo_state import EchoStateRecipe
from synthetic import run


@pytest.fixture(scope="module")
def network():
    recipe = EchoStateRecipe(neurons=300, washout=60, ridge=0.01, state_noise=0.005, teacher_noise=0.005)
    return synthetic.trained(recipe, seed=1)


@pytest.mark.parametrize("name", ["march", "wave"])
def test_a_loop_runs_free_and_stays_on_its_motion(network, name):
    taught = synthetic.MOTIONS[name]()
    network.cue(name, 0)
    played = run(network, len(taught) * 4)[-len(taught) :]
    error = min(np.abs(np.roll(taught, shift, axis=0) - played).mean() for shift in range(len(taught)))
    assert error < 0.03


def test_an_impossible_state_does_not_make_it_run_away(network):
    network.cue("march", 0)
    motion, x, y = network.snapshot()
    network.restore((motion, x + np.random.default_rng(0).uniform(-50, 50, x.shape).astype(np.float32), y))
    played = run(network, 96 * 6)
    reach = np.max([np.abs(make()).max(0) for make in synthetic.MOTIONS.values()], axis=0)
    assert (np.abs(played) <= 1.2 * reach + 0.1).all()


def test_the_same_seed_gives_the_same_bytes():
    first, second, other = (
        synthetic.trained(EchoStateRecipe(neurons=60, washout=60, drives=1), seed=seed) for seed in (4, 4, 5)
    )
    assert first.weights.tobytes() == second.weights.tobytes()
    assert first["bow"].readout.tobytes() == second["bow"].readout.tobytes()
    assert first["bow"].readout.tobytes() != other["bow"].readout.tobytes()


def test_the_output_is_kept_within_a_twentieth_of_the_range_of_training(network):
    network.cue("march", 0)
    motion, _, y = network.snapshot()
    strongest = np.sign(motion.readout[0])  # the state that drives one channel as far as it goes
    network.restore((motion, 50.0 * strongest, 0.0 * y))
    frame = np.empty(network.channels)
    largest = 0.0
    for _ in range(20):
        network.advance(frame)
        largest = max(largest, float(np.abs(network.normalisation.apply(frame)).max()))
    assert largest == pytest.approx(1.05, abs=1e-5)
