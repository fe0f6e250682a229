"""Joints that lag show what the picture shows, each by its own lag: through switches, tempo, pauses and stops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.lead import Delay, Lead
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.wire.messages.commands import EmergencyStop, Pause, Reset, Resume, SetTempo, Switch

RATE, JOINTS = 200.0, 4
DT = 1.0 / RATE
LIBRARY = synthetic.small_phase_library()
WIDE = JointLimits(*(np.full(JOINTS, x) for x in (-9.0, 9.0, 1e4, 1e7, 1e10)))
TIGHT = JointLimits(*(np.full(JOINTS, x) for x in (-0.8, 0.9, 3.0, 40.0, 2000.0)))
LAGS = np.array([0.06, 0.0, 0.035, 0.0475])
WHOLE = [0, 1, 2]  # joints that lag by whole ticks
LIVELY = [27, 30, 34, 31]  # numbers of a pose's rotations that move
ALL = [(60, Switch("wave")), (260, SetTempo(1.7)), (380, Pause()), (500, Resume()), (620, Switch("march"))]


class Written:
    """An output that keeps what it is given, and lags or says nothing of it."""

    name = "written"

    def __init__(self, lag=None):
        self.targets, self.poses = [], []
        if lag is not None:
            self.lag = np.asarray(lag)

    def write(self, targets, pose):
        self.targets.append(targets.copy())
        self.poses.append(pose)

    def measured(self):
        return None

    def report(self):
        return {}

    @property
    def shafts(self):
        """Where joints are that follow what is written after exactly their lags, rad, in each tick."""
        times = np.arange(len(self.targets)) * DT
        lagging = zip(self.lag, self.values.T, strict=True)
        return np.column_stack([np.interp(times - lag, times, x) for lag, x in lagging])

    @property
    def values(self):
        return np.array(self.targets)


def played(lags=None, timeline=ALL, limits=WIDE, ticks=900):
    """Runs a timeline of (tick, command); what the joints and the picture are given, and the picture of the loop."""
    deck = Deck(LIBRARY, lambda pose: pose.rotation.ravel()[LIVELY], "march")
    joints, picture, shown = Written(lags), Written(), []
    desk, waiting, now = CommandHandler(CommandedRun(deck), []), list(timeline), iter(range(10**6))

    def commands(stop):
        tick = next(now)
        while waiting and waiting[0][0] <= tick:
            desk.carry_out(waiting.pop(0)[1], stop)
        if tick == ticks:
            stop.ask("enough")

    channels, envelope = [Channel(joints), Channel(picture)], SafetyEnvelope(limits, DT)
    publish = lambda state: shown.append((state.targets.copy(), state.pose))  # noqa: E731
    run(deck, channels, VirtualClock(RATE), envelope, commands=commands, publish=publish, publish_every=1)
    return joints, picture, shown


def test_each_shaft_is_where_the_picture_is_whatever_is_commanded():
    joints, picture, _ = played(LAGS)
    begun = round(LAGS.max() * RATE)
    assert np.abs(joints.shafts - picture.values)[begun:].max() < 1e-3  # linear between ticks
    assert np.allclose(joints.shafts[begun:, WHOLE], picture.values[begun:, WHOLE], atol=1e-12)
    assert np.ptp(picture.values, axis=0).min() > 0.3


def test_the_picture_is_the_deck_s_own_motion_one_lag_later():
    joints, picture, shown = played(LAGS)
    _, without, _ = played()
    late = round(LAGS.max() * RATE)
    went = len(without.values) - late - 40  # the stop at the end differs
    assert np.allclose(picture.values[late : late + went, WHOLE], without.values[:went, WHOLE], atol=1e-9)
    linear = 0.25 * np.abs(np.diff(without.values, n=2, axis=0)).max()  # an eighth for each of two delays
    assert np.allclose(picture.values[late : late + went], without.values[:went], atol=linear)
    assert np.allclose([t for t, _ in shown], picture.values)
    # The joint that lags most is commanded when it was before.
    assert np.allclose(joints.values[:went, 0], without.values[:went, 0], atol=1e-9)
    for one, other in zip(picture.poses[late : late + went], without.poses, strict=False):
        assert np.array_equal(one.root_position, other.root_position)


@pytest.mark.thorough
@settings(max_examples=5, deadline=None)
@given(st.integers(100, 500), st.lists(st.sampled_from([0.0, 0.02, 0.0333, 0.07]), min_size=JOINTS, max_size=JOINTS))
def test_an_emergency_stop_brakes_at_once_and_the_picture_shows_what_the_shafts_do(moment, lags):
    lags = np.array(lags)
    stop = [(60, Switch("wave")), (moment, EmergencyStop()), (moment + 200, Reset())]
    joints, picture, _ = played(lags, stop, TIGHT)
    free, _, _ = played(lags, stop[:1], TIGHT)
    assert np.array_equal(joints.values[:moment], free.values[:moment])
    longest = TIGHT.velocity / TIGHT.acceleration + 2.0 * TIGHT.acceleration / TIGHT.jerk
    at_rest = moment + int(np.ceil(longest.max() * RATE)) + 1
    assert not np.diff(joints.values[at_rest : moment + 200], axis=0).any()
    assert np.abs(joints.shafts - picture.values)[30:].max() < 1e-3
    for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
        most = getattr(TIGHT, name) / RATE**order
        assert (np.abs(np.diff(joints.values, n=order, axis=0)) <= most * (1.0 + 1e-6)).all()


def test_without_lags_nothing_is_delayed():
    joints, picture, shown = played()
    assert np.array_equal(joints.values, picture.values)
    assert all(one is other for (_, one), other in zip(shown, picture.poses, strict=False))
    assert Lead([Channel(joints)], JOINTS, DT).seconds == 0.0


def test_of_two_outputs_that_lag_each_gets_its_own():
    class Deckhand:
        def update(self, dt):
            self.time = getattr(self, "time", 0.0) + dt
            return np.array([np.sin(3.0 * self.time), np.cos(3.0 * self.time)]), self

    rig, physics, picture = Written([0.05, 0.0]), Written([0.02, 0.02]), Written()
    limits = JointLimits(*(np.full(2, x) for x in (-9.0, 9.0, 1e4, 1e7, 1e10)))
    channels = [Channel(output) for output in (rig, physics, picture)]
    run(Deckhand(), channels, VirtualClock(RATE), SafetyEnvelope(limits, DT), seconds=2.0)
    for output in (rig, physics):
        assert np.allclose(output.shafts[20:390], picture.values[20:390], atol=1e-9)


def test_a_robot_of_several_lags_in_its_own_joints_only():
    late, prompt = Channel(Written([0.03, 0.01])), Channel(Written())
    for channel in (late, prompt):
        channel.share(1, 2, of=4)
    assert late.lag.tolist() == [0.0, 0.03, 0.01, 0.0]
    assert prompt.lag is None


def test_a_delay_is_linear_between_ticks_and_begins_with_its_first_values():
    late = Delay(np.array([0.0, 0.0025, 0.01]), DT)
    ramp = [late(np.full(3, 1.0 + tick)).copy() for tick in range(5)]
    assert ramp[0].tolist() == [1.0, 1.0, 1.0]
    assert ramp[4] == pytest.approx([5.0, 4.5, 3.0])
    with pytest.raises(ValueError, match="read-only"):
        late(np.zeros(3))[:] = 1.0
