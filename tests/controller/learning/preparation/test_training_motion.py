"""Normalised motions are made when they are asked for, and are those of the set."""

import numpy as np

import synthetic


def test_motions_are_made_when_they_are_asked_for():
    wanted, _ = synthetic.lessons()
    motions = synthetic.training_set().lessons().motions
    assert [motion.name for motion in motions] == [motion.name for motion in motions[:]] == ["march", "wave", "bow"]
    assert motions[0] is not motions[0]
    for one, other in zip(motions, wanted, strict=True):
        assert np.array_equal(one.frames, other.frames)
        assert one.loop == other.loop
