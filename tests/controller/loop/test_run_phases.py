import math
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.run_phases import Source, safe_targets
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.loop.stop_state import EmergencyStopError, StopState
from controller.motion.skeleton import Pose

JOINTS, DT = 3, 0.005
POSE = Pose(np.zeros(3), np.array(0.0), np.array([[1.0, 0.0, 0.0, 0.0]]))
LIMITS = JointLimits(*(np.full(JOINTS, x) for x in (-2.0, 2.0, 6.0, 60.0, 2000.0)))
REST = np.array([0.5, -0.5, 1.9])


class Wild:
    """A deck that waves, jumps, leaves the limits and says nonsense, as its seed has it."""

    def __init__(self, seed, fault_after=math.inf):
        self.rng = np.random.default_rng(seed)
        self.tick, self.fault_after = 0, fault_after
        self.centre = np.zeros(JOINTS)

    def update(self, dt):
        self.tick += 1
        if self.tick > self.fault_after:
            raise RuntimeError("no idea")
        if self.rng.random() < 0.02:
            self.centre = self.rng.uniform(-3.0, 3.0, JOINTS)
        targets = self.centre + np.sin(np.arange(1, JOINTS + 1) * self.tick * dt * 3.0)
        if self.rng.random() < 0.02:
            targets[self.rng.integers(JOINTS)] = self.rng.choice([np.nan, np.inf, -1e9])
        return targets, POSE


class Run:
    """A course that is stepped by hand; `written` is all it gave."""

    def __init__(self, deck, rest=REST, seconds=math.inf, channels=()):
        self.stop = StopRequest()
        self.envelope = SafetyEnvelope(LIMITS, DT)
        self.steps = safe_targets(Source(deck, DT), channels, self.envelope, self.stop, seconds, rest)
        self.written = []

    def tick(self, count=1):
        for _ in range(count):
            targets = next(self.steps, None)
            if targets is None:
                return False
            self.written.append(targets.copy())
        return True

    def finish(self):
        while self.tick():
            assert len(self.written) < 20_000, "it never ends"

    def settle(self):
        """Ticks until the joints stand still."""
        for _ in range(2000):
            self.tick()
            if self.envelope.at_rest:
                return
        raise AssertionError("the joints never come to rest")


def assert_safe(written):
    written = np.array(written)
    assert np.isfinite(written).all()
    assert (written >= LIMITS.lower).all()
    assert (written <= LIMITS.upper).all()
    for order, limit in ((1, 6.0), (2, 60.0), (3, 2000.0)):
        assert np.abs(np.diff(written, n=order, axis=0)).max(initial=0.0) <= limit * DT**order * (1.0 + 1e-6)


def carry_out(stop, command):
    try:
        {
            "emergency stop": lambda: stop.state.press("command"),
            "reset": stop.state.reset,
            "home": stop.go_home,
            "play": stop.play,
        }[command]()
    except EmergencyStopError:
        assert stop.emergency or command == "reset"


COMMANDS = st.lists(
    st.tuples(st.integers(0, 150), st.sampled_from(["emergency stop", "reset", "home", "play"])), min_size=1, max_size=8
)


@settings(max_examples=20)
@given(st.integers(0, 1000), COMMANDS, st.booleans())
def test_whatever_is_commanded_every_target_is_safe_and_the_run_ends(seed, commands, failing):
    run = Run(Wild(seed, 150 if failing else math.inf))
    for ticks, command in commands:
        run.tick(ticks)
        carry_out(run.stop, command)
    run.tick(20)
    run.stop.ask("enough")
    run.finish()
    assert_safe(run.written)
    assert np.array_equal(run.written[-1], run.written[-2]) or len(run.written) < 3


@settings(max_examples=20)
@given(st.integers(0, 1000), COMMANDS, st.integers(0, 100), st.integers(1001, 2000))
def test_the_emergency_stop_wins_within_one_tick(seed, commands, ticks, other_seed):
    """From its very tick on nothing that the deck says matters, and the joints brake as hard as they may."""
    runs = []
    for deck_changes in (False, True):
        deck = Wild(seed)
        run = Run(deck)
        for count, command in commands:
            run.tick(count)
            carry_out(run.stop, command)
        run.tick(ticks + 1)
        run.stop.state.press("command")
        if deck_changes:
            deck.rng = np.random.default_rng(other_seed)
        begin = len(run.written)
        expected = deepcopy(run.envelope)
        expected.brake()
        run.tick(1)
        assert np.array_equal(run.written[-1], expected.position)
        run.settle()
        place = run.written[-1]
        for command in ("play", "home"):
            carry_out(run.stop, command)
        run.tick(50)
        assert np.array_equal(run.written[-1], place)
        assert_safe(run.written)
        runs.append(run.written[begin:])
    assert np.array_equal(*runs)


