import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.learning.preparation.cycles import in_step
from controller.learning.preparation.loops import (
    EASE_SECONDS,
    HOLD_SECONDS,
    Seam,
    best_seam,
    close_loop,
    hold_end,
    in_place,
    slopes,
)


def drifting_wave(count=300, period=90):
    t = np.arange(count)
    return np.stack([np.sin(2 * np.pi * t / period), np.cos(2 * np.pi * t / period) + 0.0005 * t], axis=1)


def closed(channels, at_least, velocities=slice(0), rate=120.0):
    return close_loop(channels, best_seam(channels, rate, at_least=at_least), velocities, rate)


def test_the_cut_falls_on_whole_periods():
    loop = closed(drifting_wave(), at_least=0.5)
    assert len(loop) == pytest.approx(180, abs=3)


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0, 500.0])
def test_of_seams_that_match_alike_the_longest_loop_is_kept(rate):
    t = np.arange(round(3.3 * rate)) / rate
    cut = best_seam(np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)], axis=1), rate, at_least=0.5)
    assert cut.end - cut.start == 3 * rate


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


def test_a_held_end_is_the_last_recorded_frame_and_stands_still():
    t = np.arange(80)
    channels = np.stack([0.9 + 0 * t, np.sin(t / 30), 0.5 + 0 * t], axis=1)
    held = hold_end(channels, slice(2, 3), 120.0)
    assert held[-round(120.0 * HOLD_SECONDS) :, :2] == pytest.approx(np.tile(channels[-1, :2], (120, 1)), abs=1e-12)
    assert not held[-round(120.0 * HOLD_SECONDS) :, 2].any()
    slowing = round(120.0 * EASE_SECONDS)
    assert np.array_equal(held[: len(channels) - slowing], channels[:-slowing])


@pytest.mark.parametrize("rate", [24.0, 30.0, 120.0, 240.0])
@pytest.mark.parametrize("seconds", [0.1, 0.4, 2.0])
def test_a_one_shot_slows_down_along_its_recording(rate, seconds):
    t = np.arange(round(seconds * rate)) / rate
    channels = np.stack([3.0 * t, np.full(len(t), 3.0)], axis=1)  # a place, and its velocity
    held = hold_end(channels, slice(1, 2), rate)
    place, velocity = held.T
    assert place.max() == pytest.approx(3.0 * t[-1], abs=1e-12)
    pace = np.diff(place) * rate
    assert pace.min() >= -1e-9
    assert pace.max() <= 3.0 + 1e-9
    assert velocity.sum() / rate == pytest.approx(3.0 * t[-1], abs=4.0 / rate)
    stops_in = 2.0 * max(1, min(round(EASE_SECONDS * rate), (len(t) - 1) // 2)) / rate
    assert np.abs(np.diff(pace)).max() * rate <= 1.02 * 1.5 * 3.0 / stops_in


def steps_of_a_walk(rate, seconds=4.0):
    """Arms that swing once a second, and a turn rate whose mean is 5 degrees a second, with noise that alternates."""
    t = np.arange(round(seconds * rate)) / rate
    turn = np.radians(5.0) + 0.3 * np.sin(2 * np.pi * t) + 1.5 * (-1.0) ** np.arange(len(t))
    drift = 0.004 * t
    return np.stack([np.sin(2 * np.pi * t) + drift, np.cos(2 * np.pi * t), turn], axis=1)


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0, 240.0])
def test_a_loop_turns_as_far_as_its_recording_did_at_any_rate(rate):
    walk = steps_of_a_walk(rate)
    cut = best_seam(walk[:, :2], rate, at_least=0.5)
    assert (cut.end - cut.start) / rate == pytest.approx(round((cut.end - cut.start) / rate), abs=2 / rate)
    loop = close_loop(walk, cut, slice(2, 3), rate)
    recorded = walk[cut.start : cut.end, 2].sum() / rate
    assert loop[:, 2].sum() / rate == pytest.approx(recorded, abs=np.radians(1.0))
    assert np.abs(loop[:, 2]).max() < 1.3 * np.abs(walk[:, 2]).max()


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0, 240.0])
def test_a_loop_and_a_held_end_are_alike_at_any_rate(rate):
    t = np.arange(round(3.0 * rate)) / rate
    curve = np.stack([np.sin(2 * np.pi * t) + 0.02 * t, np.cos(2 * np.pi * t)], axis=1)
    fine = np.arange(3 * 960) / 960
    finest = np.stack([np.sin(2 * np.pi * fine) + 0.02 * fine, np.cos(2 * np.pi * fine)], axis=1)
    held, expected = (hold_end(c, slice(0), r) for c, r in ((curve, rate), (finest, 960.0)))
    at = np.linspace(0.0, 4.2, 50)
    for channel in range(2):
        values = [np.interp(at, np.arange(len(h)) / r, h[:, channel]) for h, r in ((held, rate), (expected, 960.0))]
        # At 24 Hz the last recorded frame comes 0.04 s before that of the finest one, at 6 rad/s.
        assert values[0] == pytest.approx(values[1], abs=0.35 * 24.0 / rate)
    loops = [closed(c, 0.5, rate=r) for c, r in ((curve, rate), (finest, 960.0))]
    assert len(loops[0]) / rate == pytest.approx(len(loops[1]) / 960.0, abs=2.0 / rate)


