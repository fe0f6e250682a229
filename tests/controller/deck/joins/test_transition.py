from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.joins import fade_search
from controller.deck.joins.deck_motions import course_of
from controller.deck.joins.fade_search import LONGEST, PLANNED_SHARE, SHORTEST, FadeSearch, peaks
from controller.deck.joins.join_limits import Bounds
from controller.deck.joins.transition import Fade, difference, displaced, entry_costs, extrapolated
from controller.motion.rotations import (
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_rotation_vector,
    yaw,
)
from controller.motion.skeleton import ROOT, Posture, Skeleton

BONES = 5
REST = np.tile([1.0, 0.0, 0.0], (BONES - 1, 1))  # all but the first, which is the root
NAMES = tuple(f"bone {bone}" for bone in range(BONES - 1))
# Bones of 30 cm that all hang from the root.
BODY = Skeleton("body", NAMES, np.full(BONES - 1, ROOT), REST, np.full(BONES - 1, 0.3))


def smooth_posture(seed, t):
    """A made-up body whose bones swing smoothly in time."""
    rng = np.random.default_rng(seed)
    axis, size = rng.standard_normal((BONES, 3)), rng.uniform(0.2, 1.0, (BONES, 1))
    offset, phase = rng.standard_normal((BONES, 3)), rng.uniform(0, 6, (BONES, 1))
    turn = multiply(from_rotation_vector(offset), from_rotation_vector(size * np.sin(3 * t + phase) * normalise(axis)))
    drift = rng.standard_normal(4) + 0.1 * np.sin(2 * t + rng.uniform(0, 6, 4))
    return Posture(np.array(drift[0]), drift[1:3], np.array(drift[3]), turn)


def limbs(rotation):
    """Where the ends of the bones are."""
    return BODY.joints(np.zeros((*rotation.shape[:-2], 3)), rotation)


def staying(posture):
    """What comes after a posture in which nothing moves."""
    return following(lambda _: posture)


def following(body):
    """What comes after a posture, of the posture at each time."""
    return lambda times: course_of(series([body(t) for t in times]), BODY)


def found(shown, target, dt, ahead, bounds, rest_direction=None):
    """The fade from what is shown to a target."""
    search = FadeSearch(lambda: difference(shown, target, dt, rest_direction), ahead, BODY.chain, bounds)
    fade = search.advance(10.0)
    assert search.found
    return fade


def fade_with(duration, slowing, turn, turn_rate, drift, drift_rate):
    """A fade of turns (BONES, 3) and a drift (3,)."""
    return Fade(duration, slowing, np.vstack([turn, drift]), np.vstack([turn_rate, drift_rate]))


def seen(fade, target, t, turned=0.0):
    """What a fade shows after some seconds."""
    return displaced(target, fade.left(t), turned)


def series(postures):
    """Postures one after the other as one."""
    return Posture(*(np.array([getattr(one, name) for one in postures]) for name in FIELDS))


FIELDS = ("height", "velocity", "turn_rate", "rotation")


def angle_between(a, b):
    return np.linalg.norm(to_rotation_vector(multiply(a.rotation, b.rotation * [1, -1, -1, -1])), axis=-1).max()


def fade_of(seed, bound, dt=0.005, rest_direction=None):
    shown = smooth_posture(seed, -dt), smooth_posture(seed, 0.0)
    target = smooth_posture(seed + 1, 1.0 - dt), smooth_posture(seed + 1, 1.0)

    ahead = following(lambda t: smooth_posture(seed + 1, 1.0 + t))
    fade = found(shown, target, dt, ahead, Bounds(np.inf, bound), rest_direction)
    return fade, shown, seed + 1


@settings(max_examples=25)
@given(st.integers(0, 200), st.floats(5.0, 500.0))
def test_it_starts_where_the_body_is_and_ends_on_the_target(seed, bound):
    fade, shown, other = fade_of(seed, bound)
    start = seen(fade, smooth_posture(other, 1.0), 0.0, 0.0)
    assert angle_between(start, shown[1]) < 1e-6
    assert start.height == pytest.approx(shown[1].height)
    end = smooth_posture(other, 1.0 + fade.duration)
    assert angle_between(seen(fade, end, fade.duration, 0.0), end) < 1e-9