@settings(max_examples=20)
@given(st.integers(0, 1000), st.integers(1, 300))
def test_a_reset_is_refused_until_the_joints_are_at_rest(seed, ticks):
    run = Run(Wild(seed))
    run.tick(ticks)
    run.stop.state.press("command")
    run.tick()
    while not run.envelope.at_rest:
        with pytest.raises(EmergencyStopError, match="still braking"):
            run.stop.state.reset()
        run.tick()
    run.tick()
    run.stop.state.reset()
    assert run.stop.state.phase == "held"


def test_the_emergency_stop_stops_soon():
    run = Run(Wild(3))
    run.tick(400)
    run.stop.state.press("command")
    begin = len(run.written)
    run.settle()
    # 6 rad/s at 60 rad/s^2 is 0.1 s; turning the acceleration round takes 0.06 s and letting it go 0.03 s
    assert len(run.written) - begin <= 0.19 / DT


def test_after_a_reset_nothing_moves_until_it_is_told_to_and_then_slowly():
    run = Run(Wild(5))
    run.tick(300)
    run.stop.state.press("command")
    with pytest.raises(EmergencyStopError, match="still braking"):
        run.stop.state.reset()
    run.settle()
    run.tick(2)
    run.stop.state.reset()
    place = run.written[-1]
    run.tick(50)
    assert np.array_equal(run.written[-1], place)
    run.stop.play()
    begin = len(run.written)
    run.tick(50)
    assert np.abs(np.diff(run.written[begin:], axis=0)).max() < 2.0 * DT
    run.tick(600)
    assert not np.array_equal(run.written[-1], place)
    assert_safe(run.written)


def test_home_is_the_rest_pose_and_the_play_goes_on_from_there():
    run = Run(Wild(7))
    run.tick(300)
    run.stop.go_home()
    run.tick(1500)
    assert np.allclose(run.written[-1], REST, atol=1e-9)
    assert np.array_equal(run.written[-1], run.written[-100])
    assert not run.stop.approaching
    run.stop.play()
    run.tick(1)
    assert run.stop.approaching
    run.tick(1500)
    assert not run.stop.approaching
    assert not np.allclose(run.written[-1], REST, atol=1e-3)
    assert_safe(run.written)


def test_with_no_rest_pose_home_is_where_the_joints_stop():
    run = Run(Wild(7), rest=None)
    run.tick(300)
    run.stop.go_home()
    run.tick(100)
    assert np.array_equal(run.written[-1], run.written[-50])


def test_at_home_the_time_goes_on():
    run = Run(Wild(7), seconds=10.0)
    run.stop.go_home()
    run.finish()
    assert run.stop.reason == "played to the end"
    assert len(run.written) >= 10.0 / DT


def test_an_end_during_the_emergency_stop_leaves_the_joints_where_they_are():
    run = Run(Wild(9))
    run.tick(300)
    run.stop.state.press("command")
    run.settle()
    place = run.written[-1]
    run.stop.ask("enough")
    run.finish()
    assert np.array_equal(run.written[-1], place)


def test_an_emergency_stop_on_the_last_way_home_ends_the_run_there():
    run = Run(Wild(9))
    run.tick(300)
    run.stop.ask("enough")
    run.tick(60)
    run.stop.state.press("command")
    begin = len(run.written)
    run.finish()
    assert len(run.written) - begin < 40
    assert not np.allclose(run.written[-1], REST, atol=1e-3)
    assert_safe(run.written)


def test_a_deck_that_keeps_failing_at_home_ends_the_run():
    run = Run(Wild(9, fault_after=200))
    run.tick(100)
    run.stop.go_home()
    run.finish()
    assert "no idea" in run.stop.reason
    assert np.allclose(run.written[-1], REST, atol=1e-9)


def test_pressed_again_the_emergency_stop_can_still_be_reset():
    run = Run(Wild(9))
    run.tick(300)
    run.stop.state.press("command")
    run.settle()
    run.tick(2)
    run.stop.state.reset()
    run.stop.state.press("command")
    run.tick(2)
    run.stop.state.press("command")
    run.tick(2)
    run.stop.state.reset()
    assert run.stop.mode == "held"


def test_where_nothing_is_latched_there_is_nothing_to_reset():
    with pytest.raises(EmergencyStopError, match="nothing to reset"):
        StopState().reset()


