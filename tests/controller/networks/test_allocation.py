"""A step makes no array: what is made in a real-time loop has to be taken away in it, too."""

import tracemalloc

import numpy as np
import pytest

import synthetic
from controller.networks.centralized.centralized import CentralizedGenerator

# Views and numbers are Python objects of some ten bytes; the smallest array here, a frame, has 28 x 8.
NO_ARRAY = 150


def most_made(step):
    """The most bytes that a step has beyond what there was before it, and what 200 steps leave behind."""
    step()
    tracemalloc.start()
    try:
        step()
        began, most = tracemalloc.get_traced_memory()[0], 0
        for _ in range(200):
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            step()
            most = max(most, tracemalloc.get_traced_memory()[1] - before)
        return most, tracemalloc.get_traced_memory()[0] - began
    finally:
        tracemalloc.stop()


def quietest(step):
    """As `most_made`; what another thread of the tests makes meanwhile counts too, but does not come three times."""
    return [min(bytes) for bytes in zip(*(most_made(step) for _ in range(3)), strict=True)]


@pytest.mark.parametrize("kind", [kind for kind in synthetic.NETWORKS if kind != "centralized"])
def test_a_step_makes_no_array(kind):
    network = synthetic.NETWORKS[kind]()
    network.cue("wave", 0)
    out = np.empty(network.channels)
    assert max(quietest(lambda: network.advance(out))) < NO_ARRAY


def test_a_centralized_step_makes_no_array():
    # numpy goes through complex numbers with an iterator of about 1 kB, which it takes away again; whatever else a step
    # made would grow with the satellites.
    most = []
    for satellites in (20, 200):
        network = synthetic.small_centralized(satellites)
        network.cue("wave", 0)
        out = np.empty(network.channels)
        generator = CentralizedGenerator({name: network[name] for name in network.motions})
        generator.cue("wave")
        made = [
            quietest(step) for step in (lambda net=network, o=out: net.advance(o), lambda g=generator: g.step(0.003))
        ]
        assert max(left for _, left in made) < NO_ARRAY
        most.append(max(peak for peak, _ in made))
    assert most[1] - most[0] < NO_ARRAY
    assert most[1] < 1500
