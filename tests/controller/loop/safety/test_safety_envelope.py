import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import LimitError, SafetyEnvelope

DT = 0.005


def limits(joints=1, *, lower=-2.0, upper=2.0, velocity=6.0, acceleration=60.0, jerk=2000.0):
    return JointLimits(*(np.full(joints, x) for x in (lower, upper, velocity, acceleration, jerk)))


def assert_inside(emitted, limit, dt):
    """All four limits, by differences of what was emitted from rest; the allowance is the rounding of positions."""
    positions = np.vstack([emitted[:1]] * 3 + [emitted])
    rounding = 1e-15 * (1.0 + np.abs(positions).max())
    assert np.isfinite(positions).all()
    assert (positions >= limit.lower).all()
    assert (positions <= limit.upper).all()
    differences = positions
    for order, most in enumerate((limit.velocity, limit.acceleration, limit.jerk), start=1):
        differences = np.diff(differences, axis=0)
        assert (np.abs(differences) / dt**order <= most + 2.0**order * rounding / dt**order).all(), f"order {order}"


@st.composite
def limit_sets(draw):
    """Limits of 3 joints, from sensible to absurd."""

    def power(low, high):
        return np.array([10.0 ** draw(st.floats(low, high)) for _ in range(3)])

    lower = np.array([draw(st.floats(-3.0, 1.0)) for _ in range(3)])
    return JointLimits(lower, lower + power(-3.0, 0.8), power(-1.0, 1.5), power(-0.5, 3.0), power(0.0, 5.0))


