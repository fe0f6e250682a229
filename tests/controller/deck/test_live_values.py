"""Live values: joints follow them within their limits, and fall back to what the deck plays when they cease."""

from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.deck.layers import Layers
from controller.deck.live_values import LiveValues, Share
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import to_rotation_vector
from motiondeck_base.errors import MotiondeckError, UnknownNameError

DT = 0.01
JOINTS = ("pan", "jaw", "left_lid", "right_lid")
GROUPS = {"lids": np.array([2, 3])} | {name: np.array([index]) for index, name in enumerate(JOINTS)}
LOWER, UPPER = np.array([-1.0, -0.1, -0.2, -0.2]), np.array([1.0, 0.6, 0.8, 0.8])
FASTEST = np.array([5.0, 12.0, 12.0, 12.0])
LIMITS = JointLimits(LOWER, UPPER, FASTEST, np.array([80.0, 400.0, 400.0, 400.0]), np.array([4e3, 2e4, 2e4, 2e4]))
GAZE = {"pan": (0.6, 0.1)}


def played(ticks):
    """What the deck plays, shape (ticks, J), rad, at most 3 rad/s fast."""
    t = DT * np.arange(ticks)[:, None]
    return 0.5 * (UPPER + LOWER) + 0.3 * (UPPER - LOWER) * np.sin([4.0, 9.0, 5.0, 5.0] * t + [0.0, 1.0, 2.0, 3.0])


def live_values(refused=MappingProxyType({})):
    return LiveValues(JOINTS, LIMITS, GROUPS, GAZE, refused)


def follow(live, beneath, happening, still=()):
    """Targets (ticks, J) over those beneath; `happening` is what to call in a tick."""
    targets = []
    for tick, row in enumerate(beneath):
        for call in happening.get(tick, ()):
            call()
        targets.append(live(row, DT, still=tick in still) if live.joints else row)
    return np.array(targets)


@given(st.floats(0.5, 1.0), st.integers(1, 6), st.floats(1e-10, 1e-8))
def test_a_share_that_gives_way_stands_still_after_as_many_ticks_as_it_moved(apart, ticks, growth):
    """Steps up and down differ by rounding, or as little as distances do meanwhile; others wait until it stands."""
    share = Share(goal=1.0, speed=2.0, acceleration=20.0)
    for tick in range(2 * ticks):
        share.approach(apart * (1.0 + growth * tick), DT, may_change=tick < ticks)
        assert share.pace != 0.0 or tick == 2 * ticks - 1
    assert share.pace == 0.0


SIGNALS = st.tuples(
    st.integers(0, 70),  # ticks after the one before
    st.sampled_from(["jaw", "pan", "lids", "left_lid", "off", "gaze"]),
    st.floats(-1.0, 1.0),
    st.sampled_from([0.05, 0.5, 1.0]),
    st.booleans(),  # whether a pause begins or ends
)


@settings(max_examples=30, deadline=None)
@given(st.lists(SIGNALS, min_size=1, max_size=25))
def test_any_stream_keeps_to_the_limits_and_leaves_nothing_on_other_joints_or_afterwards(stream):
    live, happening, tick, touched, still = live_values(), {}, 0, set(), set()
    paused = False
    for gap, name, value, seconds, toggles in stream:
        still |= set(range(tick, tick + gap)) if paused else set()
        tick += gap
        paused ^= toggles
        calls = happening.setdefault(tick, [])
        if name == "off":
            calls.append(live.end)
        elif name == "gaze":
            calls.append(lambda value=value, seconds=seconds: live.gaze(value, 0.5 * value, 1.0, seconds))
            touched.add(0)
        else:
            calls.append(lambda name=name, value=value, seconds=seconds: live.set(name, value, seconds))
            touched |= set(GROUPS[name].tolist())
    beneath = played(tick + 500)
    targets = follow(live, beneath, happening, still)
    others = np.setdiff1d(np.arange(len(JOINTS)), sorted(touched))
    assert np.array_equal(targets[:, others], beneath[:, others])
    assert (targets >= LOWER - 1e-9).all()
    assert (targets <= UPPER + 1e-9).all()
    speed = np.abs(np.diff(targets, axis=0)) / DT
    assert (speed <= 1.41 * FASTEST).all()
    assert np.array_equal(targets[-100:], beneath[-100:])
    assert live.joints == {}  # it costs nothing any more
    envelope = SafetyEnvelope(LIMITS, DT)
    envelope.start(beneath[0])
    safe = np.array([envelope(row).copy() for row in targets])
    rates = [np.abs(np.diff(safe, n=order, axis=0)).max(0) / DT**order for order in (1, 2)]
    assert (rates[0] <= FASTEST * (1 + 1e-6)).all()
    assert (rates[1] <= LIMITS.acceleration * (1 + 1e-6)).all()