@pytest.mark.parametrize("rest_direction", [None, REST])
@settings(max_examples=25)
@given(seed=st.integers(0, 200))
def test_velocity_in_the_world_is_continuous_at_the_switch(rest_direction, seed):
    dt = 1e-4
    fade, shown, other = fade_of(seed, 50.0, dt, rest_direction)
    target = smooth_posture(other, 1.0 + dt)
    after = seen(fade, target, dt, float(target.turn_rate) * dt)
    before = multiply(yaw(-float(shown[1].turn_rate) * dt), shown[0].rotation)
    before_step = to_rotation_vector(multiply(shown[1].rotation, conjugate(before))) / dt
    then = multiply(yaw(float(after.turn_rate) * dt), after.rotation)
    after_step = to_rotation_vector(multiply(then, conjugate(shown[1].rotation))) / dt
    assert np.abs(after_step - before_step).max() < 0.15


def accelerations(fade, target, dt=2.5e-3):
    """Of the joints, m/s^2, while a difference to a target at rest fades."""
    places = []
    for t in np.arange(0.0, fade.duration + 3 * dt, dt):
        shown = seen(fade, target, t, 0.0)
        places.append(limbs(shown.rotation) + np.array([0.0, 0.0, float(shown.height)]))
    return np.linalg.norm(np.diff(places, n=2, axis=0), axis=-1) / dt**2


@settings(max_examples=20)
@given(st.integers(0, 200), st.floats(20.0, 500.0))
def test_no_joint_is_accelerated_beyond_the_bound(seed, bound):
    rng = np.random.default_rng(seed)
    dt, still = 1e-3, Posture(np.array(1.0), np.zeros(2), np.array(0.0), normalise(rng.standard_normal((BONES, 4))))
    turned = normalise(rng.standard_normal((BONES, 4)))  # any two rotations: some are nearly half a turn apart
    rate = rng.uniform(0.0, 12.0) * normalise(rng.standard_normal((BONES, 3)))
    before = replace(still, rotation=multiply(from_rotation_vector(-dt * rate), turned))
    shown = before, replace(still, height=np.array(1.0 + rng.uniform(-0.5, 0.5)), rotation=turned)
    shown = replace(before, height=shown[1].height), shown[1]
    fade = found(shown, (still, still), dt, staying(still), Bounds(np.inf, bound))
    assert SHORTEST <= fade.duration <= LONGEST
    if peaks(fade, staying(still), BODY.chain)[1] <= PLANNED_SHARE * bound:  # else no fade is within the bound
        assert accelerations(fade, still).max() <= bound


def test_a_target_that_turns_takes_longer():
    """Centripetal and Coriolis: what is turned away from a bone that turns itself is accelerated by both."""
    dt, bound = 1e-3, 40.0
    turned = from_rotation_vector(np.tile([0.0, 1.5, 0.0], (BONES, 1)))
    target = Posture(np.array(1.0), np.zeros(2), np.array(0.0), np.tile([1.0, 0.0, 0.0, 0.0], (BONES, 1)))
    shown = replace(target, rotation=turned)
    spin = np.tile([0.0, 0.0, 8.0], (BONES, 1))
    before = [replace(p, rotation=multiply(from_rotation_vector(-dt * spin), p.rotation)) for p in (shown, target)]

    turning = following(lambda t: replace(target, rotation=from_rotation_vector(t * spin)))
    bounds = Bounds(np.inf, bound)
    fade = found((before[0], shown), (before[1], target), dt, turning, bounds)
    assert fade.duration > found((shown, shown), (target, target), dt, staying(target), bounds).duration