@st.composite
def target_sequences(draw):
    """Targets (T, 3) of one kind: wild, noisy, wandering, stepping, waving; some of them no numbers."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    ticks = 150
    kind = draw(st.sampled_from(["noise", "walk", "steps", "waves", "mixture"]))
    time = np.arange(ticks)[:, None] * DT
    scale = 10.0 ** draw(st.floats(-2.0, 1.0))
    sequence = {
        "noise": lambda: rng.normal(0.0, scale, (ticks, 3)),
        "walk": lambda: np.cumsum(rng.normal(0.0, 0.05 * scale, (ticks, 3)), axis=0),
        "steps": lambda: np.repeat(rng.normal(0.0, scale, (ticks // 10, 3)), 10, axis=0),
        "waves": lambda: scale * np.sin(time * rng.uniform(0.5, 40.0, 3)),
        "mixture": lambda: np.where(
            rng.random((ticks, 3)) < 0.05, rng.normal(0.0, 3.0, (ticks, 3)), np.sin(5.0 * time)
        ),
    }[kind]()
    spoilt = rng.random((ticks, 3)) < draw(st.sampled_from([0.0, 0.0, 0.1]))
    return np.where(spoilt, rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e300], (ticks, 3)), sequence)


@settings(max_examples=80, deadline=None)
@given(limit_sets(), target_sequences(), st.sampled_from([0.001, 0.005, 0.02]), st.floats(0.0, 1.0), st.booleans())
def test_whatever_is_asked_what_is_emitted_obeys_all_four_limits(limit, targets, dt, share, near):
    envelope = SafetyEnvelope(limit, dt)
    start = np.clip(limit.lower + share * (limit.upper - limit.lower), limit.lower, limit.upper)
    envelope.start(start)
    with np.errstate(all="raise", under="ignore"):
        emitted = [start, *(envelope(target, near).copy() for target in targets)]
        emitted += [envelope.brake().copy() for _ in range(50)]
    assert_inside(np.array(emitted), limit, dt)


@settings(deadline=None)
@given(
    st.floats(0.1, 1.0), st.floats(0.3, 1.0), st.sampled_from([1.0, -1.0]), st.floats(200.0, 20_000.0), st.booleans()
)
def test_a_target_that_gains_speed_is_let_go_in_time(hard, smooth, way, jerk, goes_on):
    """Its own acceleration and jerk are allowed, and it passes until the velocity limit: to let go takes ticks."""
    limit = limits(lower=-1e3, upper=1e3, jerk=jerk)
    rise = np.minimum(smooth * jerk * DT * np.arange(1, 400), hard * limit.acceleration[0])
    speed = np.cumsum(rise * DT)
    targets = way * np.cumsum(speed * DT)
    if not goes_on:
        targets[speed > limit.velocity[0]] = np.nan
    envelope = SafetyEnvelope(limit, DT)
    envelope.start(np.zeros(1))
    emitted = [np.zeros(1), *(envelope(np.array([target])).copy() for target in targets)]
    assert_inside(np.array(emitted), limit, DT)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-2.5, 2.5), min_size=1, max_size=3), st.integers(0, 2**32 - 1))
def test_a_target_that_rests_is_reached_and_then_held_exactly(goals, seed):
    envelope = SafetyEnvelope(limits(len(goals)), DT)
    envelope.start(np.zeros(len(goals)))
    rng = np.random.default_rng(seed)
    for _ in range(60):
        envelope(rng.normal(0.0, 1.0, len(goals)))
    goal = np.array(goals)
    for _ in range(350):
        emitted = envelope(goal)
    assert np.allclose(emitted, np.clip(goal, -2.0, 2.0), atol=1e-9)
    assert envelope.at_rest


def waving(ticks, *, amplitude=0.8, omega=4.0):
    """A smooth motion from rest, well within the limits."""
    time = np.arange(ticks) * DT
    return (amplitude * (1.0 - np.cos(omega * time)) * (1.0 - np.exp(-(time**2))))[:, None]


def test_a_motion_within_the_limits_passes_unchanged():
    envelope = SafetyEnvelope(limits(), DT)
    envelope.start(np.zeros(1))
    targets = waving(2000)
    emitted = np.array([envelope(target).copy() for target in targets])
    assert np.array_equal(emitted, targets)
    assert envelope.changed.tolist() == [0]


@pytest.mark.parametrize(("order", "name"), [(1, "velocity"), (2, "acceleration"), (3, "jerk")])
def test_a_smooth_motion_that_exceeds_a_single_limit_is_held_to_it(order, name):
    targets = waving(800)
    peak = np.abs(np.diff(targets, n=order, axis=0)).max() / DT**order
    limit = limits(lower=-1e4, upper=1e4, **({"velocity": 20.0, "acceleration": 1e3, "jerk": 1e5} | {name: 0.8 * peak}))
    envelope = SafetyEnvelope(limit, DT)
    envelope.start(np.zeros(1))
    emitted = np.array([[0.0], *(envelope(target).copy() for target in targets)])
    assert_inside(emitted, limit, DT)
    assert np.abs(np.diff(emitted, n=order, axis=0)).max() / DT**order > 0.75 * peak
    assert envelope.changed[0] > 0


def test_a_motion_that_is_out_of_reach_at_first_is_caught_up_with_and_then_followed_exactly():
    envelope = SafetyEnvelope(limits(), DT)
    envelope.start(np.array([-1.5]))
    targets = 0.3 + waving(600)[200:]
    emitted = np.array([envelope(target).copy() for target in targets])
    assert np.array_equal(emitted[120:], targets[120:])
    assert np.abs(emitted[:20] - targets[:20]).min() > 0.5
    assert 0 < envelope.changed[0] <= 120


def test_a_step_is_taken_without_overshooting():
    envelope = SafetyEnvelope(limits(), DT)
    envelope.start(np.zeros(1))
    emitted = np.array([envelope(np.ones(1))[0] for _ in range(100)])
    assert emitted.max() < 1.0 + 1e-4
    assert np.abs(emitted[70:] - 1.0).max() < 1e-3
    assert emitted[-1] == pytest.approx(1.0, abs=1e-9)


def test_a_joint_holds_while_its_target_is_no_number_and_others_go_on():
    envelope = SafetyEnvelope(limits(2), DT)
    envelope.start(np.array([0.5, 0.0]))
    targets = waving(100)[:, 0]
    for target in targets:
        emitted = envelope(np.array([np.nan, target]))
    assert emitted.tolist() == [0.5, targets[-1]]
    assert envelope.changed.tolist() == [100, 0]


def test_a_joint_that_starts_outside_its_limits_is_led_back_without_a_jump():
    envelope = SafetyEnvelope(limits(), DT)
    envelope.start(np.array([2.3]))
    emitted = [2.3] + [float(envelope(np.zeros(1))[0]) for _ in range(300)]
    assert max(emitted) == 2.3
    assert np.diff(emitted).max() < 1e-4
    assert np.abs(np.diff(emitted, n=2)).max() <= 60.0 * DT**2
    assert emitted[-1] == 0.0


def test_braking_comes_to_rest_and_the_place_is_held():
    envelope = SafetyEnvelope(limits(), DT)
    envelope.start(np.zeros(1))
    for target in waving(180):
        envelope(target)
    ticks = 0
    while not envelope.at_rest:
        emitted = envelope.brake().copy()
        ticks += 1
        assert ticks < 100
    assert ticks > 0
    assert envelope(np.array([np.nan])).tolist() == emitted.tolist()


def test_a_joint_without_room_does_not_move():
    limit = limits(lower=0.3, upper=0.3)
    envelope = SafetyEnvelope(limit, DT)
    assert {float(envelope(np.array([x]))[0]) for x in (-1.0, 0.3, 5.0, np.nan)} == {0.3}


def test_what_is_emitted_cannot_be_written_into():
    emitted = SafetyEnvelope(limits(), DT)(np.zeros(1))
    with pytest.raises(ValueError, match="read-only"):
        emitted[0] = 3.0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"lower": 3.0}, "joint 0: positions from 3.0 to 2.0"),
        ({"upper": np.inf}, "joint 0: positions"),
        ({"velocity": 0.0}, "joint 0: a velocity limit of 0.0"),
        ({"acceleration": -1.0}, "acceleration"),
        ({"jerk": np.nan}, "jerk"),
    ],
)
def test_impossible_limits_are_refused_by_name(wrong, said):
    with pytest.raises(LimitError, match=said):
        SafetyEnvelope(limits(2, **wrong), DT)


def test_a_joint_may_be_as_slow_as_its_limits_say():
    envelope = SafetyEnvelope(limits(velocity=0.01, acceleration=0.02, jerk=0.05), 0.005)
    envelope.start(np.zeros(1))
    emitted = np.array([envelope(np.array([1.0])).copy() for _ in range(1000)])
    assert 0.0 < np.diff(emitted[:, 0]).max() <= 0.01 * 0.005 + 1e-12


def test_limits_of_different_lengths_are_refused():
    one, two = limits(1), limits(2)
    with pytest.raises(LimitError, match="each of the 2 joints"):
        SafetyEnvelope(JointLimits(two.lower, two.upper, one.velocity, two.acceleration, two.jerk), DT)


def test_a_start_that_is_no_number_is_refused_by_name():
    with pytest.raises(LimitError, match="joint 1: the position to start from is nan"):
        SafetyEnvelope(limits(2), DT).start(np.array([0.0, np.nan]))


def test_a_target_that_jumps_past_the_range_and_back_is_answered():
    """It made the search look for ever between two numbers that have none between them."""
    limit = limits(lower=-1.65, upper=0.5, velocity=4.8, acceleration=80.0, jerk=4000.0)
    envelope = SafetyEnvelope(limit, DT)
    targets = np.full(100, -0.12)
    targets[39:52] = [0.34, *[0.8] * 11, 0.34]
    envelope.start(targets[:1])
    assert_inside(np.array([envelope(targets[[k]]).copy() for k in range(100)]), limit, DT)


@pytest.mark.parametrize("dip_hz", [3.0, 7.0, 11.0])
def test_targets_that_graze_the_end_of_the_range_break_no_limit(dip_hz):
    """The joint must stop at the end again and again, and only a part of what it would do still lets it."""
    limit = limits()
    envelope = SafetyEnvelope(limit, DT)
    time = DT * np.arange(200)
    targets = 2.0 - 0.02 * np.abs(np.sin(2.0 * np.pi * dip_hz * time))
    envelope.start(targets[:1])
    assert_inside(np.array([targets[:1], *(envelope(target[None]).copy() for target in targets)]), limit, DT)