class Holding:
    """An output that holds its first joints on its own until the targets are there, as a guard does."""

    def __init__(self, place, joints=2):
        self.measured = np.zeros(JOINTS)
        self.place, self.joints, self.follows, self.at_rest = np.array(place), joints, False, True

    @property
    def held(self):
        if self.follows:
            return None
        return np.concatenate([self.place[: self.joints], np.full(JOINTS - self.joints, np.nan)])

    def take(self, targets):
        near = np.abs(targets - self.place)[: self.joints].max() < 1e-3
        self.follows |= bool(near)

    def lose(self, targets):
        self.place, self.follows = targets.copy(), False


def tick_with(run, output, count):
    """Ticks, whose targets the output takes; the ticks until it followed."""
    for tick in range(count):
        run.tick()
        output.take(run.written[-1])
        if output.follows:
            return tick
    return None


def test_joints_that_an_output_holds_are_met_there_before_they_follow_the_deck():
    output = Holding([0.7, -0.4, 0.0])
    output.measured[2] = 0.3
    run = Run(Wild(3), channels=[output])
    assert tick_with(run, output, 2000) is not None
    np.testing.assert_allclose(run.written[-1], [0.7, -0.4, 0.3], atol=1e-3)
    assert run.stop.approaching
    for _ in range(2000):
        run.tick()
        assert output.follows
        if not run.stop.approaching:
            break
    assert not run.stop.approaching
    assert_safe(run.written)


@pytest.mark.parametrize("when", [30, 400, 900])
def test_an_output_that_stops_following_is_met_again(when):
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.tick(when)
    output.lose(run.written[-1] + 0.2)
    place = output.place
    assert tick_with(run, output, 3000) is not None
    np.testing.assert_allclose(run.written[-1][:2], place[:2], atol=1e-3)
    run.tick(1500)
    assert output.follows
    assert not run.stop.approaching
    assert_safe(run.written)


def test_an_output_that_stops_following_during_the_approach_is_not_kept_waiting_for_its_end():
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.tick(30)
    output.lose(run.written[-1] + 0.02)
    assert run.stop.approaching
    assert tick_with(run, output, 75) is not None


def test_a_stop_holds_wherever_an_output_holds_its_joints():
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.tick(400)
    output.lose(run.written[-1] + 0.2)
    run.stop.state.press("command")
    run.settle()
    still = run.written[-1]
    run.tick(200)
    np.testing.assert_array_equal(run.written[-1], still)
    run.stop.state.reset()
    run.stop.go_home()
    assert tick_with(run, output, 3000) is not None
    run.settle()
    run.tick(600)
    np.testing.assert_allclose(run.written[-1], REST, atol=1e-6)
    assert_safe(run.written)


@pytest.mark.parametrize("rests_after", [1, 20, None])
def test_the_end_waits_for_joints_that_an_output_brakes_on_its_own(rests_after):
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.tick(400)
    run.stop.ask("over")
    output.at_rest = False
    run.tick()
    assert run.stop.state.phase == "braking", "the output is not asked to brake"
    assert run.stop.mode == "held"
    run.settle()
    first = len(run.written)
    if rests_after is not None:
        run.tick(rests_after)
        output.at_rest = True
        output.lose(run.written[-1] + 0.1)
        place = output.place
        assert tick_with(run, output, 3000) is not None
        np.testing.assert_allclose(run.written[-1][:2], place[:2], atol=1e-3)
    run.finish()
    stood = next(k for k, row in enumerate(run.written[first:]) if np.abs(row - run.written[first]).max() > 1e-9)
    assert (rests_after or 60) <= stood <= 0.5 / DT
    np.testing.assert_allclose(run.written[-1], REST, atol=1e-6)
    assert_safe(run.written)


def test_the_end_comes_though_an_output_never_follows_again():
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.tick(400)
    output.lose(np.full(JOINTS, 1.0))
    run.stop.ask("enough")
    run.finish()
    np.testing.assert_allclose(run.written[-1], REST, atol=1e-6)
    assert_safe(run.written)


def test_an_output_that_stops_following_on_the_way_to_the_end_is_brought_there_too():
    output = Holding(np.zeros(JOINTS))
    run = Run(Wild(5), channels=[output])
    tick_with(run, output, 100)
    run.stop.ask("enough")
    run.tick(60)
    output.lose(run.written[-1] + 0.02)
    place = output.place[:2]
    while run.tick():
        output.take(run.written[-1])
    assert output.follows
    assert np.abs(np.array(run.written)[:, :2] - place).max(axis=1).min() < 1e-3
    np.testing.assert_allclose(run.written[-1], REST, atol=1e-6)
    assert_safe(run.written)
