"""The bus against emulated servos in simulated time, and against wires that go wrong."""

import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.errors import NoReplyError, RefusedError, SerialPortError
from hardware.families.dynamixel2.frames import build_status
from hardware.families.dynamixel2.group_reply import WholeReply
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, RigJoint

XM430 = MODELS["XM430-W350"]
POSITION = XM430["present_position"].address, XM430["present_position"].length


def blocks(*ids):
    return tuple((id, *POSITION) for id in ids)


def damaged(port, damage):
    """The same port, whose answers pass through `damage` before they arrive."""
    whole = port.receive
    port.receive = lambda likely=False: damage(whole())
    return port


def positions(statuses):
    return {id: XM430["present_position"].decode(status.params) for id, status in statuses.items()}


def test_a_ping_tells_who_is_there(bus):
    identity = bus.ping(1)
    assert (identity.id, identity.model, identity.firmware, identity.alert) == (1, "XM430-W350", 46, False)
    assert bus.ping(99) is None


def test_what_is_written_is_read_back(bus):
    bus.write(1, 116, (2100).to_bytes(4, "little"))
    assert bus.read(1, 116, 4).params == (2100).to_bytes(4, "little")


def test_a_value_that_looks_like_a_header_arrives_as_it_is(bus, servos):
    """The maker's Python client sends these four bytes unstuffed, and loses bytes when it reads them."""
    bus.write(1, 11, b"\x04")
    bus.write(1, 116, (-131073).to_bytes(4, "little", signed=True))
    assert servos[1]["goal_position"] == -131073
    assert bus.read(1, 116, 4).params == bytes.fromhex("fffffdff")


def test_a_silent_servo_is_named(bus):
    with pytest.raises(NoReplyError, match=r"id 99 on emulated does not answer \(read register 132\)"):
        bus.read(99, 132, 4)


def test_who_carries_the_bytes_may_stand_still_for_a_while(bus, port):
    """As an emulator or an adapter's program does that a busy machine does not let run."""
    port.wire.faults = FaultPlan([Fault("delay", value=300.0)])
    bus.write(1, 116, (2100).to_bytes(4, "little"))
    assert bus.read(1, 116, 4).params == (2100).to_bytes(4, "little")


@pytest.mark.parametrize("late", [30.0, 60.0, 150.0, 300.0])
def test_a_late_answer_is_not_taken_for_that_of_the_next_register(bus, port, late):
    """An answer does not tell its register: the second one to a question asked twice would be the next one's."""
    rows = [XM430[name] for name in ("present_temperature", "torque_enable", "id", "baud_rate")]
    before = [bus.read(1, row.address, 1).params for row in rows]
    port.wire.faults = FaultPlan([Fault("delay", value=late)])
    assert [bus.read(1, row.address, 1).params for row in rows] == before


