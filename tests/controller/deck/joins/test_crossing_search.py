"""How long a crossing takes: looked at as it will be played; bones go the way that is shorter on the whole."""

from dataclasses import replace

import numpy as np
import pytest

from controller.deck.joins.blend_weight import CrossingSearch, crossed
from controller.deck.joins.fade_search import LONGEST, SHORTEST, TRIAL_EVERY
from controller.deck.joins.join_limits import Bounds
from controller.deck.joins.posture_blend import PostureBlend
from controller.motion.quintic import rise
from controller.motion.rotations import from_rotation_vector, multiply, normalise
from controller.motion.skeleton import ROOT, Posture, Skeleton, walk_path

BONES = 3
BODY = Skeleton("body", ("a", "b", "c"), np.array([ROOT, 0, 1]), np.tile([1.0, 0.0, 0.0], (3, 1)), np.full(3, 0.4))
UP = np.array([0.0, 0.0, 1.0])


def series(postures):
    """Postures one after the other as one."""
    fields = ("height", "velocity", "turn_rate", "rotation")
    return Posture(*(np.array([getattr(one, name) for one in postures]) for name in fields))


def walking(seed, t):
    """A body that walks, turns, and swings its bones smoothly."""
    rng = np.random.default_rng(seed)
    offset, axis = rng.standard_normal((2, 1 + BONES, 3))
    bones = multiply(from_rotation_vector(offset), from_rotation_vector(0.7 * np.sin(3.0 * t) * normalise(axis)))
    turn_rate, sideways = rng.standard_normal(2)
    return Posture(np.array(1.0 + 0.1 * np.cos(t)), np.array([1.0, sideways]), np.array(turn_rate + np.sin(t)), bones)


def turned(angle):
    """A body whose first bone is turned about the vertical."""
    turns = np.zeros((1 + BONES, 3))
    turns[1] = angle * UP
    return Posture(np.array(1.0), np.zeros(2), np.array(0.0), from_rotation_vector(turns))


def search_of(first, second, speed=10.0, acceleration=1e4):
    """The search for a crossing of two motions, given as functions of the time from the first trial on."""

    def ahead(times):
        return series([first(t) for t in times]), series([second(t) for t in times])

    return CrossingSearch(ahead, BODY, Bounds(speed, acceleration))


def finished(search):
    search.advance(10.0)
    assert search.found
    return search


@pytest.mark.parametrize("seed", range(5))
def test_it_is_looked_at_as_the_blend_will_play_it(seed):
    step, moments = 0.01, 60
    share = np.arange(moments) / (moments - 1)
    first, second = (series([walking(one, step * moment) for moment in range(moments)]) for one in (seed, 90 + seed))
    found, sides = crossed(first, second, rise(share), step)
    blend = PostureBlend(walking(seed, 0.0))
    blend.add(walking(90 + seed, 0.0))
    blend.hold_sides(sides)
    played = [walking(seed, 0.0)]
    for moment in range(1, moments):
        weight = float(rise(share[moment]))
        now = [walking(one, step * moment) for one in (seed, 90 + seed)]
        played.append(blend.advance(now, (1.0 - weight, weight), step))
    looked, shown = (walk_path(one, step) for one in (found, series(played)))
    places = [BODY.joints(pose.root_position, pose.rotation) for pose in (looked, shown)]
    assert np.abs(places[0] - places[1]).max() < 0.01


def test_a_bone_goes_the_way_that_is_shorter_on_the_whole():
    """Half a turn and a little ahead when it begins, in the middle it is less than that behind."""
    ahead = finished(search_of(lambda _: turned(0.0), lambda t: turned(3.3 - 20.0 * t), speed=9.0))
    seconds = ahead.seconds
    assert seconds is not None
    blend = PostureBlend(turned(0.0))
    blend.add(turned(3.3))
    blend.hold_sides(ahead.sides)
    middle = turned(3.3 - 10.0 * seconds)
    shown = blend.advance([turned(0.0), middle], (0.5, 0.5), seconds / 2.0)
    angle = 2.0 * np.arctan2(shown.rotation[1, 3], shown.rotation[1, 0])
    assert angle % (2.0 * np.pi) == pytest.approx((3.3 - 10.0 * seconds) / 2.0 % (2.0 * np.pi), abs=1e-6)


def test_held_sides_stay_though_a_bone_gets_more_than_half_a_turn_ahead():
    angles = np.linspace(2.0, 4.5, 50)
    blend = PostureBlend(turned(0.0))
    blend.add(turned(2.0))
    blend.hold_sides(np.stack([turned(0.0).rotation, turned(2.0).rotation]))
    shown = [blend.advance([turned(0.0), turned(angle)], (0.9, 0.1), 0.01).rotation[1] for angle in angles]
    turns = 2.0 * np.arctan2([one[3] for one in shown], [one[0] for one in shown])
    assert turns == pytest.approx(0.1 * angles, abs=1e-6)
    assert not blend.settling


def test_holding_sides_changes_nothing_that_is_shown():
    first, second = walking(1, 0.0), walking(2, 0.0)
    blends = [PostureBlend(first), PostureBlend(first)]
    for blend in blends:
        blend.add(second)
    blends[0].hold_sides(np.stack([-first.rotation, second.rotation]))
    shown = [blend.advance([walking(1, 0.01), walking(2, 0.01)], (1.0, 0.0), 0.01).rotation for blend in blends]
    assert shown[0] == pytest.approx(shown[1], abs=1e-12)


def test_what_is_farther_apart_takes_longer_and_the_bounds_hold():
    lengths = []
    for apart in (0.5, 1.5, 2.8):
        search = finished(search_of(lambda _: turned(0.0), lambda _, apart=apart: turned(apart), 2.0, 20.0))
        seconds = search.seconds
        assert seconds is not None
        lengths.append(seconds)
        times = np.arange(0.0, seconds, 0.002)
        angle = apart * rise(times / seconds)
        ends = 0.4 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        moved = np.diff(ends, axis=0) / 0.002
        assert np.linalg.norm(moved, axis=1).max() <= 2.0
        assert np.linalg.norm(np.diff(moved, axis=0), axis=1).max() / 0.002 <= 1.1 * 20.0
    assert SHORTEST <= lengths[0] < lengths[1] < lengths[2] < LONGEST


def test_where_no_time_is_long_enough_there_is_none():
    search = finished(search_of(lambda _: turned(0.0), lambda t: turned(30.0 * t)))
    assert search.seconds is None


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_looks_are_spread_over_time_whatever_the_rate(rate):
    trials = []

    def second(t):
        if t == 0.0:
            trials.append(t)
        return turned(2.8)

    search = search_of(lambda _: turned(0.0), second, 2.0, 20.0)
    ticks = 0
    while not search.found:
        search.advance(1.0 / rate)
        ticks += 1
    assert len(trials) >= 2
    assert abs(ticks / rate - len(trials) * TRIAL_EVERY) <= 1.001 / rate


def test_it_is_found_in_spite_of_a_body_that_moves_along():
    def going(posture):
        return replace(posture, velocity=np.array([3.0, 0.0]))

    search = finished(search_of(lambda _: going(turned(0.0)), lambda _: going(turned(0.2)), 4.0, 60.0))
    assert search.seconds == SHORTEST