@pytest.mark.thorough
@settings(max_examples=20)
@given(st.integers(0, 200), st.floats(2.0, 8.0))
def test_no_joint_gets_faster_than_the_bound(seed, bound):
    rng = np.random.default_rng(seed)
    still = replace(STILL, rotation=normalise(rng.standard_normal((BONES, 4))))
    shown = replace(STILL, height=np.array(1.3), rotation=normalise(rng.standard_normal((BONES, 4))))
    fade = found((shown, shown), (still, still), 0.005, staying(still), Bounds(bound, np.inf))
    dt, places = 2.5e-3, []
    for t in np.arange(0.0, fade.duration + dt, dt):
        body = seen(fade, still, t, 0.0)
        places.append(limbs(body.rotation) + np.array([0.0, 0.0, float(body.height)]))
    assert fade.duration < LONGEST
    assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() / dt <= bound


@pytest.mark.parametrize("sooner", [True, False])
def test_what_moves_against_each_other_is_slowed_down_before_it_swings_too_far(sooner, monkeypatch):
    """A body sinks while its bones turn up. Slowed down as long as the fade, both swing on, and come back too fast."""
    if not sooner:
        monkeypatch.setattr(fade_search, "_SLOWED_WITHIN", (1.0,))
    dt, swing, bound = 1e-3, np.array([0.0, 9.0, 0.0]), 4.0

    def body(t):
        turn = np.tile(np.array([0.0, -2.0, 0.0]) + t * swing, (BONES, 1))
        return replace(STILL, height=np.array(1.8 - 2.7 * t), rotation=from_rotation_vector(turn))

    fade = found((body(-dt), body(0.0)), (STILL, STILL), dt, staying(STILL), Bounds(bound, 300.0))
    shown = series([seen(fade, STILL, t, 0.0) for t in np.arange(0.0, fade.duration, 2.5e-3)])
    places = limbs(shown.rotation) + shown.height[:, None, None] * np.array([0.0, 0.0, 1.0])
    fastest = np.linalg.norm(np.diff(places, axis=0), axis=-1).max() / 2.5e-3
    assert (fade.slowing < fade.duration) is sooner
    assert bool(fastest <= bound) is sooner


def test_a_larger_bound_makes_a_shorter_fade():
    lengths = [fade_of(3, bound)[0].duration for bound in (5.0, 20.0, 80.0)]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] > lengths[2]


def test_a_heading_that_flies_round_under_a_body_at_rest_does_not_move_it():
    """The heading is that of the hips: it may turn by any angle while the body hardly moves."""
    dt, spin = 0.005, 12.0
    rest = normalise(np.random.default_rng(4).standard_normal((BONES, 4)))

    def body(t):
        return Posture(np.array(1.0), np.zeros(2), np.array(spin), multiply(yaw(-spin * t), rest))

    still = Posture(np.array(1.0), np.zeros(2), np.array(0.0), from_rotation_vector(np.full((BONES, 3), 0.3)))
    fade = found((body(-dt), body(0.0)), (still, still), dt, staying(still), Bounds(np.inf, 50.0))
    assert np.abs(fade.rate[:BONES]).max() < 1e-6
    # And the other way round: what is left of the difference stays where it was in the world.
    fade = found((still, still), (body(-dt), body(0.0)), dt, following(body), Bounds(np.inf, 50.0))
    half = 0.5 * fade.duration
    shown = seen(fade, body(half), half, spin * half)
    left = multiply(multiply(yaw(spin * half), shown.rotation), conjugate(rest))
    assert to_rotation_vector(left) == pytest.approx(0.5 * fade.value[:BONES], abs=1e-6)


def test_a_difference_near_half_a_turn_does_not_spin_round():
    dt = 0.005
    half = [from_rotation_vector(np.tile([np.pi + e, 0.0, 0.0], (BONES, 1))) for e in (-0.01, 0.01)]
    shown = tuple(replace(STILL, rotation=h) for h in half)
    fade = found(shown, (STILL, STILL), dt, staying(STILL), Bounds(np.inf, 50.0))
    assert np.linalg.norm(fade.rate[:BONES], axis=1) == pytest.approx(0.02 / dt, rel=0.01)


