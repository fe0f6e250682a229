"""Scanning, examining, setting up and watching, against emulated servos in simulated time."""

from itertools import count
from types import SimpleNamespace

import msgspec
import pytest

from benchmarks.rig._wire_time import rate_limit, read_time, write_time
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus, Identity
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.supervision.rig import Rig
from hardware.tools.doctor import examine, fix_settings, latency_timer, shorten_latency
from hardware.tools.monitor import observe
from hardware.tools.rig_writing import rig_of
from hardware.tools.scan import Found, scan, set_up


@pytest.fixture
def opened(port):
    """Opens the bus at a baud rate, as a serial port would be."""

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    return open_bus


def test_a_scan_finds_servos_at_every_speed(opened, port):
    port.bus[2]["baud_rate"] = 1
    found = scan(opened)
    assert [(one.baud, one.identity.id) for one in found] == [
        (57600, 2),
        (1_000_000, 1),
        (1_000_000, 3),
        (1_000_000, 4),
    ]


@pytest.fixture
def doubled(port):
    """Two servos that differ, and both have ID 1."""
    port.bus[2]["firmware_version"] = 45
    port.bus[2]["id"] = 1
    port.bus.reindex()


def test_two_servos_with_one_id_are_told_from_a_missing_one(rig_of_four, opened, bus, doubled):
    problems = examine(rig_of_four, bus).problems
    assert any(one.startswith("joint_1 (id 1) gives garbled answers: two servos may have its id") for one in problems)
    assert any(one.startswith("joint_2 (id 2) does not answer") for one in problems)
    garbled = []
    assert [one.identity.id for one in scan(opened, [57600, 1_000_000], garbled.append)] == [3, 4]
    assert garbled == [1_000_000]
    with pytest.raises(RigError, match=r"garbled answers from joint_1 \(id 1\).* two servos may have the same id"):
        Rig(rig_of_four, lambda part: bus)


def test_one_of_two_servos_with_one_id_is_not_set_up(rig_of_four, opened, port, doubled):
    port.bus[3].dead = port.bus[4].dead = True
    with pytest.raises(RigError, match="garbled answers at 1000000 baud: two servos may have the same id"):
        set_up(opened, 7, 1_000_000)


def test_a_healthy_rig_has_nothing_but_slow_answers(rig_of_four, bus):
    report = examine(rig_of_four, bus)
    assert [servo.id for servo in report.servos] == [1, 2, 3, 4]
    assert len(report.problems) == 4
    assert all("return_delay_time is 250, the rig needs 0" in problem for problem in report.problems)
    fixed = fix_settings(rig_of_four, bus)
    assert fixed.refused == []
    assert fixed.done[6:9] == [
        "joint_3 (id 3): return_delay_time was 250 and is 0",
        "joint_3 (id 3): min_position_limit was 0 and is 848",
        "joint_3 (id 3): max_position_limit was 4095 and is 2478",
    ]
    assert fix_settings(rig_of_four, bus) == ([], [])
    assert examine(rig_of_four, bus).problems == []
    assert msgspec.json.decode(msgspec.json.encode(report))["servos"][2]["position"] == 0.0


def test_an_examination_names_every_trouble(rig_of_four, bus, port):
    fix_settings(rig_of_four, bus)
    port.bus[1].dead = True
    port.bus[2]["model_number"] = 1060
    port.bus[3].fail(0x20)
    port.bus[4].bank.drive.temperature[3] = 75.0
    port.bus[4].bank.shaft[3] = 4000.0
    port.elapse(0.01)
    slow = msgspec.structs.replace(rig_of_four, rate_hz=1000.0)
    problems = "\n".join(examine(slow, bus).problems)
    for said in (
        "joint_1 (id 1) does not answer",
        "joint_2 (id 2) answers as XL430-W250, not as XM430-W350",
        "joint_3 (id 3) reports overload",
        "joint_4 (id 4) stands at 2.99 rad",
        "joint_4 (id 4) has 75 degC",
        "the wire allows 521 Hz, the rig file has 1000",
    ):
        assert said in problems


def test_settings_stay_where_torque_is_on(rig_of_four, bus, port):
    port.bus[2]["torque_enable"] = 1
    assert fix_settings(rig_of_four, bus).refused == [
        "joint_2 (id 2) has its torque on: motiondeck rig stop takes it off"
    ]


def test_a_port_without_a_latency_timer_has_none(tmp_path):
    assert latency_timer(str(tmp_path)) is None


