"""Blending postures: both ends are exact, bones turn along the rotation between them, and none changes sides."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.joins.blend_weight import Ramps
from controller.deck.joins.deck_motions import read_motions, rounds_beside, tempos_in_step
from controller.deck.joins.posture_blend import PostureBlend, SmoothHeading
from controller.motion.quintic import rise
from controller.motion.rotations import (
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_rotation_vector,
    yaw,
)
from controller.motion.skeleton import Posture

BONES, DT = 4, 0.005
LONG = 0.015  # s of a tick where a test needs many


def blend_of(first, *others, rest=None):
    blend = PostureBlend(first, rest)
    for other in others:
        blend.add(other)
    return blend


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


@pytest.mark.thorough
@settings(max_examples=12)
@given(st.integers(0, 500), st.sampled_from([0.0, 1.0]))
def test_at_either_end_it_is_one_of_the_motions(seed, weight):
    blend = blend_of(swinging(seed, 0.0), swinging(seed + 1, 0.0))
    for tick in range(1, 60):
        first, second = swinging(seed, tick * DT), swinging(seed + 1, tick * DT)
        shown = blend.advance([first, second], (1.0 - weight, weight), DT)
    alone = second if weight else first
    assert angles(shown.rotation, alone.rotation).max() < 1e-9
    assert shown.velocity == pytest.approx(alone.velocity)
    assert float(shown.turn_rate) == pytest.approx(float(alone.turn_rate))
    assert float(shown.height) == pytest.approx(float(alone.height))


def spinning(seed, t):
    """A body whose bones turn on and on, each about an axis and at a rate of its own, up to 4 rad/s."""
    rng = np.random.default_rng(seed)
    start, axis = rng.standard_normal((2, 1 + BONES, 3))
    turned = rng.uniform(-4.0, 4.0, (1 + BONES, 1)) * t * normalise(axis)
    return posture(multiply(from_rotation_vector(turned), from_rotation_vector(start)))


def apart(first, second):
    """How far two postures are apart, the largest of what can differ."""
    return max(
        angles(first.rotation, second.rotation).max(),
        np.abs(first.velocity - second.velocity).max(),
        abs(float(first.turn_rate - second.turn_rate)),
        abs(float(first.height - second.height)),
    )


@settings(max_examples=6)
@given(st.integers(0, 500), st.sampled_from([swinging, spinning]), st.floats(0.0, 1.0), st.sampled_from([1, 2]))
def test_motions_without_weight_leave_a_blend_of_two_as_it_is(seed, body, share, idle):
    two = blend_of(*(body(seed + k, 0.0) for k in range(2)))
    more = blend_of(*(body(seed + k, 0.0) for k in (0, *range(2, 2 + idle), 1)))
    for tick in range(1, 90):
        now = [body(seed + k, tick * LONG) for k in range(2 + idle)]
        weight = share * min(1.0, tick / 30)
        alone = two.advance(now[:2], (1.0 - weight, weight), LONG)
        beside = more.advance([now[0], *now[2:], now[1]], (1.0 - weight, *[0.0] * idle, weight), LONG)
        assert apart(alone, beside) < 1e-9


@pytest.mark.thorough
@settings(max_examples=5)
@given(st.integers(0, 500), st.permutations(range(1, 4)), st.sampled_from([swinging, spinning]))
def test_the_order_in_which_motions_are_named_changes_nothing(seed, order, body):
    """Blends of two blends turned bones by 5 degrees."""
    order, rng = [0, *order], np.random.default_rng(seed)
    start, goal = np.eye(4)[0], rng.dirichlet(np.ones(4))
    one = blend_of(*(body(seed + k, 0.0) for k in range(4)))
    other = blend_of(*(body(seed + k, 0.0) for k in order))
    for tick in range(1, 90):
        now = [body(seed + k, tick * LONG) for k in range(4)]
        weights = start + min(1.0, tick / 30) * (goal - start)
        assert (
            apart(one.advance(now, weights, LONG), other.advance([now[k] for k in order], weights[order], LONG)) < 1e-6
        )


@settings(max_examples=12)
@given(st.integers(0, 500), st.floats(0.0, 1.0))
def test_two_motions_are_blended_along_the_rotation_between_them(seed, weight):
    first, second = swinging(seed, 0.0), swinging(seed + 1, 0.0)
    shown = blend_of(first, second).advance([first, second], (1.0 - weight, weight), 0.0)
    turn = to_rotation_vector(multiply(second.rotation, conjugate(first.rotation)))
    assert angles(shown.rotation, multiply(from_rotation_vector(weight * turn), first.rotation)).max() < 1e-9


def test_three_motions_lie_evenly_around_their_mean():
    """Turned about one axis they are numbers, and their mean is that of numbers."""
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))
    about = [
        posture(multiply(from_rotation_vector(np.tile([0.0, angle, 0.0], (1 + BONES, 1))), still))
        for angle in (0.2, 1.4, 2.3)
    ]
    shown = blend_of(*about).advance(about, (0.5, 0.2, 0.3), LONG)
    np.testing.assert_allclose(to_rotation_vector(shown.rotation)[:, 1], 0.5 * 0.2 + 0.2 * 1.4 + 0.3 * 2.3, atol=1e-9)


@settings(max_examples=5)
@given(st.integers(0, 500), st.sampled_from([0, 1, 2]))
def test_a_motion_without_weight_is_dropped_unnoticed(seed, dropped):
    """Blends of two blends made up a twist of half a turn within a few ticks: a third difference of 0.103 rad."""
    left = [k for k in range(3) if k != dropped]
    start, goal = np.full(3, 1.0 / 3.0), np.full(3, 0.5)
    goal[dropped] = 0.0
    kept, blend = (blend_of(*(spinning(seed + k, 0.0) for k in range(3))) for _ in range(2))
    shown = []
    for tick in range(1, 130):
        now = [spinning(seed + k, tick * LONG) for k in range(3)]
        share = rise(min(1.0, tick / 100))
        weights = (1.0 - share) * start + share * goal
        whole = kept.advance(now, weights, LONG)
        if tick == 101:
            blend.keep(left)
        if tick > 100:
            now, weights = [now[k] for k in left], weights[left]
        shown.append(blend.advance(now, weights, LONG).rotation)
        assert angles(shown[-1], whole.rotation).max() < 1e-9
    turns = to_rotation_vector(multiply(np.array(shown[1:]), conjugate(np.array(shown[:-1]))))
    assert np.linalg.norm(np.diff(turns, n=2, axis=0), axis=-1)[90:110].max() < 0.02


@pytest.mark.thorough
@pytest.mark.parametrize("motions", [2, 3, 4])
@pytest.mark.parametrize("seed", range(3))
def test_however_bones_turn_none_jumps(motions, seed):
    blend, weights = blend_of(*(spinning(seed + k, 0.0) for k in range(motions))), np.full(motions, 1.0 / motions)
    shown = []
    for tick in range(1, 250):
        shown.append(blend.advance([spinning(seed + k, tick * LONG) for k in range(motions)], weights, LONG).rotation)
    turns = to_rotation_vector(multiply(np.array(shown[1:]), conjugate(np.array(shown[:-1]))))
    assert np.linalg.norm(turns, axis=-1).max() / LONG < 4.0 + 2.0 * np.pi
    assert np.linalg.norm(np.diff(turns, axis=0), axis=-1).max() / LONG**2 < 40.0


def test_halfway_a_bone_has_turned_half_the_angle_between():
    start = np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))
    turn = np.linspace(0.5, 2.5, 1 + BONES)[:, None] * normalise(
        np.random.default_rng(1).standard_normal((1 + BONES, 3))
    )
    first, second = posture(start), posture(from_rotation_vector(turn))
    shown = blend_of(first, second).advance([first, second], (0.5, 0.5), DT)
    np.testing.assert_allclose(to_rotation_vector(shown.rotation), 0.5 * turn, atol=1e-9)


@pytest.mark.parametrize("weight", [0.2, 0.5, 0.8])
def test_bones_that_pass_half_a_turn_from_each_other_do_not_change_sides(weight):
    """Mixed as directions they would pass through zero; the short way round would jump."""
    still = np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))

    def second(t):
        return posture(from_rotation_vector(np.tile([0.0, np.pi - 0.3 + t, 0.0], (1 + BONES, 1))))

    blend, before = blend_of(posture(still), second(0.0)), None
    for t in np.arange(0.01, 0.6, 0.01):
        shown = blend.advance([posture(still), second(t)], (1.0 - weight, weight), DT).rotation
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

    blend, before, speeds = blend_of(still, second(0.0)), None, []
    for t in DT * np.arange(1, 1000):
        shown = blend.advance([still, second(t)], (1.0 - weight, weight), DT).rotation
        if before is not None:
            speeds.append(to_rotation_vector(multiply(shown, conjugate(before))) / DT)
        before = shown
    speeds = np.array(speeds)
    assert np.linalg.norm(speeds, axis=-1).max() < abs(weight) * rate + 2.0 * np.pi
    assert np.linalg.norm(np.diff(speeds, axis=0), axis=-1).max() / DT < 40.0


def test_a_blend_is_settling_until_the_long_way_round_has_run_out():
    still, weight = posture(np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1))), Ramps((1.0, 0.0), (0.0, 1.0), 1.0)
    blend, ticks, settled = blend_of(still, still), 0, 0
    while ticks < 600:
        ticks += 1
        second = posture(from_rotation_vector(np.tile([0.0, 4.0 * ticks * DT, 0.0], (1 + BONES, 1))))
        weights = weight.advance(DT)
        shown = blend.advance([still, second], weights, DT)
        if not weight.changing and not blend.settling:
            settled += 1
            assert angles(shown.rotation, second.rotation).max() < 1e-9
    assert settled > 200


@given(st.integers(1, 500), st.integers(50, 200), st.floats(-0.3, 1.3))
def test_weights_that_have_ceased_to_change_are_those_that_were_wanted(ticks, rate, goal):
    """What a weight falls short of 0 by, because of a sum of ticks, would keep its motion playing for ever."""
    weights = Ramps((1.0, 0.0), (1.0 - goal, goal), ticks / rate)
    while weights.changing:
        weights.advance(1.0 / rate)
    assert weights.values == (1.0 - goal, goal)


def test_a_heading_that_flies_round_does_not_turn_the_body():
    """While a body stands on its hands its heading turns by half a turn within a few ticks."""
    rest = normalise(np.random.default_rng(4).standard_normal((1 + BONES, 4)))
    still, heading, largest, path = posture(rest), 0.0, 0.0, 0.0
    blend, before = blend_of(still, still), rest
    for tick in range(1, 200):
        turn_rate = 60.0 if 50 < tick <= 60 else 0.0  # by 3 rad
        heading += turn_rate * DT
        flying = posture(multiply(yaw(-heading), rest), turn_rate=turn_rate)
        shown = blend.advance([still, flying], (0.5, 0.5), DT)
        path += float(shown.turn_rate) * DT
        world = multiply(yaw(path), shown.rotation)
        largest, before = max(largest, angles(world, before).max()), world
    assert largest < 0.05


def test_a_jump_of_twist_alone_does_not_move_a_bone():
    rest = np.tile([1.0, 0.0, 0.0], (BONES, 1))
    twist = from_rotation_vector(np.tile([np.pi, 0.0, 0.0], (1 + BONES, 1)))
    rng = np.random.default_rng(7)
    first, second = (from_rotation_vector(0.8 * rng.standard_normal((1 + BONES, 3))) for _ in range(2))
    blend = blend_of(posture(first), posture(second), rest=rest)
    directions = [
        rotate(blend.advance([posture(first), posture(q)], (0.6, 0.4), DT).rotation[1:], rest)
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
    ramp = Ramps((0.8, 0.2), (0.2, 0.8), 0.5)
    values = [ramp.values[1], *(ramp.advance(0.01)[1] for _ in range(60))]
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
    beside = rounds_beside(*loops)
    tempos = tempos_in_step((first, second * beside), (1.0 - weight, weight))
    assert beside == pytest.approx(rounds[1] / rounds[0])
    lasts = [count * loop.seconds / tempo for count, loop, tempo in zip(rounds, loops, tempos, strict=True)]
    assert lasts[0] == pytest.approx(lasts[1])
    assert tempos[0] == pytest.approx(1.0) or weight > 0.0
    assert tempos[1] == pytest.approx(1.0) or weight < 1.0
    assert all(0.7 < tempo < 1.5 for tempo in tempos)