def test_the_anchor_that_moves_the_same_way_is_chosen():
    places = np.array([[0.0], [0.0], [1.0]])
    velocities = np.array([[-1.0], [1.0], [1.0]])
    assert entry_costs(np.array([0.05]), np.array([0.9]), places, velocities, reach=0.1).argmin() == 1


def quintic(duration, value, slope):
    """The polynomial with this value and slope at 0 and none at the end, without curvature at either."""
    rows = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0]]
    rows += [[duration**k for k in range(6)], [k * duration ** max(k - 1, 0) for k in range(6)]]
    rows += [[k * (k - 1) * duration ** max(k - 2, 0) for k in range(6)]]
    return np.polynomial.Polynomial(np.linalg.solve(np.array(rows, float), [value, slope, 0, 0, 0, 0]))


STILL = Posture(np.array(1.0), np.zeros(2), np.array(0.0), np.tile([1.0, 0.0, 0.0, 0.0], (BONES, 1)))


@given(st.integers(0, 200), st.floats(SHORTEST, LONGEST), st.floats(0.0, 1.0), st.sampled_from([1.0, 0.5, 0.25]))
def test_what_is_left_runs_out_along_a_quintic_that_stays_fixed_in_the_world(seed, duration, share, sooner):
    rng = np.random.default_rng(seed)
    turn, turn_rate = 0.5 * rng.standard_normal((2, BONES, 3))
    drift, drift_rate = rng.standard_normal((2, 3))
    slowing = sooner * duration
    fade = fade_with(duration, slowing, turn, turn_rate, drift, drift_rate)
    t, turned = share * duration, float(rng.uniform(-3.0, 3.0))
    shown = seen(fade, STILL, t, turned)
    back = yaw(-turned)

    def left(value, slope):
        rates = [quintic(slowing, 0.0, rate)(min(t, slowing)) for rate in slope]
        return np.array([quintic(duration, place, 0.0)(t) for place in value]) + np.array(rates)

    for bone in range(BONES):
        found = to_rotation_vector(shown.rotation[bone])
        assert found == pytest.approx(rotate(back, left(turn[bone], turn_rate[bone])), abs=1e-6)
    height, *velocity = left(drift, drift_rate)
    assert float(shown.height) == pytest.approx(1.0 + height, abs=1e-9)
    assert shown.velocity == pytest.approx(rotate(back, np.array([*velocity, 0.0]))[:2], abs=1e-9)


def twisted(posture, angle):
    """The same posture, its bones (not the root) twisted about themselves."""
    about = np.concatenate([np.zeros((1, 3)), angle * REST])
    return replace(posture, rotation=multiply(posture.rotation, from_rotation_vector(about)))