def test_the_latency_timer_is_set_on_request(tmp_path, monkeypatch, rig_of_four, bus):
    monkeypatch.setattr("hardware.tools.doctor._USB_SERIAL", tmp_path)
    file = tmp_path / "emulated" / "latency_timer"
    assert "has no latency timer" in shorten_latency("emulated")
    file.parent.mkdir()
    file.write_text("16\n")
    fix_settings(rig_of_four, bus)
    assert "holds answers for up to 16 ms" in "".join(examine(rig_of_four, bus).problems)
    assert "was 16 ms and is 1 ms now" in shorten_latency("/dev/emulated")
    assert "is 1 ms already" in shorten_latency("/dev/emulated")
    assert examine(rig_of_four, bus).problems == []
    file.write_text("16\n")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.write_text", refuse)
    assert "stays 16 ms (Permission denied): echo 1 | sudo tee" in shorten_latency("emulated")


def test_one_servo_is_set_up(rig_of_four):
    config = msgspec.structs.replace(rig_of_four, joints=rig_of_four.joints[:1], baud=57600)
    port = EmulatedPort(EmulatedBus(config))

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    before, after = set_up(open_bus, 17, 4_000_000)
    assert (before.baud, before.identity.id, after.id) == (57600, 1, 17)
    assert port.bus[17]["return_delay_time"] == 0
    assert [(one.baud, one.identity.id) for one in scan(open_bus)] == [(4_000_000, 17)]
    port.bus[17].dead = True
    with pytest.raises(RigError, match="no servo answers at any baud rate"):
        set_up(open_bus, 1, 57600)


def test_several_servos_are_not_set_up_at_once(opened, port):
    with pytest.raises(RigError, match="4 servos answer"):
        set_up(opened, 7, 1_000_000)
    assert port.bus[1].id == 1


def test_watching_a_geared_joint_shows_the_joints_own_velocity(rig_of_four, bus, port, monkeypatch):
    monkeypatch.setattr("hardware.tools.monitor._SHOWN_EVERY", 0.0)
    geared = msgspec.structs.replace(rig_of_four.joints[0], gear=2.0)
    config = msgspec.structs.replace(rig_of_four, joints=(geared, *rig_of_four.joints[1:]))
    port.bus[1]["torque_enable"] = 1
    port.bus[1].write(116, (3500).to_bytes(4, "little"))
    port.elapse(0.2)
    (plain, *_), _ = next(observe(rig_of_four, bus))
    (joint, *_), _ = next(observe(config, bus))
    assert plain["velocity"] > 2.0
    assert joint["velocity"] == pytest.approx(plain["velocity"] / 2.0, rel=0.1)


def test_ports_share_the_time_between_two_pictures(rig_of_four, bus, monkeypatch):
    ticks = count(0, 0.01)
    monkeypatch.setattr("hardware.tools.monitor.time", SimpleNamespace(monotonic=lambda: next(ticks)))
    looks = []
    read = bus.bulk_read
    monkeypatch.setattr(bus, "bulk_read", lambda *words: looks.append(words) or read(*words))
    next(observe(rig_of_four, bus))
    alone = len(looks)
    next(observe(rig_of_four, bus, 0.25))
    assert len(looks) - alone == pytest.approx(alone / 4, abs=2)


def test_watching_shows_what_is_measured_and_who_is_silent(rig_of_four, bus, port, monkeypatch):
    monkeypatch.setattr("hardware.tools.monitor._SHOWN_EVERY", 0.0)
    port.bus[2].dead = True
    port.bus[3].fail(0x01)
    rows, _ = next(observe(rig_of_four, bus))
    assert [row["heard"] for row in rows] == [True, False, True, True]
    assert rows[2]["errors"] == "input voltage"
    assert (rows[0]["position"], rows[0]["voltage"], rows[0]["temperature"]) == (0.0, 12.0, 32)


@pytest.mark.parametrize(
    ("length", "fast", "baud", "latency", "delay", "hz"),
    [
        (10, True, 1_000_000, 0.0, 0.0, 229),
        (10, False, 1_000_000, 0.0, 0.0, 176),
        (8, False, 4_000_000, 0.0, 0.0, 758),
        (10, False, 1_000_000, 0.0, 500e-6, 64),
        (10, True, 4_000_000, 1e-3, 0.0, 478),
        (10, False, 2_000_000, 16e-3, 0.0, 53),
    ],
)
def test_the_wires_arithmetic(length, fast, baud, latency, delay, hz):
    assert rate_limit(20, baud, length, fast, delay, latency) == pytest.approx(hz, abs=0.6)
    assert write_time(20, 1_000_000) == pytest.approx(1.14e-3)
    assert read_time(20, 1_000_000, 10) == pytest.approx((34 + 288) * 1e-5)


def test_a_new_rig_leaves_out_what_cannot_be_a_joint_with_the_reason():
    found = [Found(1_000_000, Identity(id, number, 1, False)) for id, number in ((1, 1060), (2, 1700), (3, 9))]
    config, left_out = rig_of(found, "port")
    assert [joint.model for joint in config.joints] == ["XL430-W250"]
    assert "id 2: model XM335-T332 cannot be a joint: of it the maker has published where" in left_out[0]
    assert left_out[1] == "id 3: Motiondeck does not know its model (model number 9)."
