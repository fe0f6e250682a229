from dataclasses import replace

import numpy as np
import pytest

from bodies import random_clip, small_body
from motiondeck_base.errors import FileFormatError


def clip(frames=6):
    return random_clip(np.random.default_rng(0), small_body(), frames)


def test_a_clip_knows_how_long_it_lasts():
    assert len(clip(90)) == 90
    assert clip(90).duration == pytest.approx(1.5)


def test_joints_are_those_of_the_skeleton_in_every_frame():
    one = clip()
    assert one.joints().shape == (6, 10, 3)
    assert np.allclose(one.joints()[3], one.skeleton.joints(one.root_position[3], one.rotation[3]))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"root_position": np.zeros((0, 3)), "rotation": np.zeros((0, 10, 4))}, "do not hold frames"),
        ({"root_position": np.zeros((5, 3))}, "do not hold frames of 9 bones"),
        ({"rotation": np.zeros((6, 9, 4))}, "do not hold frames of 9 bones"),
        ({"root_position": np.full((6, 3), np.inf)}, "not finite"),
        ({"rotation": np.full((6, 10, 4), np.nan)}, "not finite"),
        ({"rate": 0.0}, "rate of 0.0"),
        ({"rate": -120.0}, "rate of -120.0"),
        ({"rate": float("nan")}, "rate of nan"),
    ],
)
def test_a_clip_that_cannot_be_is_refused_by_name(change, complaint):
    with pytest.raises(FileFormatError, match=complaint) as error:
        replace(clip(), **change)
    assert "clip 'random'" in str(error.value)
