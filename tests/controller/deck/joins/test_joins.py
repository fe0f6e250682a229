"""Joins of motions: no bone flips, whatever the way of joining and the phase, and the limits of a join hold."""

from typing import cast

import numpy as np
import pytest

from benchmarks.deck.joins import blend_over, cells_of, chain
from controller.deck.joins.deck_motions import read_motions
from controller.deck.joins.join_limits import JoinLimits
from controller.deck.joins.transition import extrapolated
from controller.deck.performance import JOININGS
from controller.deck.worst_join import MeasuredDeck, play_join
from controller.library.motion_library import load_library
from controller.motion.rotations import from_rotation_vector, multiply, normalise, to_rotation_vector, yaw
from controller.motion.skeleton import Pose, Posture, Skeleton
from motiondeck_base.shipped import shipped_configs


@pytest.fixture(scope="module")
def cmu86():
    return load_library(shipped_configs() / "libraries" / "cmu86.safetensors")


@pytest.fixture(scope="module")
def thesis15():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


@pytest.mark.parametrize("joining", [joining for joining in JOININGS if joining != "cut"])
@pytest.mark.parametrize("frame", [100, 109])
def test_from_kick_to_run_at_frame_109_no_shin_turns_over(cmu86, joining, frame):
    """Mixed as directions, a shin turned by 155 degrees in one tick there."""
    join = play_join(cmu86, "kick", "run", frame / 301, joining, direct=True)
    assert join.passes, join


@pytest.mark.thorough
@pytest.mark.parametrize("phase", [0.67, 0.71, 0.75])
def test_from_jump_to_punch_no_fist_is_thrown(cmu86, phase):
    """Mixed as directions, it reached eight times the speed of either motion."""
    join = play_join(cmu86, "jump", "punch", phase, None, direct=True)
    assert join.passes, join


@pytest.mark.parametrize(("source", "phase"), [("kick", 9 / 24), ("jump", 20 / 24)])
def test_into_box_the_module_is_replaced_before_the_limit_is_reached(cmu86, source, phase):
    """Replaced at the limit itself, a body that was slowed down still got beyond it: 1.54 and 1.51."""
    join = play_join(cmu86, source, "box", phase, None, direct=True)
    assert join.passes, join


def test_a_footfall_of_a_run_alone_is_within_the_limits(cmu86):
    """Compared with its stored frames at 120 Hz, it was accelerated 2.15 times as hard as by itself."""
    deck = MeasuredDeck(cmu86, "run", direct=True)
    deck.play(300)
    assert deck.peaks(["run"]) == pytest.approx((1.0, 1.0), abs=0.1)


def test_a_fade_is_found_before_the_body_has_swung_on(cmu86):
    """Of the fades looked at none kept to the plan, some to the limits; meanwhile the longest of them was played."""
    join = play_join(cmu86, "stroll", "box", 0.625, "inertialise", direct=True)
    assert join.passes, join
    assert join.seconds < 0.7


def test_a_join_that_was_replaced_is_given_time(thesis15):
    """Replaced in every tick in which it needed more than 0.9 of the limits, six times, it reached 1.53."""
    join = play_join(thesis15, "crawl", "waltz", 23 / 24, None, direct=True)
    assert join.passes, join


def test_switches_during_switches_stay_in_the_limits(cmu86):
    joins = chain(cmu86, None, 12, direct=True, seed=3)
    assert all(join.passes for join in joins), max(joins, key=lambda join: join.speed)


def test_the_grid_has_every_pair_at_every_phase(cmu86):
    cells = cells_of(cmu86, None, 24, direct=True)
    assert len(set(cells)) == len(cells) == 7 * 6 * 24


def test_a_blend_that_goes_over_into_the_other_motion_is_measured_to_its_end(cmu86):
    join = blend_over(cmu86, "walk", "stroll", 0.25, direct=True)
    assert (join.source, join.target) == ("walk", "stroll")
    assert join.seconds == pytest.approx(1.0, abs=0.02)


def test_a_weight_beyond_one_exaggerates_the_second_motion(cmu86):
    """Commanded the other way round, 1 minus the weight is that of the other motion."""
    run = MeasuredDeck(cmu86, "walk", 0.25, direct=False)
    join = run.until_settled(run.deck.blend_in("walk", "stroll", 1.3), "walk", 0.25)
    assert join.passes, join
    assert run.deck.blend == (("stroll", pytest.approx(1.3)),)
    record = run.deck.blend_in("stroll", "walk", -0.1)
    run.play(100)
    assert record.settled_s is not None
    assert run.deck.blend == (("stroll", pytest.approx(1.1)),)
    assert run.deck.fell_back == ""


BONES = 3


class Rod:
    """A skeleton whose only joint is a point one metre ahead of the root."""

    @staticmethod
    def joints(root_position, rotation):
        return np.asarray(root_position)[..., None, :] + np.array([[1.0, 0.0, 0.0]])