@pytest.mark.parametrize("seed", range(6))
def test_bones_that_twist_about_themselves_by_a_rule_are_not_thrown_by_it(seed):
    """Forearms moved at 26 rad/s, their twist at 34; held in one rate, it led hands to 1.7 times the allowed speed."""
    dt = 0.005
    before, now, still = smooth_posture(seed, -dt), smooth_posture(seed, 0.0), smooth_posture(seed + 1, 1.0)

    def found_with(twist):
        shown = twisted(before, -twist * dt), now
        return found(shown, (still, still), dt, staying(still), Bounds(np.inf, 200.0), REST)

    quiet, twisting = found_with(0.0), found_with(40.0)
    assert twisting.duration == pytest.approx(quiet.duration)
    for t in (0.05, 0.1, 0.15):
        places = [limbs(seen(fade, still, t, 0.0).rotation) for fade in (quiet, twisting)]
        assert places[1] == pytest.approx(places[0], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_bone_that_is_carried_on_goes_straight_whatever_its_twist(seed):
    dt = 0.005
    before, now = smooth_posture(seed, -dt), smooth_posture(seed, 0.0)
    onward = extrapolated(twisted(before, 0.2), now, dt, REST)
    was, here, then = (limbs(posture.rotation)[1:] for posture in (before, now, onward))
    turn = rotate(yaw(float(now.turn_rate) * dt), then) - here  # seen from the heading of now
    earlier = here - rotate(yaw(-float(now.turn_rate) * dt), was)
    assert np.linalg.norm(turn, axis=-1) == pytest.approx(np.linalg.norm(earlier, axis=-1), abs=1e-9)
    assert (
        np.linalg.norm(turn - earlier, axis=-1).max() < 0.3 * (np.linalg.norm(earlier, axis=-1) / 0.3).max() ** 2 * 1.1
    )


@pytest.mark.parametrize("seed", range(8))
def test_the_peaks_that_are_foreseen_are_those_of_the_fade_itself(seed):
    """Seen finely in the world, over a target that walks on, rises, turns round and turns its bones."""
    rng = np.random.default_rng(seed)
    turns, drifts = rng.standard_normal((2, BONES, 3)) * 0.7, rng.standard_normal((2, 3))
    fade = fade_with(0.7, 0.7 if seed % 4 else 0.35, *turns, *drifts)
    spin = np.tile([0.0, 0.0, 0.0 if seed % 2 else 4.0], (BONES, 1))
    turn_rate = 0.0 if seed % 3 else 2.0

    def body(t):
        velocity = np.array([1.0, 0.3])
        return Posture(np.array(1.0 + 0.2 * t), velocity, np.array(turn_rate), from_rotation_vector(t * spin))

    speeds, foreseen = peaks(fade, following(body), BODY.chain)
    dt, root = 5e-3, np.zeros((2, 2))
    places = []
    for t in np.arange(0.0, fade.duration + dt, dt):
        heading, both = yaw(turn_rate * t), []
        for which, posture in enumerate((seen(fade, body(t), t, turn_rate * t), body(t))):
            root[which] += dt * rotate(heading, np.append(posture.velocity, 0.0))[:2]
            both.append(rotate(heading, limbs(posture.rotation)) + np.append(root[which], posture.height))
        places.append(both)
    shown, alone = np.moveaxis(places, 1, 0)
    acceleration = np.diff(shown - alone, n=2, axis=0) / dt**2
    assert foreseen == pytest.approx(np.linalg.norm(acceleration, axis=-1).max(), rel=0.1)
    assert speeds.max() == pytest.approx(np.linalg.norm(np.diff(shown, axis=0), axis=-1).max() / dt, rel=0.1)


def test_a_fade_is_neither_shorter_than_the_shortest_nor_longer_than_the_longest():
    soft = Bounds(np.inf, 50.0)
    assert found((STILL, STILL), (STILL, STILL), 0.005, staying(STILL), soft).duration == SHORTEST
    far = replace(STILL, rotation=from_rotation_vector(np.full((BONES, 3), 1.5)))
    hard = Bounds(np.inf, 0.1)
    assert found((far, far), (STILL, STILL), 0.005, staying(STILL), hard).duration == LONGEST


def test_what_moves_away_fast_is_not_given_longer_than_helps():
    """A bone that turns at 12 rad/s away from its goal goes the farther the longer the fade; no fade is in bounds."""
    dt, away = 0.005, np.tile([0.0, 0.0, 12.0], (BONES, 1))
    start = np.tile([0.0, 0.0, 1.5], (BONES, 1))
    shown = [replace(STILL, rotation=from_rotation_vector(start + t * away)) for t in (-dt, 0.0)]
    fade = found(tuple(shown), (STILL, STILL), dt, staying(STILL), Bounds(0.1, 0.1))
    reached = {}
    for duration in (fade.duration, LONGEST):
        speeds, acceleration = peaks(replace(fade, duration=duration), staying(STILL), BODY.chain)
        reached[duration] = max(acceleration / 0.08, (speeds.max() / max(0.08, speeds[0])) ** 2)
    assert reached[fade.duration] <= reached[LONGEST]


def test_how_much_velocity_counts_against_place_is_the_reach():
    place, velocity = np.zeros(2), np.array([1.0, 0.0])
    places, velocities = np.array([[0.0, 0.0], [0.2, 0.0]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    assert entry_costs(place, velocity, places, velocities, reach=0.19).argmin() == 0
    assert entry_costs(place, velocity, places, velocities, reach=0.21).argmin() == 1