@pytest.mark.parametrize("old", [False, True])
def test_a_servo_is_found_though_its_bytes_stand_still_for_a_while(old):
    model = "AX-12A" if old else "XL430-W250"
    joint = RigJoint("pan", 1, model, 1, MODELS[model].one_turn[1] // 2, -1.0, 1.0, 2.0)
    port = EmulatedPort(EmulatedBus(RigConfig("p", 1_000_000, 100.0, (joint,))))
    bus = Bus(port, 1_000_000)
    bus.families = {1: joint.table.family}
    port.wire.faults = FaultPlan([Fault("delay", value=300.0)])
    found = bus.ping(1)
    assert found is not None
    assert found.model == model


def test_a_port_without_power_costs_a_long_wait_only_once(bus, port, servos):
    for id in (1, 2, 3, 4):
        servos[id].dead = True
    times = []
    for id in (1, 2, 3, 4):
        before = port.now()
        with pytest.raises(NoReplyError):
            bus.read(id, *POSITION)
        times.append(port.now() - before)
    assert times[0] > 0.4
    assert max(times[1:]) < 0.2


def test_a_refusal_says_why(bus):
    with pytest.raises(RefusedError, match=r"id 1 .* error 7, register not accessible"):
        bus.write(1, 132, bytes(4))


def test_an_alert_is_information(bus, servos):
    servos[1].fail(0x24)
    assert bus.ping(1).alert
    assert bus.read(1, 70, 1).alert
    assert bus.read(1, 70, 1).params == b"\x24"
    assert bus.write(1, 65, b"\x01").alert
    assert bus.bulk_read(blocks(1, 2))[1].alert
    assert bus.bulk_read(blocks(1, 2), fast=True)[1].alert
    assert not bus.bulk_read(blocks(1, 2))[2].alert


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("dead", [[1], [3], [4], [1, 2], [1, 3], [2, 4], [1, 2, 3, 4]])
@pytest.mark.parametrize("fast", [False, True])
def test_a_dead_servo_costs_one_servo(bus, servos, strict, dead, fast):
    servos.strict = strict
    for id in dead:
        servos[id].dead = True
    heard = positions(bus.bulk_read(blocks(1, 2, 3, 4), fast))
    assert heard == {id: place for id, place in {1: 2048, 2: 2048, 3: 1500, 4: 2048}.items() if id not in dead}


def test_a_sync_write_reaches_all(bus, servos):
    assert bus.sync_write(65, 1, bytes([1, 1, 2, 1, 4, 1]))
    assert [servos[id]["led"] for id in (1, 2, 3, 4)] == [1, 1, 0, 1]


@pytest.mark.parametrize(
    ("alike", "fast", "instruction"),
    [(True, False, 0x82), (True, True, 0x8A), (False, False, 0x92), (False, True, 0x9A)],
)
def test_a_group_read_asks_by_its_instruction(port, alike, fast, instruction):
    """Dynamixel Protocol 2.0, section "Instruction": servos that know no fast reads stay silent when asked for one."""
    asked, send = [], port.send
    port.send = lambda data: asked.append(data[7]) or send(data)
    bus = Bus(port, 1_000_000)
    asked_for = blocks(1, 2) if alike else ((1, *POSITION), (2, 64, 7))
    assert list(bus.bulk_read(asked_for, fast)) == [1, 2]
    assert asked == [instruction]


def test_a_byte_is_ten_bits_on_the_wire(bus):
    assert bus.wire_time(1) == pytest.approx(10e-6)
    assert Bus(bus.port, 57_600).wire_time(120) == pytest.approx(1200 / 57_600)


def test_a_lost_answer_is_asked_for_again(port):
    lost = iter([True])
    bus = Bus(damaged(port, lambda data: b"" if data and next(lost, False) else data), 1_000_000)
    assert bus.ping(1) is not None


def test_noise_before_an_answer_does_no_harm(port):
    noise = b"\xff\xff\xfd\x00\x01\xff\x03"
    bus = Bus(damaged(port, lambda data: noise + data if data else data), 1_000_000)
    assert bus.ping(1) is not None
    assert bus.read(1, 132, 4).params == (2048).to_bytes(4, "little")
    assert list(bus.bulk_read(blocks(1, 2), fast=True)) == [1, 2]


def test_the_answer_of_another_servo_is_not_taken(port):
    other = build_status(2, 0, b"\x00\x00\x00\x00")
    bus = Bus(damaged(port, lambda data: other + data if data else data), 1_000_000)
    assert bus.read(1, 132, 4).params == (2048).to_bytes(4, "little")


def test_a_late_answer_to_an_earlier_call_is_not_taken(port):
    late = build_status(1)
    bus = Bus(damaged(port, lambda data: late + data if data else data), 1_000_000)
    assert bus.read(1, 132, 4).params == (2048).to_bytes(4, "little")


class BabblingPort:
    """A wire that is never quiet and never says anything."""

    name = "babble"

    def __init__(self):
        self._now = 0.0

    def send(self, data):
        return True

    def receive(self, likely=False):
        return b"\xff\xff\xfd\x00\x01"

    def wait(self, seconds):
        self._now += 0.001
        return True

    def now(self):
        self._now += 0.001
        return self._now

    def close(self):
        pass


def test_endless_noise_ends_at_the_deadline():
    bus = Bus(BabblingPort(), 1_000_000)
    assert bus.ping(1) is None
    assert bus.bulk_read(blocks(1, 2), fast=True) == {}


def test_a_request_is_collected_without_waiting(bus, port):
    before = port.now()
    assert bus.collect() is None
    assert bus.request(blocks(1, 2, 3))
    assert not bus.request(blocks(1, 2, 3))
    reply = bus.collect()
    assert positions(reply.statuses([1, 2, 3])) == {1: 2048, 2: 2048, 3: 1500}
    assert bus.collect() is None
    assert port.now() == before


def test_an_answer_in_pieces_is_put_together(port):
    waiting = []

    def one_byte_a_call(data):
        waiting.extend(data)
        return bytes([waiting.pop(0)]) if waiting else b""

    bus = Bus(damaged(port, one_byte_a_call), 1_000_000)
    bus.request(blocks(1, 2))
    replies = [bus.collect() for _ in range(8 + 2 * 8)]
    assert replies[:-1] == [None] * 23
    assert isinstance(replies[-1], WholeReply)
    assert list(replies[-1].statuses([1, 2])) == [1, 2]


def test_a_request_ends_at_its_deadline(bus, servos, port):
    servos[2].dead = True
    bus.request(blocks(1, 2, 3))
    assert bus.collect() is None
    port.elapse(0.06)
    reply = bus.collect()
    assert list(reply.statuses) == [1]
    assert (reply.silent, reply.unheard) == ([2], [3])
    assert bus.request(blocks(1, 3))


@pytest.mark.parametrize("fast", [True, False])
def test_who_has_answered_is_told_while_another_is_overdue(bus, servos, port, fast):
    servos[3].dead = True
    bus.request(blocks(1, 2, 3), fast)
    port.elapse(0.001)
    assert bus.collect() is None
    assert list(bus.collect_early().statuses) == [1, 2]
    assert bus.collect() is None
    assert bus.collect_early() is None
    port.elapse(0.06)
    reply = bus.collect()
    assert (reply.statuses, reply.silent) == ({}, [3])
    assert bus.collect_early() is None


@pytest.mark.parametrize("fast", [True, False])
def test_each_servo_may_be_asked_for_registers_of_its_own(bus, servos, fast):
    servos[2].fail(0x01)
    assert bus.request(((1, *POSITION), (2, 64, 7), (3, 146, 1)), fast)
    reply = bus.collect()
    assert [len(reply.statuses[id].params) for id in (1, 2, 3)] == [4, 7, 1]
    assert reply.statuses[2].params[6] == 1
    assert [reply.statuses[id].alert for id in (1, 2, 3)] == [False, True, False]


@pytest.mark.parametrize("fast", [True, False])
def test_a_refused_read_is_an_error_number_of_its_servo(bus, port, fast):
    """Address 5000 does not exist; a status without data is shorter than planned, so it counts at the deadline."""
    bus.request(((1, *POSITION), (2, 5000, 4), (3, *POSITION)), fast)
    port.elapse(0.06)
    reply = bus.collect()
    statuses = reply.statuses([1, 2, 3]) if fast else reply.statuses
    assert [bool(statuses[id].error) for id in (1, 2, 3)] == [False, True, False]


def test_a_stuffed_status_is_read_servo_by_servo(bus, servos):
    """FF FF FD in a position makes its status a byte longer than the others."""
    servos[2].write(11, b"\x04")
    servos[2].bank.shaft[servos[2].row] = -131073
    servos.advance(1.0)
    heard = bus.bulk_read(blocks(1, 2, 3, 4))
    assert positions(heard) == {1: 2048, 2: -131073, 3: 1500, 4: 2048}


def test_an_answer_that_comes_too_late_is_not_mistaken_for_the_next(bus, port):
    bus.request(blocks(1, 2))
    assert bus.collect() is not None
    port.wire._arriving.append((0.0, b"\xff\xff\xfd\x00\xfe\x05"))  # the rest of something
    bus.request(blocks(3, 4))
    assert list(bus.collect().statuses([3, 4])) == [3, 4]


@pytest.mark.parametrize(
    "call",
    [
        lambda bus: bus.ping(1),
        lambda bus: bus.write(1, 65, b"\x01"),
        lambda bus: bus.sync_write(65, 1, b"\x01\x01"),
        lambda bus: bus.request(blocks(1)),
        lambda bus: bus.bulk_read(blocks(1), fast=True),
    ],
)
def test_a_vanished_port_is_one_clear_error(bus, port, call):
    port.unplug()
    with pytest.raises(SerialPortError, match="emulated is gone"):
        call(bus)


def test_a_full_port_is_told_and_not_waited_for(port, bus):
    port.send = lambda data: False
    assert not bus.sync_write(65, 1, b"\x01\x01")
    assert not bus.request(blocks(1))
    assert bus.bulk_read(blocks(1), fast=True) == {}
    with pytest.raises(NoReplyError):
        bus.read(1, 65, 1)


def test_a_port_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SerialPortError, match="no such device"):
        Bus.open(str(tmp_path / "ttyNone"), 1_000_000)


