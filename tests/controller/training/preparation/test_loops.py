import numpy as np
import pytest

from controller.training.preparation.loops import HOLD_SECONDS, best_seam, close_loop, hold_end


def drifting_wave(count=300, period=90):
    t = np.arange(count)
    return np.stack([np.sin(2 * np.pi * t / period), np.cos(2 * np.pi * t / period) + 0.0005 * t], axis=1)


def closed(channels, at_least, velocities=slice(0), rate=120.0):
    return close_loop(channels, best_seam(channels, rate, at_least=at_least), velocities, rate)


def test_the_cut_falls_on_whole_periods():
    loop = closed(drifting_wave(), at_least=0.5)
    assert len(loop) == pytest.approx(180, abs=3)


def test_neither_value_nor_slope_jumps_at_the_seam():
    loop = closed(drifting_wave(), at_least=0.5)
    twice = np.concatenate([loop, loop])
    slope = np.diff(twice, axis=0)
    curve = np.abs(np.diff(slope, axis=0)).max(1)
    seam = len(loop)
    assert np.abs(slope[seam - 1]).max() < 1.5 * np.abs(slope).max(1).mean() + np.abs(slope).max() * 0.5
    assert curve[seam - 3 : seam + 2].max() < 2.0 * curve[: seam - 5].max()


def test_all_of_a_clip_without_a_match_is_kept_that_was_asked_for():
    ramp = np.linspace(0, 1, 100)[:, None] * np.ones(2)
    assert len(closed(ramp, at_least=0.8)) >= 80


def test_a_held_end_stands_still_without_a_jump():
    t = np.arange(80)
    channels = np.stack([0.9 + 0 * t, np.sin(t / 30), 0.5 + 0 * t], axis=1)
    held = hold_end(channels, slice(2, 3), 120.0)
    assert np.array_equal(held[: len(channels)], channels)
    assert np.ptp(held[-round(120.0 * HOLD_SECONDS) :], axis=0) == pytest.approx([0, 0, 0])
    assert held[-1, 2] == 0.0
    steps = np.abs(np.diff(held[:, 1]))
    assert steps[79:].max() <= steps[:79].max() + 1e-9
