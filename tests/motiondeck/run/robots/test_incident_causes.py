"""Incidents are told by their cause: a silent port, a cut branch and a pulled servo are one event each, all named."""

from collections import Counter
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.simulated_time import EmulatedPort
from controller.loop.output_channel import Channel
from controller.motion.skeleton import Pose
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from hardware.rig.rig_joint import SecondServo
from hardware.rig.supervision.health import Incident
from hardware.rig.supervision.rig import Rig
from motiondeck.run.report import RunNews
from motiondeck.run.robots.incident_causes import explained
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck_base.shipped import find_rig

PORTS = {f"{side}_{name} (id {number})": side for side in "lr" for number, name in enumerate(("hip", "knee", "ankle"))}
WHATS = ["does not answer", "was cut off for longer than watchdog_ms", "has a low supply voltage: 8.1 V", "is limp"]


def incident(source, what, fault, whole):
    """One at 0 s; where a servo falls silent, `whole` says whether all others of its port do, too."""
    silent = whole and fault and what in WHATS[:2]
    return Incident(0.0, source, what, fault, tuple(one for one in PORTS if silent and one[0] == source[0]))


INCIDENTS = st.lists(
    st.builds(
        incident,
        st.sampled_from([*PORTS, "the port l"]),
        st.sampled_from(WHATS),
        st.booleans(),
        st.booleans(),
    ),
    max_size=12,
)


def told(incidents):
    return explained(incidents, {f"{one.source} {one.what}" for one in incidents}, PORTS)


@given(INCIDENTS)
def test_every_servo_is_named_in_an_event_of_its_cause(incidents):
    events = told(incidents)
    assert len(events) == len({*events}) <= len(incidents)
    for one in incidents:
        texts = [text for text, fault in events if one.source.partition(" (")[0] in text and fault == one.fault]
        rest = one.what.partition(":")[0].partition(" ")[2]  # after its verb
        assert any(word in text for word in ("was silent", "stopped answering", rest) for text in texts)


@given(INCIDENTS)
def test_a_port_is_silent_when_all_of_it_is_and_else_its_servos_are_counted(incidents):
    for port in "lr":
        own = [one for one in incidents if one.fault and one.what in WHATS[:2] and one.source[0] == port]
        silent = {source for one in own for source in (one.source, *one.silent)}
        whole = len(silent) == 3
        cut = (f"port {port} was silent.", f"servos of {port} stopped answering.")
        said = [text for text, _ in told(incidents) if any(one in text for one in cut)]
        assert len(said) == (len(silent) > 1)
        for text in said:
            start = f"the port {port} was silent. Check adapter, cable and supply."
            assert text.startswith(start if whole else f"2 of 3 servos of {port} stopped answering. ")
            assert all(source.partition(" (")[0] in text for source in silent)
            assert ("Check the cable after" in text) == (not whole and f"{port}_hip (id 0)" not in silent)


@given(INCIDENTS, st.randoms(use_true_random=False))
def test_events_do_not_depend_on_which_incident_came_first(incidents, random):
    once = [one._replace(what=WHATS[0] if one.what in WHATS[:2] else one.what) for one in incidents]

    def words(some):
        return Counter(frozenset(text.replace(",", "").split()) for text, _ in told(some))

    assert words(once) == words(random.sample(once, len(once)))


def test_what_comes_of_a_silent_port_is_told_as_that_and_later_as_something_else():
    silent = [Incident(10.0, source, "does not answer") for source in [*PORTS][:3]]
    idle = [Incident(at, [*PORTS][3 * (at > 12.0)], "does not follow its target") for at in (11.5, 17.0)]
    new = f"{idle[0].source} {idle[0].what}"
    assert explained([*silent, idle[0]], {new}, PORTS)[0][0].startswith("the port l was silent.")
    new = f"{idle[1].source} {idle[1].what}"
    assert explained([*silent, *idle], {new}, PORTS) == [(new, True)]


def test_several_servos_of_a_cause_are_told_in_a_sentence():
    names = [*PORTS][:2]
    low = told([Incident(0.0, name, "has a low supply voltage: 8.1 V") for name in names])
    assert low == [("2 servos have a low supply voltage. Check the supply. Servos: l_hip, l_knee", True)]
    limp = told([Incident(0.0, name, "has lost its torque or restarted") for name in names])
    assert limp[0][0].startswith("2 servos have lost their torque or restarted. Check the supply.")
    without = "does not follow its target; the rig goes on without it"
    assert told([Incident(0.0, name, without) for name in names]) == [
        ("2 servos do not follow their targets; the rig goes on without them. Servos: l_hip, l_knee", True)
    ]


class Line(EmulatedPort):
    """A port through which nothing comes or goes while it is silent, but the `rest` of what is on its way, bytes."""

    silent, rest = False, 0

    def send(self, data):
        return True if self.silent else super().send(data)

    def receive(self, likely=False):
        data = super().receive(likely)
        kept, self.rest = data[: self.rest], max(0, self.rest - len(data))
        return kept if self.silent else data


TICK = 0.01


