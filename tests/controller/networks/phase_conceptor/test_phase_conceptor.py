"""Phase-driven conceptors: what a piece hands on to the next."""

import numpy as np

import synthetic


def test_the_next_piece_begins_in_the_state_that_it_is_handed():
    motion = synthetic.small_phase_network(piece_seconds=0.5)["bow"]
    z = np.random.default_rng(0).standard_normal(motion.states.shape[1])
    first, second = (motion.stored.directions[piece].astype(np.float64) for piece in (0, 1))
    state = motion.stored.mean[0] + first @ z
    hand_on, shift = motion.by_piece[1][:2]
    assert np.allclose(z @ hand_on + shift, (state - motion.stored.mean[1]) @ second, atol=1e-4)
