"""The guard tick by tick: a deck whose targets come early, late, twice or not at all, and stops from all sides."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck.run.guard.guard import RigGuard
from motiondeck.run.guard.messages import States, Targets
from motiondeck_base.errors import MotiondeckError

JOINTS, T = 2, 0.01
VELOCITY, ACCELERATION, JERK = 4.7, 80.0, 4000.0
LIMITS = JointLimits(*(np.full(JOINTS, x) for x in (-2.0, 2.0, VELOCITY, ACCELERATION, JERK)))
SLOW = JointLimits(*(np.full(JOINTS, x) for x in (-2.0, 2.0, 1.5, 6.0, 300.0)))


class FakeRig:
    """Goes to each target at once, and remembers them with their times."""

    def __init__(self):
        self.goals = np.zeros(JOINTS)
        self.recoveries, self.busy = 0, 0.0
        self.sent = []
        self.broken = False

    def collect_state(self):
        return True

    def write(self, targets):
        if self.broken:
            raise MotiondeckError("knee does not answer")
        self.goals = targets.copy()
        self.sent.append(self.goals)


class Bench:
    """A guard, and a deck whose targets wave as fast as the limits let them."""

    def __init__(self, limits=LIMITS):
        self.rig, self.targets, self.now = FakeRig(), Targets(JOINTS), 10.0
        self.guard = RigGuard(self.rig, SafetyEnvelope(limits, T), self.targets, T, self.now)
        self.envelope = SafetyEnvelope(limits, T)
        self.envelope.start(np.zeros(JOINTS))
        self.time, self.stopped, self.braking, self.seen = 0.0, False, False, 0
        self.times, self.pulls_seen = [], 0

    @property
    def wave(self):
        return np.array([1.8 * math.sin(2.2 * self.time), 1.1 * (1.0 - math.cos(3.0 * self.time))])

    def deck_tick(self, targets=None, wait=T):
        """The deck sends targets after a time, s; until then the guard ticks when it is due."""
        self.pass_time(wait)
        self.time += T
        self.targets.set(self.now, self.stopped, self.braking, self.seen, self.pulls_seen)
        self.targets.joints[:] = self.envelope(self.wave if targets is None else targets)
        self.guard.receive(self.now)
        self.pass_time(0.0)

    def pass_time(self, seconds):
        end = self.now + seconds
        while self.guard.due <= end:
            self.now = max(self.now, self.guard.due)
            self.guard.tick(self.now)
            self.times.append(self.now)
        self.now = end

    def join(self):
        """Brings the deck's targets to where the guard holds, as the deck's loop does."""
        self.envelope.start(self.rig.goals)
        self.deck_tick(self.rig.goals.copy())

    def play(self, seconds=1.0):
        self.join()
        for _ in range(round(seconds / T)):
            self.deck_tick()

    @property
    def phase(self):
        return self.guard.stop.phase


def assert_safe(sent):
    sent = np.array(sent)
    for order, limit in ((1, VELOCITY), (2, ACCELERATION), (3, JERK)):
        assert np.abs(np.diff(sent, n=order, axis=0)).max(initial=0.0) <= limit * T**order * (1.0 + 1e-6)


def speed(sent):
    return np.abs(np.diff(np.array(sent), axis=0)).max(axis=1) / T


@pytest.fixture
def bench():
    bench = Bench()
    bench.play()
    assert bench.phase == "running"
    return bench


def test_fresh_targets_within_the_limits_go_through_unchanged(bench):
    deck = []
    for _ in range(200):
        bench.deck_tick()
        deck.append(bench.targets.joints.copy())
    bench.pass_time(0.1 * T)
    np.testing.assert_allclose(bench.rig.sent[-200:], deck, atol=1e-12)


def test_before_the_deck_comes_the_joints_are_held_and_the_servos_hear_it():
    bench = Bench()
    bench.pass_time(1.0)
    assert bench.phase == "held"
    assert 90 <= len(bench.rig.sent) <= 101
    assert not np.any(bench.rig.sent)


def test_targets_elsewhere_are_not_followed_until_they_are_where_the_joints_are_held():
    bench = Bench()
    for _ in range(50):
        bench.deck_tick(np.full(JOINTS, 0.5))
    assert bench.phase == "held"
    assert not np.any(bench.rig.sent)
    bench.play()
    assert bench.phase == "running"
    assert_safe(bench.rig.sent)


def test_a_deck_that_is_gone_stops_the_joints_and_the_stop_stands(bench):
    before = len(bench.rig.sent)
    bench.guard.lose_deck()
    bench.pass_time(1.0)
    assert bench.phase == "latched"
    assert_safe(bench.rig.sent)
    assert speed(bench.rig.sent)[before + 1] < speed(bench.rig.sent)[before - 2]
    assert np.array_equal(bench.rig.sent[-1], bench.rig.sent[-2])


def test_a_deck_that_is_late_by_less_than_two_ticks_is_not_braked(bench):
    for wait in (1.6 * T, 0.4 * T, T, 2.2 * T, T, T) * 20:
        bench.deck_tick(wait=wait)
        assert bench.phase == "running"
    assert_safe(bench.rig.sent)
    assert speed(bench.rig.sent)[100:].min() > 0.0, "the joints have stood still meanwhile"


def test_a_deck_that_is_gone_is_braked_within_the_limits_and_at_once(bench):
    fast = speed(bench.rig.sent[-3:]).max()
    assert fast > 2.0
    before = len(bench.rig.sent)
    bench.pass_time(1.0)
    assert bench.phase == "held"
    assert_safe(bench.rig.sent)
    moving = np.flatnonzero(speed(bench.rig.sent[before:]) > 1e-9)
    assert moving[-1] < 25, "a quarter of a second to come to rest"
    assert speed(bench.rig.sent[before:])[5] < fast


def test_a_deck_that_comes_back_before_rest_is_caught_up_with(bench):
    bench.pass_time(6 * T)
    assert bench.phase == "braking"
    bench.time += 6 * T
    for _ in range(200):
        bench.deck_tick()
    assert bench.phase == "running"
    assert_safe(bench.rig.sent)
    bench.pass_time(0.5 * T)
    np.testing.assert_allclose(bench.rig.sent[-1], bench.targets.joints, atol=1e-3)


@pytest.mark.parametrize(
    ("limits", "near", "missed", "ended"),
    [
        (LIMITS, 0.2, 0, False),
        (LIMITS, 0.2, 9, False),
        (LIMITS, 0.1, 7, True),
        (LIMITS, 0.2, 10, True),
        (SLOW, 0.15, 12, True),
        (SLOW, 0.3, 27, False),
    ],
)
def test_joints_that_were_held_up_come_to_the_last_targets_of_a_deck(limits, near, missed, ended):
    bench = Bench(limits)
    bench.play()
    end = np.array([0.2, 0.6])
    while np.abs(bench.envelope.position - end).max() > near:
        bench.deck_tick(end)
    for _ in range(missed):  # the deck is on time, and its targets do not come
        bench.pass_time(T)
        bench.envelope(end)
    while not bench.envelope.at_rest:
        bench.deck_tick(end)
    bench.deck_tick(end)
    assert np.abs(bench.rig.sent[-1] - end).max() > 2e-3
    if ended:
        bench.guard.end()
    bench.pass_time(1.0)
    assert bench.guard.at_rest
    assert bench.phase == "held"
    np.testing.assert_allclose(bench.rig.sent[-1], end, atol=2e-3)
    assert_safe(bench.rig.sent)


def test_a_deck_that_ends_in_motion_is_braked(bench):
    bench.guard.end()
    bench.pass_time(1.0)
    assert bench.guard.at_rest
    assert_safe(bench.rig.sent)


@pytest.mark.parametrize("behind", [0.0, 2.0, 3.0])
def test_joints_brake_with_the_deck_as_for_a_stop_and_stay_until_it_comes_there(behind):
    benches = Bench(), Bench()
    for bench in benches:
        bench.play()
        bench.pass_time(behind * T)  # the joints may have braked for a tick, and catch up since
        bench.deck_tick()
    braking, stopped = benches
    braking.braking = True
    stopped.stopped = True
    for bench in benches:
        bench.deck_tick()
        bench.braking = False
        for _ in range(60):
            bench.deck_tick()
    np.testing.assert_array_equal(braking.rig.sent, stopped.rig.sent)
    assert (braking.phase, stopped.phase) == ("held", "latched")
    braking.play()
    assert braking.phase == "running"
    assert_safe(braking.rig.sent)


def test_a_deck_that_comes_back_later_has_to_come_to_the_joints(bench):
    bench.pass_time(0.5)
    held = bench.rig.sent[-1]
    for _ in range(100):
        bench.deck_tick()
    assert bench.phase == "held"
    np.testing.assert_array_equal(bench.rig.sent[-1], held)
    bench.play()
    assert bench.phase == "running"
    assert_safe(bench.rig.sent)


def test_a_press_at_the_door_stops_a_rig_whose_deck_plays_on(bench):
    bench.guard.press(1)
    for _ in range(100):
        bench.deck_tick()
    assert bench.phase == "latched"
    assert_safe(bench.rig.sent)
    held = bench.rig.sent[-1]
    bench.join()
    assert bench.phase == "latched", "only a reset lets it go on"
    bench.seen = 1
    bench.deck_tick(held + 0.4)
    assert bench.phase == "held"
    np.testing.assert_array_equal(bench.rig.sent[-1], held)
    bench.play()
    assert bench.phase == "running"


def test_a_press_that_crosses_a_reset_stands(bench):
    bench.guard.press(2)
    bench.seen = 1
    bench.play()
    assert bench.phase == "latched"


def test_a_stop_at_the_deck_is_one_here_and_so_is_its_reset(bench):
    bench.stopped = True
    for _ in range(100):
        bench.deck_tick()
    assert bench.phase == "latched"
    bench.stopped = False
    bench.join()
    bench.join()
    assert bench.phase == "running"


def test_a_stopped_deck_that_dies_stays_stopped(bench):
    bench.stopped = True
    bench.deck_tick()
    bench.pass_time(1.0)
    assert bench.phase == "latched"
    assert_safe(bench.rig.sent)


class Wire:
    name, pulled, pulls = "the button", False, 0


def test_a_wired_stop_stops_and_no_reset_helps_while_it_is_pulled(bench):
    bench.guard.wired = wire = Wire()
    bench.deck_tick()
    wire.pulled, wire.pulls = True, 1
    for _ in range(100):
        bench.deck_tick()
    assert bench.phase == "latched"
    bench.pulls_seen = 1
    bench.deck_tick()
    assert bench.phase == "latched"
    wire.pulled = False
    bench.pass_time(T)
    bench.deck_tick()
    assert bench.phase == "held"


def test_old_targets_are_none(bench):
    """A guard that was not given the processor for a while finds targets that were sent before."""
    sent = bench.targets.sent
    bench.pass_time(0.5)
    bench.targets.values[0] = sent
    bench.targets.joints[:] = bench.rig.goals
    for _ in range(2):
        bench.guard.receive(bench.now)
        bench.pass_time(T)
    assert bench.phase == "held"


def test_a_joint_that_was_set_up_again_during_a_stop_stays_where_it_stands(bench):
    bench.guard.press(1)
    for _ in range(100):
        bench.deck_tick()
    bench.rig.goals = bench.rig.goals + 0.3
    sagged = bench.rig.goals.copy()
    bench.rig.recoveries += 1
    for _ in range(50):
        bench.deck_tick()
    np.testing.assert_array_equal(bench.rig.sent[-1], sagged)


def test_joints_that_were_set_up_again_begin_where_they_stand_and_the_deck_comes_there(bench):
    """The rig would have them catch up at a quarter of their speed limit at once, beyond their acceleration limit."""
    bench.rig.goals = bench.rig.goals - [0.0, 0.4]
    sagged, other = bench.rig.goals[1], bench.rig.sent[-1][0]
    bench.rig.recoveries += 1
    before = len(bench.rig.sent)
    for _ in range(60):
        bench.deck_tick()
    assert bench.phase == "held"
    sent = np.array(bench.rig.sent[before:])
    assert (sent[:, 1] == sagged).all()
    assert sent[-1, 0] != other, "the other joint was not stopped at once"
    assert_safe(np.array([bench.rig.sent[before - 2], bench.rig.sent[before - 1], *sent])[:, :1])
    bench.play()
    assert bench.phase == "running"
    assert_safe(bench.rig.sent[before:])


def test_a_rig_that_is_lost_says_why_and_is_not_written_to_again(bench):
    bench.rig.broken = True
    bench.deck_tick()
    assert bench.guard.failure == "knee does not answer"
    before = len(bench.rig.sent)
    bench.rig.broken = False
    bench.pass_time(0.5)
    bench.deck_tick()
    assert len(bench.rig.sent) == before


def test_goals_leave_on_time_whatever_the_jitter_of_the_targets(bench):
    rng = np.random.default_rng(4)
    at, asked = bench.now, []
    for _ in range(1500):
        at += T
        bench.deck_tick(wait=max(0.0, at + T * rng.uniform(0.0, 0.4) - bench.now))
        asked.append(bench.targets.joints.copy())
    between = np.diff(bench.times[-1000:]) / T
    assert between.min() > 0.9
    assert between.max() < 1.1
    assert_safe(bench.rig.sent)
    asked, sent = np.array(asked[-500:]), np.array(bench.rig.sent[-500:])
    as_asked = [np.abs(asked - goals).max(axis=1).min() < 1e-9 for goals in sent]
    assert np.mean(as_asked) > 0.9, "most ticks wait for their targets"


def test_punctual_targets_are_passed_on_within_a_twentieth_of_a_tick(bench):
    bench.deck_tick(wait=0.2 * T)  # the deck's ticks are earlier from now on
    waited = []
    for _ in range(600):
        bench.pass_time(0.7 * T)
        waited.append(bench.times[-1] - bench.targets.sent)
        bench.deck_tick(wait=0.3 * T)
    assert max(waited[:10]) > 0.4 * T
    assert min(waited[-100:]) >= 0.04 * T
    assert max(waited[-100:]) <= 0.06 * T


def test_a_guard_that_was_late_itself_does_not_make_up_for_it(bench):
    bench.guard.receive(bench.now)
    bench.now += 2.45 * T
    bench.guard.tick(bench.now)
    assert bench.guard.due >= bench.now + 0.7 * T


@pytest.mark.parametrize("lost", [1, 2])
def test_time_that_the_guard_has_lost_is_none_for_the_joints(bench, lost):
    for _ in range(20):
        bench.deck_tick()
    for _ in range(lost):  # the deck plays on, and the guard is not given the processor
        bench.now += T
        bench.time += T
        bench.envelope(bench.wave)
    bench.now = max(bench.now, bench.times[-1] + (lost + 1) * T)
    for _ in range(20):
        bench.deck_tick()
    assert bench.phase == "running"
    passed = T * np.rint(np.diff(np.array(bench.times[-40:])) / T)
    assert passed.max() == pytest.approx((lost + 1) * T)
    velocity = np.diff(np.array(bench.rig.sent[-40:]), axis=0) / passed[:, None]
    acceleration = np.diff(velocity, axis=0) / (0.5 * (passed[1:] + passed[:-1]))[:, None]
    assert np.abs(velocity).max() <= VELOCITY * (1.0 + 1e-6)
    assert np.abs(acceleration).max() <= ACCELERATION * (1.0 + 1e-6)


def test_joints_begin_at_rest_after_a_guard_that_was_gone_for_long(bench):
    bench.now += 0.2
    before = len(bench.rig.sent)
    for _ in range(30):
        bench.deck_tick()
    sent = [bench.rig.sent[before - 1]] * 3 + bench.rig.sent[before:]
    assert_safe(sent)


def test_targets_that_stop_coming_right_after_they_are_followed_move_nothing(bench):
    bench.pass_time(0.5)
    bench.rig.sent.clear()
    bench.join()
    bench.pass_time(0.7 * T)
    assert bench.phase == "running"
    bench.pass_time(1.0)
    assert not speed(bench.rig.sent).any()


def test_many_targets_at_once_move_the_joints_no_faster(bench):
    before, began = len(bench.rig.sent), bench.now
    for _ in range(100):
        bench.deck_tick(wait=0.1 * T)
    assert len(bench.rig.sent) - before <= (bench.now - began) / T + 3


def test_many_targets_at_once_do_not_fill_the_bus_of_joints_that_are_held(bench):
    bench.pass_time(0.5)
    before, began = len(bench.rig.sent), bench.now
    for _ in range(200):
        bench.deck_tick(np.full(JOINTS, 0.5), wait=0.05 * T)
    assert len(bench.rig.sent) - before <= 1.5 * (bench.now - began) / T + 2


EVENTS = st.one_of(
    st.tuples(st.just("play"), st.floats(0.02, 0.6)),
    st.tuples(st.just("late"), st.floats(0.1, 12.0)),
    st.tuples(st.just("jump"), st.floats(-3.0, 3.0)),
    st.sampled_from([("door",), ("stop",), ("reset",), ("join",), ("recover",), ("nonsense",)]),
)


@settings(max_examples=150)
@given(st.lists(EVENTS, min_size=3, max_size=14))
def test_whatever_comes_the_joints_keep_their_limits_and_stand_while_a_stop_stands(events):
    bench = Bench()
    bench.play(0.3)
    standing = False
    for event in events:
        before = len(bench.rig.sent)
        match event:
            case "play", seconds:
                for _ in range(round(seconds / T)):
                    bench.deck_tick()
            case "late", periods:
                bench.deck_tick(wait=periods * T)
            case "jump", angle:
                bench.deck_tick(np.full(JOINTS, angle))
            case ("door",):
                bench.guard.press(1)
                standing = True
            case ("stop",):
                bench.stopped = standing = True
                bench.deck_tick()
            case ("reset",):
                if bench.phase == "latched":
                    bench.stopped, bench.seen, standing = False, bench.guard.stop.presses.get("stop door", 0), False
                    bench.deck_tick()
            case ("join",):
                bench.join()
            case ("recover",):
                bench.rig.recoveries += 1
            case ("nonsense",):
                bench.deck_tick(np.array([np.nan, np.inf]))
        if standing:
            assert bench.phase in ("braking", "latched")
            if bench.phase == "latched" and len(bench.rig.sent) > before + 60:
                assert not speed(bench.rig.sent[before + 60 :]).any()
    assert_safe(bench.rig.sent)


def test_the_state_that_the_deck_gets(bench):
    states = States(JOINTS)
    bench.guard.wired = wire = Wire()
    wire.pulled, wire.pulls = True, 3
    bench.guard.press(2)
    for _ in range(100):
        bench.deck_tick()
    bench.rig.recoveries, bench.rig.busy = 4, 1.5
    bench.guard.report(states)
    assert (states.phase, states.presses, states.pulled) == ("latched", (2, 3), True)
    assert (states.recoveries, states.collected, states.busy) == (4, len(bench.rig.sent), 1.5)
    # What was collected in the last tick was measured in the one before.
    assert states.measured_at == pytest.approx(bench.now - T, abs=0.5 * T)
