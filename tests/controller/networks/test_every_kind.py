"""What networks of every kind do alike."""

import numpy as np
import pytest

import synthetic
from motiondeck_base.errors import UnknownNameError
from synthetic import run


@pytest.fixture(scope="module", params=synthetic.NETWORKS)
def network(request):
    return synthetic.NETWORKS[request.param]()


def test_two_runs_from_one_snapshot_are_identical(network):
    network.cue("wave", 7)
    run(network, 30)
    kept = network.snapshot()
    first = run(network, 50)
    network.cue("march", 0)
    network.restore(kept)
    assert np.array_equal(first, run(network, 50))


def test_a_twin_plays_another_motion_without_being_heard(network):
    network.cue("march", 0)
    alone = run(network, 20)
    network.cue("march", 0)
    twin = network.twin()
    twin.cue("wave", 0)
    run(twin, 5)
    assert np.array_equal(run(network, 20), alone)


def test_an_unknown_motion_is_refused_with_the_nearest_name(network):
    with pytest.raises(UnknownNameError, match="march"):
        network.cue("mrach", 0)