def at(x):
    return Pose(np.array([x, 0.0, 1.0]), np.array(0.0), np.tile([1.0, 0.0, 0.0, 0.0], (1 + BONES, 1)))


@pytest.fixture(scope="module")
def walk(cmu86):
    return read_motions(cmu86)["walk"]


def test_the_limits_of_a_join_are_one_and_a_half_speeds_and_two_accelerations(walk):
    dt = 0.005
    fast = 1.5 * walk.speed * dt
    steady = JoinLimits(cast(Skeleton, Rod()), at(-0.99 * fast), at(0.0))
    steady.begin(walk)
    assert steady.use(at(0.99 * fast), dt) == pytest.approx(0.99)
    assert steady.use(at(1.01 * fast), dt) == pytest.approx(1.01)
    hard = 2.0 * walk.acceleration * dt**2
    resting = JoinLimits(cast(Skeleton, Rod()), at(0.0), at(0.0))
    resting.begin(walk)
    assert resting.use(at(0.99 * hard), dt) == pytest.approx(0.99)
    assert resting.use(at(-1.01 * hard), dt) == pytest.approx(1.01)
    resting.accept(at(0.5 * hard))
    assert resting.use(at(2.0 * hard), dt) == pytest.approx(1.0)


@pytest.mark.parametrize("rate", [250.0, 400.0, 1000.0])
def test_the_limits_of_a_join_do_not_depend_on_the_rate(walk, rate):
    """A footfall changes the speed within a tick, whatever its length, and is no harder for more ticks a second."""

    def most(rate):
        places = np.where(np.arange(60) < 30, 0.0, (np.arange(60) - 30) / rate)  # from rest to 1 m/s
        limits = JoinLimits(cast(Skeleton, Rod()), at(0.0), at(0.0))
        limits.begin(walk)
        used = []
        for place in places:
            used.append(limits.use(at(place), 1.0 / rate))
            limits.accept(at(place))
        return max(used)

    assert most(rate) == pytest.approx(most(200.0), rel=0.01 if rate != 250.0 else 0.5)
    assert most(rate) <= 1.01 * most(200.0)


@pytest.mark.parametrize("tick", range(9))
def test_a_jump_in_the_first_ticks_counts_as_much_as_a_later_one(walk, tick):
    """At 1000 Hz the acceleration was looked at from the ninth tick on."""

    def most(tick):
        limits = JoinLimits(cast(Skeleton, Rod()), at(0.0), at(0.0))
        limits.begin(walk)
        used = []
        for place in [0.0] * tick + [0.01] * 12:
            used.append(limits.use(at(place), 0.001))
            limits.accept(at(place))
        return max(used)

    assert most(tick) == pytest.approx(most(20))
    assert most(tick) > 1.0


def test_a_join_is_limited_by_its_motions_and_by_those_of_the_join_it_interrupts(cmu86):
    """Kept for as long as joins overlapped, the limits of a box were those of a crawl four joins later."""
    motions = read_motions(cmu86)
    fast, slow = (choose(motions.values(), key=lambda motion: motion.speed) for choose in (max, min))
    limits = JoinLimits(cast(Skeleton, Rod()), at(0.0), at(0.0))
    limits.begin(fast, slow)
    fast_use = limits.use(at(0.01), 0.005)
    limits.begin(slow, slow)
    assert limits.use(at(0.01), 0.005) == fast_use
    limits.begin(slow, slow)
    assert limits.use(at(0.01), 0.005) > fast_use


def test_a_blend_that_becomes_too_fast_is_slowed_down(thesis15):
    """At an even pace of the weight it reached 1.74 times the speed of the faster motion."""
    join = blend_over(thesis15, "crawl", "sitting", 17 / 24, direct=True)
    assert join.passes, join
    assert 1.0 < join.seconds < 1.5


def test_what_turns_and_moves_steadily_is_extrapolated_exactly():
    rng, dt, spin, turn_rate = np.random.default_rng(3), 0.01, np.array([0.4, -3.0, 2.0]), 1.5
    rest = normalise(rng.standard_normal((1 + BONES, 4)))

    def body(t):
        in_the_world = multiply(from_rotation_vector(np.tile(spin * t, (1 + BONES, 1))), rest)
        straight_on = np.array([np.cos(-turn_rate * t), np.sin(-turn_rate * t)])  # in the world along x
        return Posture(
            np.array(1.0 + 0.2 * t), straight_on, np.array(turn_rate), multiply(yaw(-turn_rate * t), in_the_world)
        )

    found, expected = extrapolated(body(-dt), body(0.0), dt), body(dt)
    apart = to_rotation_vector(multiply(found.rotation, expected.rotation * [1, -1, -1, -1]))
    assert np.abs(apart).max() < 1e-9
    assert found.velocity == pytest.approx(expected.velocity)
    assert float(found.height) == pytest.approx(float(expected.height))
