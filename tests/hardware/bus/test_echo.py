"""Adapters that return what is sent: every client of a bus sees the servos alone."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.port import WithoutEcho
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.tools.doctor import examine
from hardware.tools.scan import scan

BAUD = 1_000_000


def joint(id, model, zero):
    return RigJoint(f"joint_{id}", id, model, 1, zero, -1.0, 1.0, 2.0)


OLD = (joint(1, "AX-12A", 512), joint(7, "MX-28(1.0)", 2048))
MIXED = (*OLD, joint(9, "XM430-W350", 2048))


class EchoingPort:
    """An emulated port behind an adapter that returns what is sent."""

    def __init__(self, port):
        self.port, self.name, self.now, self.close = port, port.name, port.now, port.close
        self.echo = b""

    def send(self, data):
        self.echo += data
        return self.port.send(data)

    def receive(self, likely=False):
        echo, self.echo = self.echo, b""
        return echo + self.port.receive()

    def wait(self, seconds):
        return bool(self.echo) or self.port.wait(seconds)


def echoing(joints, rate=50.0):
    port = EmulatedPort(EmulatedBus(RigConfig("emulated", BAUD, rate, joints)), True)
    return port, EchoingPort(port)


def open_bus(echo, baud, joints=()):
    echo.port.bus.baud = baud
    bus = Bus(echo, baud)
    bus.families = {each.id: each.table.family for each in joints}
    return bus


@pytest.mark.parametrize("joints", [OLD, MIXED])
def test_a_scan_lists_the_servos_alone(joints):
    _, echo = echoing(joints)
    found = scan(lambda baud: open_bus(echo, baud), (57600, BAUD))
    assert [
        (one.baud, one.identity.id, one.identity.model) for one in sorted(found, key=lambda one: one.identity.id)
    ] == [(BAUD, each.id, each.model) for each in joints]


def test_no_servo_answers_where_there_is_none():
    port, echo = echoing(OLD)
    for servo in port.bus.devices:
        servo.dead = True
    assert scan(lambda baud: open_bus(echo, baud), (BAUD,)) == []
    assert open_bus(echo, BAUD, OLD).ping(1) is None


def test_registers_are_read_and_written():
    port, echo = echoing(OLD)
    bus, led = open_bus(echo, BAUD, OLD), OLD[0].table["led"]
    assert bus.write(1, led.address, b"\x01").error == 0
    assert (port.bus[1]["led"], bus.read(1, led.address, 1).params) == (1, b"\x01")
    assert bus.echoes


def test_a_servo_whose_answer_looks_like_the_question_is_no_echo():
    """A ping is answered with the ping's own bytes where the error is the input voltage."""
    port = EmulatedPort(EmulatedBus(RigConfig("emulated", BAUD, 50.0, OLD)), True)
    port.bus[1].fail(1)
    bus = open_bus(EchoingPort(port), BAUD, OLD)
    bus.port = port
    assert bus.ping(1).model == "AX-12A"
    assert (bus.ping(1).alert, bus.echoes) == (True, False)


def test_the_same_servo_is_there_behind_an_echo():
    port, echo = echoing(OLD)
    port.bus[1].fail(1)
    bus = open_bus(echo, BAUD, OLD)
    assert (bus.ping(1).model, bus.ping(1).alert, bus.ping(2), bus.echoes) == ("AX-12A", True, None, True)


class Line:
    """A port on which the given pieces arrive."""

    name, now = "line", staticmethod(lambda: 0.0)

    def __init__(self, *pieces):
        self.pieces = list(pieces)

    def send(self, data):
        return True

    def receive(self, likely=False):
        return self.pieces.pop(0) if self.pieces else b""

    def wait(self, seconds):
        return bool(self.pieces)


@pytest.mark.parametrize(
    ("pieces", "rest"),
    [
        ((b"abcdef", b"XY"), b"XY"),
        ((b"ab", b"cd", b"efXY"), b"XY"),
        ((b"abcdefX", b"Y"), b"XY"),
        ((b"ab?def", b"XY"), b"?defXY"),  # damaged: from there on all is left to the parser
        ((b"abcdef",), b""),
    ],
)
def test_only_what_was_sent_is_dropped(pieces, rest):
    port = WithoutEcho(Line(*pieces))
    port.send(b"abc")
    port.send(b"def")
    heard = b""
    while port.wait(0.0):
        heard += port.receive()
    assert heard == rest


@pytest.mark.parametrize("joints", [OLD, MIXED])
def test_a_rig_plays_through_an_echo(joints):
    port, echo = echoing(joints)
    rig = Rig(
        RigConfig("emulated", BAUD, 50.0, joints), lambda part: open_bus(echo, BAUD, joints), False, sleep=port.elapse
    )
    for tick in range(150):
        rig.collect_state()
        rig.write(np.full(len(joints), 0.5 * np.sin(0.03 * tick)))
        port.elapse(0.02)
    assert rig.recoveries == 0
    assert np.abs(rig.positions - rig.goals).max() < 0.15
    assert list(rig.incidents) == []


def test_the_doctor_names_an_echo():
    _, echo = echoing(OLD)
    report = examine(RigConfig("emulated", BAUD, 50.0, OLD), open_bus(echo, BAUD, OLD))
    assert any("returns what is sent" in note for note in report.notes)
    assert [servo.model for servo in report.servos] == ["AX-12A", "MX-28(1.0)"]
