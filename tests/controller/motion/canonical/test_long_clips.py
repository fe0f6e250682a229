"""Looking at a long clip takes about as much memory as the clip has, not many times that."""

import tracemalloc

import numpy as np
import pytest

from controller.motion.canonical.body_doubts import other_doubts
from controller.motion.canonical.clip_edits import breaks, moving_part
from controller.motion.clip import Clip
from controller.motion.rotations import yaw
from controller.motion.take.timing import timed
from simulated_bodies import human

FRAMES = 12_000


@pytest.mark.parametrize(
    ("look", "times"),
    [(moving_part, 1.9), (breaks, 1.8), (other_doubts, 2.7), (lambda clip: timed(clip, "auto"), 2.2)],
    ids=["moves", "breaks", "doubts", "rate"],
)
def test_a_look_at_a_long_clip_needs_little_memory(look, times):
    skeleton, time = human(), np.arange(FRAMES) / 60.0
    turns = np.tile(yaw(np.sin(time))[:, None], (1, 1 + len(skeleton), 1))
    clip = Clip("long", skeleton, 60.0, np.column_stack([time, 0.0 * time, 0.0 * time + 0.9]), turns)
    tracemalloc.start()
    look(clip)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < times * clip.rotation.nbytes
