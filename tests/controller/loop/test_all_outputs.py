"""What every output is given, whatever is commanded: two robots, each with a good output and a bad one."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from benchmarks.simulated_time import VirtualClock
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.ensemble import all_limits, together
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.wire.messages.commands import (
    Blend,
    EmergencyStop,
    GetPhase,
    GetStatus,
    GiveBeat,
    Home,
    Jump,
    LockPhase,
    Pause,
    Queue,
    Reset,
    Resume,
    SetTempo,
    Stop,
    Switch,
    Unlock,
)
from controller.wire.messages.replies import Accepted, PhaseNow, Refused, State

RATE = 100.0
LIBRARY = synthetic.small_phase_library()
# Tight enough for the envelope to have work: the motions swing further and faster.
QUICK = JointLimits(*(np.full(4, x) for x in (-0.8, 0.9, 3.0, 40.0, 2000.0)))
SLOW = JointLimits(*(np.full(3, x) for x in (-0.5, 0.5, 1.0, 10.0, 400.0)))

MOTIONS = st.sampled_from([*synthetic.MOTIONS, "no such motion"])
COMMANDS = st.one_of(
    st.builds(Switch, MOTIONS, direct=st.booleans()),
    st.builds(Queue, MOTIONS),
    st.builds(Blend, MOTIONS, MOTIONS, st.floats(-0.2, 1.2)),
    st.builds(Jump, st.floats(-0.1, 1.1)),
    st.builds(GiveBeat, ago=st.floats(-2.1, 2.1)),
    st.builds(
        LockPhase, st.sampled_from(["beat", "deck", "body"]), phase=st.floats(-0.1, 1.1), steps=st.integers(-1, 17)
    ),
    st.builds(SetTempo, st.floats(-4.0, 4.0), over=st.floats(-1.0, 2.0)),
    st.sampled_from([Pause(), Resume(), Home(), EmergencyStop(), Reset(), GetStatus(), GetPhase(), Unlock(), Stop()]),
)


class Output:
    """Keeps what it is given; a bad one raises, stalls in its mind and scribbles over its targets."""

    def __init__(self, name, bad_every=0):
        self.name, self.bad_every, self.written, self.calls = name, bad_every, [], 0

    def write(self, targets, pose):
        self.calls += 1
        if self.bad_every and self.calls % self.bad_every == 0:
            targets[:] = np.nan  # not allowed, so this raises
        self.written.append((self.calls, targets.copy()))

    def measured(self):
        return np.array([np.nan]) if self.bad_every else None

    def report(self):
        return {}

    def close(self):
        pass


def played(timeline):
    """Runs the timeline, (ticks, command) each; what the outputs were given, all answers, and the tick of each."""
    robots = [(QUICK, 4), (SLOW, 3)]
    deck = Deck(
        LIBRARY, together([lambda pose, n=n: 2.0 * pose.rotation.ravel()[5 : 5 + n] for _, n in robots]), "march"
    )
    outputs = [[Output(f"{limits.velocity[0]}"), Output("bad", 7)] for limits, _ in robots]
    channels = [Channel(output) for pair in outputs for output in pair]
    for index, channel in enumerate(channels):
        channel.share((0, 4)[index // 2], robots[index // 2][1], 7)
    limits = all_limits([QUICK, SLOW])
    desk, answers = CommandHandler(CommandedRun(deck), []), []
    waiting = list(zip(np.cumsum([ticks for ticks, _ in timeline]).tolist(), (c for _, c in timeline), strict=True))
    tick = 0

    def commands(stop):
        nonlocal tick
        while waiting and waiting[0][0] <= tick:
            _, message = waiting.pop(0)
            answers.append((tick, message, desk.carry_out(message, stop)))
        tick += 1
        if tick > 280:
            stop.ask("enough")

    run(deck, channels, VirtualClock(RATE), SafetyEnvelope(limits, 1.0 / RATE), rest=np.zeros(7), commands=commands)
    return outputs, answers


def assert_safe(targets, limits):
    assert np.isfinite(targets).all()
    assert (targets >= limits.lower).all()
    assert (targets <= limits.upper).all()
    for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
        most = getattr(limits, name) / RATE**order
        assert (np.abs(np.diff(targets, n=order, axis=0)) <= most * (1.0 + 1e-6)).all()


@settings(max_examples=6, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 60), COMMANDS), max_size=10))
def test_every_output_gets_safe_targets_every_command_an_answer_and_all_that_twice_alike(timeline):
    outputs, answers = played(timeline)
    for (good, bad), limits in zip(outputs, (QUICK, SLOW), strict=True):
        targets = np.array([written for _, written in good.written])
        assert_safe(targets, limits)
        for call, written in bad.written:  # a tick it missed is lost for it, not for others
            assert np.array_equal(written, targets[call - 1])
    for _, message, answer in answers:
        kinds = {GetStatus: State, GetPhase: PhaseNow}
        assert isinstance(answer, kinds.get(type(message), Accepted | Refused))
        assert not isinstance(answer, Refused) or answer.reason
        assert not isinstance(message, EmergencyStop) or isinstance(answer, Accepted)
    again, _ = played(timeline)
    for one, other in zip(outputs, again, strict=True):
        assert np.array_equal([w for _, w in one[0].written], [w for _, w in other[0].written])


@settings(max_examples=4, deadline=None)
@given(st.integers(30, 200), MOTIONS)
def test_the_emergency_stop_slows_every_output_down_from_its_own_tick_on(moment, motion):
    halted, _ = played([(5, Switch(motion)), (moment, EmergencyStop())])
    free, _ = played([(5, Switch(motion))])
    for (good, _), (other, _), limits in zip(halted, free, (QUICK, SLOW), strict=True):
        stopped = np.array([written for _, written in good.written])
        went_on = np.array([written for _, written in other.written])
        assert np.array_equal(stopped[: moment + 5], went_on[: moment + 5])
        speed = np.abs(np.diff(stopped[moment + 3 :], axis=0))
        longest = limits.velocity / limits.acceleration + 2.0 * limits.acceleration / limits.jerk
        at_rest = int(np.ceil(longest.max() * RATE)) + 3
        assert not speed[at_rest:].any()
