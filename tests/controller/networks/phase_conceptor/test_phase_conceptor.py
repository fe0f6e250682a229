"""Phase-driven conceptors: what a piece hands on to the next."""

import numpy as np

import synthetic
from controller.learning.measures.self_test import run_free


def test_the_next_piece_begins_in_the_state_that_it_is_handed():
    motion = synthetic.small_phase_network(piece_seconds=0.5)["bow"]
    z = np.random.default_rng(0).standard_normal(motion.states.shape[1])
    first, second = (motion.stored.basis[piece].astype(np.float64) for piece in (0, 1))
    state = motion.stored.mean[0] + first @ z
    hand_on, shift = motion.by_piece[1][:2]
    assert np.allclose(z @ hand_on + shift, (state - motion.stored.mean[1]) @ second, atol=1e-4)


def test_a_network_that_rested_plays_the_same_and_held_only_what_is_stored():
    network = synthetic.small_phase_network(piece_seconds=0.5)
    before = run_free(network, "bow", 40)
    network.rest()
    assert not any(name in vars(network["bow"]) for name in ("states", "by_level", "by_piece"))
    assert np.array_equal(run_free(network, "bow", 40), before)


def test_a_part_of_a_network_plays_as_the_whole():
    network = synthetic.small_phase_network()
    alone = network.only(["bow"])
    assert alone.motions == ("bow",)
    assert np.array_equal(run_free(alone, "bow", 40), run_free(network, "bow", 40))