class Played:
    """A rig of twenty servos that is played, and the events of its run, each with its time."""

    def __init__(self, config=None):
        config = config or load_rig(find_rig("servo20"))
        self.line = Line(EmulatedBus(config))
        rig = Rig(config, lambda part: Bus(self.line, part.baud), beside=False, sleep=self.line.elapse)
        self.output = RigOutput(rig, rig.names, 1.0 / TICK)
        self.events = []
        channel = Channel(self.output)
        handler = SimpleNamespace(
            notify=lambda kind, text, motion="": self.events.append((self.line.now(), kind, text))
        )
        self.news = RunNews(handler, SimpleNamespace(period=TICK, overruns=0), [channel], [])
        self.play(0.3)
        assert self.events == []

    def play(self, seconds):
        pose, still = Pose(np.zeros(3), np.array(0.0), np.zeros((1, 4))), self.output.rig.positions.copy()
        for _ in range(round(seconds / TICK)):
            self.output.write(still, pose)
            self.news.update()
            self.line.elapse(TICK)

    @property
    def faults(self):
        return [text for _, kind, text in self.events if kind == "fault"]


@pytest.mark.parametrize("rest", [0, 8, 60, 100, 200])
@pytest.mark.parametrize("seconds", [0.4, 0.6])
def test_a_port_that_was_silent_is_one_event_within_a_second(rest, seconds):
    run = Played()
    began, run.line.silent, run.line.rest = run.line.now(), True, rest
    run.play(seconds)
    run.line.silent = False
    run.play(1.0)
    assert [text.partition(" Servos:")[0] for text in run.faults] == [
        "rig: the port /dev/ttyUSB0 was silent. Check adapter, cable and supply."
    ]
    assert run.events[0][0] - began < 1.0
    # At the end it is one line, too, and another what has come of it.
    assert run.output.report()["causes"][0].startswith("the port /dev/ttyUSB0 was silent.")
    assert len(run.output.report()["causes"]) <= 2 < len(run.output.report()["incidents"])


def test_a_pulled_servo_is_another_event_within_a_second():
    run = Played()
    began = run.line.now()
    run.line.bus[18].dead = True
    run.play(1.2)
    assert run.faults == ["rig: l_knee (id 18) does not answer. Check its plug and cable."]
    assert run.events[0][0] - began < 1.0


@pytest.mark.parametrize(
    ("first", "last", "check"),
    [
        (16, 20, "the cable after l_hip_yaw (id 15)"),
        (19, 20, "the cable after l_knee (id 18)"),
        (1, 2, "the cable to their branch"),
        (1, 10, "the cable to their branch"),
        (2, 20, "the cable after head_pan (id 1)"),
        (4, 8, "the cable to their branch"),
    ],
)
def test_servos_cut_off_together_are_counted_and_the_last_that_answers_is_named(first, last, check):
    run = Played()
    began = run.line.now()
    for number in range(first, last + 1):
        run.line.bus[number].dead = True
    run.play(1.5)
    cut = f"{last - first + 1} of 20 servos of /dev/ttyUSB0 stopped answering. Check {check}. Servos: "
    assert {text.startswith(f"rig: {cut}") for text in run.faults} == {True}
    assert run.events[0][0] - began < 1.0
    assert next(text for text in run.output.report()["causes"] if "answer" in text).startswith(cut)


def test_servos_cut_off_for_a_moment_are_told_as_such_and_not_as_their_port():
    run = Played()
    for dead in (True, False):
        for number in range(16, 21):
            run.line.bus[number].dead = dead
        run.play(0.6)
    assert run.faults
    assert all("5 of 20 servos of /dev/ttyUSB0 stopped answering" in text for text in run.faults[-1:])
    assert "was silent" not in str(run.faults)


def pairs():
    """A rig in which two servos each turn three joints."""
    config = load_rig(find_rig("servo20"))
    joints = [
        msgspec.structs.replace(one, second=SecondServo(one.id + 20, -one.direction, one.zero))
        if one.id in (1, 13, 18)
        else one
        for one in config.joints
    ]
    return msgspec.structs.replace(config, joints=tuple(joints))


@pytest.mark.parametrize(
    ("dead", "told"),
    [
        ([38], "l_knee's second servo (id 38) does not answer. Check its plug and cable."),
        ([18], "l_knee (id 18) does not answer. Check its plug and cable."),
        ([18, 38], "{} Check the cable to their branch. Servos: l_knee, l_knee's second servo"),
        (
            [38, 19, 20],
            "{} Check the cable after l_knee (id 18). Servos: l_knee's second servo, l_ankle_pitch, l_ankle_roll",
        ),
        ([19, 20], "{} Check the cable after l_knee's second servo (id 38). Servos: l_ankle_pitch, l_ankle_roll"),
    ],
)
def test_servos_are_counted_and_not_joints_where_two_turn_one(dead, told):
    run = Played(pairs())
    for number in dead:
        run.line.bus[number].dead = True
    run.play(1.2)
    count = f"{len(dead)} of 23 servos of /dev/ttyUSB0 stopped answering."
    assert [text.removeprefix("rig: ") for text in run.faults[-1:]] == [told.format(count)]


def test_a_joint_of_two_servos_is_switched_off_by_its_own_name_also_when_one_is_silent():
    run = Played(msgspec.structs.replace(pairs(), on_loss="go on"))
    run.line.bus[38].dead = True
    run.play(1.0)
    rig = run.output.rig
    rig.switch_off(rig.names.index("l_knee"))
    assert rig.incidents[-1].source == "l_knee (id 18)"


def test_a_port_is_silent_when_all_servos_are_that_were_not_lost_before():
    run = Played(msgspec.structs.replace(load_rig(find_rig("servo20")), on_loss="go on"))
    run.line.bus[18].dead = True
    run.play(3.0)
    assert "goes on without it" in run.faults[-1]
    run.line.silent = True
    run.play(0.6)
    run.line.silent = False
    run.play(1.0)
    assert run.faults[-1].startswith("rig: the port /dev/ttyUSB0 was silent. Check adapter, cable and supply.")