def test_a_file_is_no_port(tmp_path):
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(SerialPortError, match="cannot open the port"):
        Bus.open(str(path), 1_000_000)


def test_all_who_answer_are_found_at_once_with_model_and_firmware(bus, servos):
    servos[3].dead = True
    assert bus.ping_all() == [bus.ping(id) for id in (1, 2, 4)]
    for id in (1, 2, 4):
        servos[id].dead = True
    assert bus.ping_all() == []


def test_other_answers_are_not_taken_for_those_of_a_ping(port):
    late = build_status(9, 0, b"\x01\x02") + build_status(8)
    sent = iter([late])
    bus = Bus(damaged(port, lambda data: next(sent, b"") + data), 1_000_000)
    bus._discard = lambda: None
    assert [identity.id for identity in bus.ping_all()] == [1, 2, 3, 4]


def test_half_an_answer_is_waited_for_and_counts_at_the_deadline(bus, port):
    """Two of three statuses: not complete, so it is not given out before its time."""
    answers = []
    whole = port.receive
    port.receive = lambda likely=False: answers.pop(0) if answers else b""
    bus.request(blocks(1, 2, 3), fast=False)
    port.wait(0.01)
    arrived = whole()
    answers.append(arrived[: 2 * len(arrived) // 3])
    assert bus.collect() is None
    assert bus.collect() is None
    port.elapse(0.06)
    assert list(bus.collect().statuses) == [1, 2]