def test_a_joint_sets_out_as_fast_as_it_moves_and_lags_20_ms_behind_values():
    live, beneath = live_values(), played(200)
    happening = {20: [lambda: live.set("jaw", float(beneath[21, 1] / 0.6), 0.5)]}  # where it is when it sets out
    jaw = follow(live, beneath, happening)[:, 1]
    assert 0.3 < (jaw[22] - jaw[21]) / (jaw[21] - jaw[20]) < 0.6
    live = live_values()
    ramp = 0.4 * np.arange(200) * DT  # of the jaw's upper half a second
    happening = {tick: [lambda tick=tick: live.set("jaw", float(ramp[tick]), 0.5)] for tick in range(20, 200)}
    jaw = follow(live, beneath, happening)[:, 1]
    lag = (0.6 * ramp[100:] - jaw[100:]) / (0.6 * 0.4)
    assert lag == pytest.approx(0.020, abs=0.001)


def test_1_is_the_upper_limit_minus_1_the_lower_and_0_the_angle_0():
    for value, angle in ((1.0, 0.6), (-1.0, -0.1), (0.0, 0.0), (0.4, 0.24)):
        live = live_values()
        live.set("jaw", value, 5.0)
        assert follow(live, played(100), {})[-1, 1] == pytest.approx(angle, abs=1e-6)
    bent = JointLimits(LOWER + 0.3, UPPER, FASTEST, LIMITS.acceleration, LIMITS.jerk)  # 0 is out of the jaw's reach
    live = LiveValues(JOINTS, bent, GROUPS, {}, {})
    live.set("jaw", 0.0, 5.0)
    assert follow(live, played(100), {})[-1, 1] == pytest.approx(0.2, abs=1e-6)


def test_a_joint_falls_back_half_a_second_after_the_last_value_and_a_new_one_turns_it_back():
    live, beneath = live_values(), np.zeros((400, len(JOINTS)))
    jaw = follow(live, beneath, {0: [lambda: live.set("jaw", 1.0, 0.5)]})[:, 1]
    assert jaw[30:48] == pytest.approx(0.6, abs=0.001)
    assert (np.diff(jaw[55:]) <= 1e-12).all()
    assert jaw[80] < 0.5
    assert not jaw[150:].any()
    happening = {tick: [lambda: live.set("jaw", 1.0, 0.5)] for tick in (0, 70)}
    jaw = follow(live, beneath, happening)[:, 1]
    assert 0.05 < jaw[70] < 0.55
    assert jaw[90] == pytest.approx(0.6, abs=0.02)
    where = float(jaw[69] / 0.6)
    jaw = follow(live, beneath, {0: happening[0], 70: [lambda: live.set("jaw", where, 0.5)]})[:, 1]
    assert 0.3 < (jaw[70] - jaw[69]) / (jaw[69] - jaw[68]) < 0.6  # without a jump of its speed


