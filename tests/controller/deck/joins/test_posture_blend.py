"""Blending postures: both ends are exact, bones turn along the rotation between them, and none changes sides."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.joins.blend_weight import Ramp
from controller.deck.joins.deck_motions import read_motions, tempos_in_step
from controller.deck.joins.posture_blend import PostureBlend, SmoothHeading
from controller.mocap.posture import Posture
from controller.rotations import conjugate, from_rotation_vector, multiply, normalise, rotate, to_rotation_vector, yaw

BONES, DT = 4, 0.005


def posture(rotation, velocity=(0.0, 0.0), turn_rate=0.0, height=1.0):
    return Posture(np.array(height), np.array(velocity, dtype=float), np.array(turn_rate), rotation)


def swinging(seed, t):
    """A body that walks, turns, and swings its bones smoothly."""
    rng = np.random.default_rng(seed)
    offset, axis = rng.standard_normal((2, 1 + BONES, 3))
    bones = multiply(from_rotation_vector(offset), from_rotation_vector(0.7 * np.sin(3.0 * t) * normalise(axis)))
    turn_rate, sideways = rng.standard_normal(2)
    return posture(bones, (1.0, 0.3 * sideways), turn_rate, 1.0 + 0.1 * np.cos(t))


def angles(a, b):
    return np.linalg.norm(to_rotation_vector(multiply(a, conjugate(b))), axis=-1)


@settings(max_examples=12)
@given(st.integers(0, 500), st.sampled_from([0.0, 1.0]))
def test_at_either_end_it_is_one_of_the_motions(seed, weight):
    blend = PostureBlend(swinging(seed, 0.0), swinging(seed + 1, 0.0))
    for tick in range(1, 60):
        first, second = swinging(seed, tick * DT), swinging(seed + 1, tick * DT)
        shown = blend.advance(first, second, weight, DT)
    alone = second if weight else first
    assert angles(shown.rotation, alone.rotation).max() < 1e-9
    assert shown.velocity == pytest.approx(alone.velocity)
    assert float(shown.turn_rate) == pytest.approx(float(alone.turn_rate))
    assert float(shown.height) == pytest.approx(float(alone.height))


def test_halfway_a_bone_has_turned_half_the_angle_between():
    start = np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))
    turn = np.linspace(0.5, 2.5, 1 + BONES)[:, None] * normalise(
        np.random.default_rng(1).standard_normal((1 + BONES, 3))
    )
    first, second = posture(start), posture(from_rotation_vector(turn))
    shown = PostureBlend(first, second).advance(first, second, 0.5, DT)
    np.testing.assert_allclose(to_rotation_vector(shown.rotation), 0.5 * turn, atol=1e-9)


@pytest.mark.parametrize("weight", [0.2, 0.5, 0.8])
def test_bones_that_pass_half_a_turn_from_each_other_do_not_change_sides(weight):
    """Mixed as directions they would pass through zero; the short way round would jump."""
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))

    def second(t):
        return posture(from_rotation_vector(np.tile([0.0, np.pi - 0.3 + t, 0.0], (1 + BONES, 1))))

    blend, before = PostureBlend(posture(still), second(0.0)), None
    for t in np.arange(0.01, 0.6, 0.01):
        shown = blend.advance(posture(still), second(t), weight, DT).rotation
        if before is not None:
            assert angles(shown, before).max() == pytest.approx(weight * 0.01, abs=1e-6)
        before = shown


@pytest.mark.thorough
@pytest.mark.parametrize("weight", [-0.3, 0.1, 0.5, 0.8, 1.3])
def test_a_bone_that_keeps_turning_is_taken_the_short_way_round_without_a_jump(weight):
    """Once a turn it is turned back by 2 pi w; at once, that would be 2 pi w / DT here, rad/s."""
    still, rate = posture(np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))), 3.0

    def second(t):
        return posture(from_rotation_vector(np.tile([0.1, 0.5 + rate * t, 0.0], (1 + BONES, 1))))

    blend, before, speeds = PostureBlend(still, second(0.0)), None, []
    for t in DT * np.arange(1, 1000):
        shown = blend.advance(still, second(t), weight, DT).rotation
        if before is not None:
            speeds.append(to_rotation_vector(multiply(shown, conjugate(before))) / DT)
        before = shown
    speeds = np.array(speeds)
    assert np.linalg.norm(speeds, axis=-1).max() < abs(weight) * rate + 2.0 * np.pi
    assert np.linalg.norm(np.diff(speeds, axis=0), axis=-1).max() / DT < 40.0


def test_a_blend_is_settling_until_the_long_way_round_has_run_out():
    still, weight = posture(np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))), Ramp(0.0, 1.0, 1.0)
    blend, ticks, settled = PostureBlend(still, still), 0, 0
    while ticks < 600:
        ticks += 1
        second = posture(from_rotation_vector(np.tile([0.0, 4.0 * ticks * DT, 0.0], (1 + BONES, 1))))
        shown = blend.advance(still, second, weight.advance(DT), DT)
        if not weight.changing and not blend.settling:
            settled += 1
            assert angles(shown.rotation, second.rotation).max() < 1e-9
    assert settled > 200


def test_a_heading_that_flies_round_does_not_turn_the_body():
    """While a body stands on its hands its heading turns by half a turn within a few ticks."""
    rest = normalise(np.random.default_rng(4).standard_normal((1 + BONES, 4)))
    still, heading, largest, path = posture(rest), 0.0, 0.0, 0.0
    blend, before = PostureBlend(still, still), rest
    for tick in range(1, 200):
        turn_rate = 60.0 if 50 < tick <= 60 else 0.0  # by 3 rad
        heading += turn_rate * DT
        flying = posture(multiply(yaw(-heading), rest), turn_rate=turn_rate)
        shown = blend.advance(still, flying, 0.5, DT)
        path += float(shown.turn_rate) * DT
        world = multiply(yaw(path), shown.rotation)
        largest, before = max(largest, angles(world, before).max()), world
    assert largest < 0.05


def test_a_jump_of_twist_alone_does_not_move_a_bone():
    rest = np.tile([1.0, 0.0, 0.0], (BONES, 1))
    twist = from_rotation_vector(np.tile([np.pi, 0.0, 0.0], (1 + BONES, 1)))
    rng = np.random.default_rng(7)
    first, second = (from_rotation_vector(0.8 * rng.standard_normal((1 + BONES, 3))) for _ in range(2))
    blend = PostureBlend(posture(first), posture(second), rest)
    directions = [
        rotate(blend.advance(posture(first), posture(q), 0.4, DT).rotation[1:], rest)
        for q in (second, multiply(second, twist), second)
    ]
    np.testing.assert_allclose(directions[1], directions[0], atol=1e-6)
    np.testing.assert_allclose(directions[2], directions[0], atol=1e-6)


def test_the_smooth_heading_catches_up():
    heading = SmoothHeading(rate=0.0)
    heading.advance(100.0, 0.01)  # by 1 rad
    for _ in range(400):
        heading.advance(0.0, 0.01)
    assert abs(heading.offset) < 1e-3


def test_a_ramp_rises_smoothly_to_its_goal_and_stays():
    ramp = Ramp(0.2, 0.8, 0.5)
    values = [ramp.value, *(ramp.advance(0.01) for _ in range(60))]
    assert values[0] == 0.2
    assert values[25] == pytest.approx(0.5)
    assert values[-1] == 0.8
    assert not ramp.changing
    assert np.diff(values).min() >= 0.0
    assert max(abs(np.diff(values, n=2))) < 6.0 * 0.6 * 0.02**2


@pytest.mark.parametrize(("first", "second", "rounds"), [(1.0, 1.2, (1, 1)), (0.9, 2.7, (3, 1)), (4.0, 1.1, (1, 4))])
@pytest.mark.parametrize("weight", [0.0, 0.3, 1.0])
def test_loops_in_step_go_round_whole_numbers_of_times_together(first, second, rounds, weight):
    march = read_motions(synthetic.small_library())["march"]
    loops = [replace(march, seconds=seconds) for seconds in (first, second)]
    tempos = tempos_in_step(*loops, weight)
    lasts = [count * loop.seconds / tempo for count, loop, tempo in zip(rounds, loops, tempos, strict=True)]
    assert lasts[0] == pytest.approx(lasts[1])
    assert tempos[0] == pytest.approx(1.0) or weight > 0.0
    assert tempos[1] == pytest.approx(1.0) or weight < 1.0
    assert all(0.7 < tempo < 1.5 for tempo in tempos)
