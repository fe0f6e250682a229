"""The weights that phase-driven motions share, and how the center turns with a motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.networks.reservoirs.phase_reservoir import PhaseCourse, PhaseReservoir, PhaseScales

SCALES = PhaseScales(5, 2, 1.6, 1.0, 3.0, 0.8)


def test_the_shared_weights_are_the_same_everywhere():
    # Stored libraries depend on these numbers: only U, V and R are in the file.
    reservoir = PhaseReservoir.draw(SCALES, 3, seed=7)
    assert reservoir.weights[0, :3] == pytest.approx([0.3100753, 0.98457754, 0.6833447], abs=1e-6)
    assert reservoir.bias[-1] == pytest.approx(-0.09549845, abs=1e-6)


@given(st.integers(0, 2**32))
@settings(max_examples=20)
def test_weights_lie_within_their_scales(seed):
    reservoir = PhaseReservoir.draw(SCALES, 3, seed)
    assert reservoir.weights.shape == (5, 5)
    assert reservoir.phase_weights.shape == (5, 4)
    assert np.abs(reservoir.weights).max() <= 1.6 * np.sqrt(3.0 / 5.0)
    assert np.abs(reservoir.phase_weights).max() <= 3.0 / np.sqrt(2.0)


def test_the_spectral_radius_is_as_asked_for():
    reservoir = PhaseReservoir.draw(PhaseScales(400, 1, 1.5, 1.0, 1.0, 1.0), 3, 0)
    assert np.abs(np.linalg.eigvals(reservoir.weights)).max() == pytest.approx(1.5, rel=0.1)


@given(st.integers(4, 400), st.integers(1, 6), st.booleans(), st.integers(0, 3))
def test_a_course_turns_once_round_or_half_a_turn_a_piece(frames, pieces, loop, held):
    pieces = 2 * (pieces // 2) or 1 if loop else pieces
    course = PhaseCourse.of(frames, pieces, loop=loop, held=0 if loop else min(held, frames - 2))
    step = np.diff(course.phase)
    turned = course.phase[-1] + (step[0] if loop else 0.0)
    assert turned == pytest.approx(np.pi * (2 if loop and pieces == 1 else pieces))
    assert (step >= 0.0).all()
    assert course.held == (0 if loop else min(held, frames - 2))
    assert course.piece[0] == 0
    assert (np.diff(course.piece) >= 0).all()
    assert course.piece[-1] == min(pieces, course.piece.max() + 1) - 1
    for share in (0.0, 0.3, 0.9):
        found = course.share_at(course.frame_at(share))
        off = abs(found - share)
        assert min(off, 1.0 - off) <= 1.0 / (frames - 1 - course.held)


@given(st.integers(4, 400), st.integers(1, 6), st.booleans())
def test_the_phase_rises_before_a_one_shot_but_not_in_old_libraries(frames, pieces, leads_in):
    course = PhaseCourse.of(frames, pieces, loop=False, leads_in=leads_in)
    before = course.before(100)
    assert (before >= -np.pi).all()
    assert before[-1] == pytest.approx(max(-course.phase[1], -np.pi) if leads_in else 0.0)
    phase, piece = course.with_lead_in
    assert np.array_equal(phase[-100:], before)
    assert (piece[-100:] == 0).all()
