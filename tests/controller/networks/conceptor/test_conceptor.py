import numpy as np
import pytest

import synthetic
from synthetic import run


@pytest.fixture(scope="module")
def network():
    return synthetic.small_network()


def test_a_loop_runs_free_and_stays_on_its_motion(network):
    network.cue("march", 0)
    played, taught = run(network, 96 * 5)[96 * 4 :], synthetic.march()
    error = min(np.abs(np.roll(taught, shift, axis=0) - played).mean() for shift in range(96))
    assert error < 0.03


def test_a_motion_that_happens_once_ends_and_holds(network):
    network.cue("bow", 0)
    end = run(network, 900)[-1]
    assert np.abs(end - synthetic.bow()[-1]).max() < 0.05


def test_anchors_are_the_taught_frames(network):
    for name, make in synthetic.MOTIONS.items():
        assert np.abs(network.anchors(name) - make()[:: synthetic.SMALL_RECIPE.anchor_every]).max() < 0.1


def test_the_same_seed_gives_the_same_network():
    first, second = (synthetic.small_network(seed=4) for _ in range(2))
    for field in ("recurrent", "bias", "project", "offset", "readout", "rest", "states"):
        assert getattr(first["bow"], field).tobytes() == getattr(second["bow"], field).tobytes()
    assert not np.array_equal(first["march"].recurrent, synthetic.small_network(seed=5)["march"].recurrent)


def test_a_state_three_times_as_long_as_any_stored_one_is_astray(network):
    for name in network.motions:
        longest = max(network[name].states, key=np.linalg.norm)
        for factor, lost in ((1.0, False), (3.0, True)):
            part, bound, _ = (network.cue(name, 0), network.snapshot())[1]
            network.restore((part, bound, factor * longest))
            assert bool(network.astray()) is lost