@pytest.mark.parametrize("rate", [24.0, 30.0, 120.0, 240.0])
def test_slopes_of_a_parabola_are_exact_at_its_ends_too(rate):
    t = np.arange(round(rate)) / rate
    assert rate * slopes((3.0 * t + 5.0 * t**2)[:, None], rate)[:, 0] == pytest.approx(3.0 + 10.0 * t)


@given(apart=st.floats(-0.2, 0.2), turned=st.floats(-2.0, 2.0), rate=st.sampled_from([60.0, 120.0, 240.0]))
@settings(max_examples=30)
def test_a_seam_is_eased_within_a_tenth_of_a_second_and_no_harder_than_the_motion_moves(apart, turned, rate):
    t = np.arange(round(2.0 * rate)) / rate
    swings = 0.3 * np.sin(2 * np.pi * t)[:, None]
    # A value and a slope that the recording does not come back to.
    recording = swings + (apart * t + turned * (t**2 / 2.0 - t / 2.0))[:, None]
    cut = Seam(0, round(rate), 0.0)
    loop, taught = close_loop(recording, cut, slice(0), rate), recording[: round(rate)]
    off = np.abs(loop - taught)[:, 0]
    assert off.max() <= 0.5 * abs(apart) + 0.36 * 0.1 * abs(turned) + 0.02
    assert off[round(0.4 * rate) : -round(0.4 * rate)].max() <= 0.01
    round_twice, usual = np.concatenate([loop, loop, loop])[:, 0], 0.3 * (2 * np.pi) ** 2
    added = np.abs(np.diff(round_twice, 2)).max() * rate**2
    assert added <= 2.2 * usual + abs(turned) / 0.12


def test_a_jump_is_shared_by_both_sides_of_a_seam():
    t = np.arange(240) / 120.0
    rising = (0.3 * np.sin(2 * np.pi * t) + 0.1 * t)[:, None]
    off = (close_loop(rising, Seam(0, 120, 0.0), slice(0), 120.0) - rising[:120])[:, 0]
    assert off[0] == pytest.approx(0.05, abs=0.002)
    assert off[-1] == pytest.approx(-0.05, abs=0.01)
    assert np.abs(off[30:-30]).max() < 0.003


def test_the_height_of_a_body_lifts_every_joint():
    features = np.arange(14.0).reshape(2, 7)
    joints = in_place(features)
    assert np.array_equal(joints[:, [2, 5]], features[:, [2, 5]] + features[:, 6:])
    assert np.array_equal(joints[:, [0, 1, 3, 4]], features[:, [0, 1, 3, 4]])
    assert np.array_equal(in_place(joints), joints)


def test_loops_in_step_are_alike_at_one_phase_whatever_frame_they_begin_with():
    """One stride at several rates, begun anywhere: the turns differ by what each was begun late."""
    begun, frames = (0.0, 0.3, 0.8), (96, 130, 60)
    loops = {}
    for name, (late, count) in enumerate(zip(begun, frames, strict=True)):
        t = 2.0 * np.pi * (np.arange(count) / count + late)
        loops[str(name)] = np.column_stack([np.sin(t), 0.3 * np.cos(2.0 * t), np.cos(t)])
    turns = in_step(loops)
    late = np.array([turns[str(name)] for name in range(3)]) / (2.0 * np.pi)
    off = (late - late[0] - begun + 0.5) % 1.0 - 0.5
    assert np.abs(off).max() < 0.011