def test_a_pause_holds_joints_where_they_are_and_keeps_their_time():
    live, beneath = live_values(), np.zeros((300, len(JOINTS)))
    still = range(3, 200)
    jaw = follow(live, beneath, {0: [lambda: live.set("jaw", 1.0, 0.5)]}, still)[:, 1]
    assert 0.05 < jaw[30] < 0.5
    assert np.ptp(jaw[30:200]) < 1e-4
    assert jaw[230] == pytest.approx(0.6, abs=0.001)


def test_a_gaze_turns_each_joint_by_its_part_of_the_angle_and_stays_in_its_range():
    live = live_values()
    live.gaze(1.0, 0.0, 1.0, 5.0)
    assert follow(live, played(100), {})[-1, 0] == pytest.approx(0.6 * np.pi / 4, abs=1e-6)
    live.gaze(0.0, 1.0, 1.0, 5.0)
    assert follow(live, played(100), {})[-1, 0] == pytest.approx(0.1 * np.pi / 4, abs=1e-6)
    narrow = JointLimits(LOWER, np.full(4, 0.05), FASTEST, LIMITS.acceleration, LIMITS.jerk)
    live = LiveValues(JOINTS, narrow, GROUPS, GAZE, {})
    live.gaze(5.0, 0.0, 1.0, 5.0)
    assert follow(live, played(100), {})[-1, 0] == pytest.approx(0.05, abs=1e-6)


def test_what_cannot_be_followed_is_refused():
    with pytest.raises(MotiondeckError, match="jaw goes from -1"):
        live_values().set("jaw", 1.5, 0.5)
    with pytest.raises(MotiondeckError, match="on its own feet"):
        live_values({"jaw": "it stands on its own feet"}).set("jaw", 0.5, 0.5)
    assert live_values({"jaw": "it stands on its own feet"}).set("pan", 0.5, 0.5)
    with pytest.raises(MotiondeckError, match="name them in the rig file"):
        LiveValues(JOINTS, LIMITS, GROUPS, {}, {}).gaze(0.0, 0.0, 1.0, 0.5)


def test_a_deck_with_a_stream_says_so_once_and_plays_the_rest_bit_for_bit():
    library = synthetic.small_phase_library()
    bones = [1 + [name for name, *_ in synthetic.BODY].index(bone) for bone in ("rleg", "lleg", "rarm", "larm")]

    def twin():
        return lambda pose: to_rotation_vector(pose.rotation[bones])[:, :2].sum(1)

    deck, plain = (Deck(library, twin(), "march") for _ in range(2))
    deck.layers = Layers(library, JOINTS, LIMITS, {"lids": JOINTS[2:]}, twin)
    with pytest.raises(UnknownNameError, match=r"unknown input or group 'jwa'.*Did you mean jaw"):
        deck.set_input("jwa", 0.4)
    with pytest.raises(MotiondeckError, match="there are no layers here"):
        plain.gaze(0.0, 0.0)
    for tick in range(200):
        if tick % 2 == 0 and tick < 100:
            deck.set_input("jaw", 0.5 + 0.4 * np.sin(0.3 * tick))
        targets, alone = deck.update(DT)[0], plain.update(DT)[0]
        assert np.array_equal(np.delete(targets, 1), np.delete(alone, 1))
        assert tick != 50 or deck.layered == {"jaw": "live"}
        assert tick != 50 or abs(targets[1] - alone[1]) > 0.01
    assert [event.text for event in deck.events if event.kind == "layer"] == ["jaw: live"]
    for _ in range(100):
        targets, alone = deck.update(DT)[0], plain.update(DT)[0]
    assert np.array_equal(targets, alone)
    assert deck.layered == {}
    deck.set_input("lids", 1.0, 60.0)
    play_on = [deck.update(DT) for _ in range(20)]
    assert deck.layered == {"left_lid": "live", "right_lid": "live"}
    deck.set_input("off", 0.0)
    play_on += [deck.update(DT) for _ in range(200)]
    assert deck.layered == {}
