"""A path in another unit than the bones is scaled to theirs; a body whose height is not in the file is not."""

import numpy as np
import pytest

from controller.motion.clip import Clip
from controller.motion.take.steps import in_one_unit
from simulated_bodies import human


def walk(times=1.0, height=0.9, hops=0.0):
    time = np.arange(60) / 30.0
    rises = 0.03 * np.sin(6.0 * time) + hops * np.maximum(0.0, np.sin(4.0 * time))
    path = np.column_stack([time, 0.1 * np.sin(time), height + rises])
    return Clip("walk", human(), 30.0, times * path, np.tile([1.0, 0.0, 0.0, 0.0], (60, 20, 1)), "walk.bvh")


@pytest.mark.parametrize("hops", [0.0, 0.4])
@pytest.mark.parametrize("times", [0.01, 0.001, 100.0, 0.0254])
def test_a_path_in_another_unit_is_scaled(times, hops):
    found, decision = in_one_unit(walk(times, hops=hops))
    np.testing.assert_allclose(found.root_position, walk(hops=hops).root_position, rtol=1e-9)
    assert decision is not None
    assert decision.notable


@pytest.mark.parametrize("height", [0.9, 1.4, 0.03, -12.0])
def test_a_path_in_the_unit_of_the_bones_stays(height):
    clip = walk(height=height)
    found, decision = in_one_unit(clip)
    assert found is clip
    assert decision is None
