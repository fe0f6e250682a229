"""Calibrating all joints of an emulated rig at once, with hands that move them; and LeRobot's calibrations."""

import json
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.handling import Handling, HandlingError
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, load_rig
from hardware.rig.rig_joint import RigJoint, SecondServo
from hardware.rig.switching.torque import switch_on
from hardware.tools.calibration import Sweep, clear_offsets, load_progress, measured_joint, save_progress
from hardware.tools.doctor import fix_settings
from hardware.tools.lerobot import imported, read_calibration
from hardware.tools.loose_joints import positions
from hardware.tools.rig_writing import rig_of, save_rig, set_port
from hardware.tools.scan import scan
from motiondeck_base.errors import FileFormatError


def passing(config, port, hands, sweep, words, seconds):
    """Has the hands do something while the sweep watches."""
    bus = Bus(port, config.baud)
    hands.command(words)
    for _ in range(round(seconds / 0.05)):
        port.elapse(0.05)
        hands.move([port.bus], port.now())
        for joint, pulses in positions(config, bus):
            sweep.see(joint.name, pulses)


@pytest.fixture
def unknown(rig_of_four):
    """The rig of four as somebody knows it who has only scanned it: zeros, directions and ranges are not known."""
    plain = [
        msgspec.structs.replace(joint, direction=1, zero=2048, lower=-3.1, upper=3.1) for joint in rig_of_four.joints
    ]
    return msgspec.structs.replace(rig_of_four, joints=tuple(plain))


def test_all_joints_are_calibrated_at_once(rig_of_four, unknown, port):
    hands, sweep = Handling(rig_of_four), Sweep(unknown)
    passing(rig_of_four, port, hands, sweep, "move joint_1 0 joint_2 0 joint_3 0 joint_4 0 in 0.2", 0.3)
    for name in unknown.names:
        sweep.forget(name)
        sweep.zero_here(name)
    assert sweep.lacking("joint_2") == "move it to both ends"
    passing(rig_of_four, port, hands, sweep, "move joint_1 1.2 joint_2 0.7 joint_3 -0.8 joint_4 -1 in 0.5", 0.6)
    assert sweep.range_of("joint_2").now == pytest.approx(-0.7, abs=0.01)  # mounted the other way round
    sweep.reverse("joint_2")
    passing(rig_of_four, port, hands, sweep, "move joint_1 -0.4 joint_2 -1.1 joint_3 1.3 joint_4 0.9 in 0.5", 0.6)
    assert [sweep.lacking(name) for name in unknown.names] == [""] * 4
    found, notes = sweep.result()
    assert notes == []
    for joint, true, low, high in zip(
        found.joints, rig_of_four.joints, (-0.4, -1.1, -0.8, -1), (1.2, 0.7, 1.3, 0.9), strict=True
    ):
        assert (joint.zero, joint.direction) == (pytest.approx(true.zero, abs=1), true.direction)
        assert (joint.lower, joint.upper) == pytest.approx((low + 0.02, high - 0.02), abs=5e-3)


def test_a_joint_that_nobody_moved_stays_as_it_was(unknown):
    sweep = Sweep(unknown)
    for name in unknown.names:
        sweep.see(name, 2000)
    with pytest.raises(RigError, match="has not answered"):
        Sweep(unknown).zero_here("joint_1")
    sweep.zero_here("joint_1")
    found, notes = sweep.result()
    assert found == unknown
    assert notes[0] == "joint_1 move it to both ends, it stays as it was"
    assert notes[1] == "joint_2 needs its zero, it stays as it was"


@pytest.mark.parametrize("power_cycle", [0, 4096, -8192])
def test_a_calibration_goes_on_where_it_was_kept(unknown, tmp_path, power_cycle):
    sweep = Sweep(unknown)
    for place in (2000, 1000, 2500):
        sweep.see("joint_1", place)
    sweep.zero_here("joint_1")
    save_progress(sweep, tmp_path / "rig.part")
    whole = (tmp_path / "rig.part").read_text()
    again = load_progress(unknown, tmp_path / "rig.part")
    for place in (2400, 3000):
        again.see("joint_1", place + power_cycle)  # a servo forgets its turns when its power is off
    assert msgspec.structs.astuple(again.measured["joint_1"]) == (1, 1, 2500, 1000, 3000)
    with pytest.raises(RigError, match="other joints"):
        load_progress(unknown.only([0, 1]), tmp_path / "rig.part")
    for damaged in ("{", whole.replace("2500", "1" * 400), whole.replace('"direction": 1', '"direction": 0')):
        assert damaged != whole
        (tmp_path / "rig.part").write_text(damaged)
        with pytest.raises(RigError, match="Remove it to begin anew"):
            load_progress(unknown, tmp_path / "rig.part")
    with pytest.raises(FileFormatError, match="cannot be written"):
        save_progress(sweep, tmp_path / "nowhere" / "rig.part")


@pytest.mark.parametrize(
    ("direction", "zero", "low", "high", "lower", "upper", "lost"),
    [
        (1, 2000, 1000, 3000, -1000, 1000, ""),
        (-1, 2000, 1000, 2500, -500, 1000, ""),
        (1, 2000 - 3 * 4096, 1000 - 3 * 4096, 3000 - 3 * 4096, -1000, 1000, ""),
        (1, 300, -200, 900, -300, 600, "18 degrees at its lower end"),
        (-1, 300, -200, 900, -600, 300, "18 degrees at its upper end"),
        (1, 3900, 3000, 4500, -900, 195, "36 degrees at its upper end"),
        (1, 2000, 2000, 3000, 0, 1000, ""),  # its zero is one of its ends
    ],
)
def test_a_servo_that_counts_no_turns_keeps_what_lies_in_its_one_turn(direction, zero, low, high, lower, upper, lost):
    mx = RigJoint("joint", 1, "MX-64(1.0)", 1, 2048, -1.0, 1.0, 1.0)
    joint, notes = measured_joint(mx, direction, zero, low, high, margin=0.0)
    assert (joint.lower, joint.upper) == pytest.approx((lower * np.pi / 2048, upper * np.pi / 2048), abs=1.1e-3)
    assert [lost in note for note in notes] == ([True] if lost else [])


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("zero", "low", "high"), [(300, -200, 900), (3900 + 4096, 3000 + 4096, 4500 + 4096)])
def test_a_range_across_the_horns_own_zero_is_kept(rig_of_four, direction, zero, low, high):
    joint, notes = measured_joint(rig_of_four.joints[0], direction, zero, low, high, margin=0.0)
    assert (joint.zero, notes, joint.mode) == (zero % 4096, [], 4)
    ends = sorted((np.array([low, high]) - zero) * direction * np.pi / 2048)
    assert (joint.lower, joint.upper) == pytest.approx(ends, abs=1.1e-3)


def test_of_a_whole_turn_a_little_is_given_up_so_that_one_turn_tells_the_place(rig_of_four):
    joint, (note,) = measured_joint(rig_of_four.joints[0], 1, 3000, 1000, 5095, margin=0.0)
    assert not joint.several_turns
    assert note.startswith("joint_1: 3 degrees at each end are given up")


def test_what_another_program_left_is_cleared_before_zeros_are_taken(rig_of_four, bus, port):
    port.bus[2]["homing_offset"], port.bus[3]["drive_mode"] = 700, 1
    assert clear_offsets(rig_of_four, bus) == [
        "joint_2 (id 2): homing_offset was 700 and is 0",
        "joint_3 (id 3): drive_mode was 1 and is 0",
    ]
    assert (port.bus[2]["homing_offset"], port.bus[3]["drive_mode"]) == (0, 0)


# LeRobot's own view of a motor in degrees, written down anew from what its documentation says.
def lerobot_degrees(present, motor):
    return (present - (motor["range_min"] + motor["range_max"]) / 2) * 360 / 4095


MOTORS = {
    "shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1000, "range_min": 700, "range_max": 2600},
    "elbow_flex": {"id": 2, "drive_mode": 1, "homing_offset": 3900, "range_min": 1000, "range_max": 2900},
    "wrist_roll": {"id": 3, "drive_mode": 0, "homing_offset": 300, "range_min": 0, "range_max": 4095},
}


def test_a_calibration_of_lerobot_makes_a_rig_with_its_angles(tmp_path):
    """Also of a reversed joint, and of one whose range is the whole turn elsewhere than the servo's own."""
    file = tmp_path / "koch.json"
    file.write_text(json.dumps(MOTORS))
    limits = {"direction": 1, "zero": 2048, "lower": -3.1, "upper": 3.1, "velocity": 4.0}
    left = RigConfig(
        "p", 1_000_000, 100.0, tuple(RigJoint(name, m["id"], "XL330-M288", **limits) for name, m in MOTORS.items())
    )
    port = EmulatedPort(EmulatedBus(left))
    bus = Bus(port, 1_000_000)
    for motor in MOTORS.values():
        device = port.bus[motor["id"]]
        device["operating_mode"] = 4  # where LeRobot leaves an arm
        device["drive_mode"], device["homing_offset"] = motor["drive_mode"], motor["homing_offset"]
        device.bank.settle()
    modes = {"shoulder_pan": 3, "elbow_flex": 3, "wrist_roll": 4}
    shafts = {1: (1800.0, 3300.0), 2: (1100.0, 2700.0), 3: (100.0, 3700.0)}
    seen = {}
    for name, motor in MOTORS.items():
        device = port.bus[motor["id"]]
        for shaft in shafts[motor["id"]]:
            device.bank.shaft[device.row] = shaft
            port.elapse(0.01)
            present = np.array(device["present_position"]).astype(np.int64).item()
            seen[name, shaft] = np.radians(lerobot_degrees(present, motor))
    found = scan(lambda baud: Bus(port, baud))
    config, notes = imported(read_calibration(file), [one for one in found if one.baud == found[0].baud], "p")
    assert [joint.direction for joint in config.joints] == [1, -1, 1]
    assert {joint.name: joint.mode for joint in config.joints} == modes
    assert ["wrist_roll: 3 degrees at each end" in note for note in notes] == [True]
    save_rig(config, tmp_path / "arm.toml")
    assert load_rig(tmp_path / "arm.toml") == config
    for device in port.bus.devices:
        device.bank.shaft[device.row] = 2000.0
    port.elapse(0.01)
    with pytest.raises(RigError, match="homing_offset is -1000"):
        switch_on(config, bus, np.zeros(len(config.joints)))
    assert fix_settings(config, bus).refused == []
    for name, motor in MOTORS.items():
        (joint,) = (joint for joint in config.joints if joint.name == name)
        device = port.bus[motor["id"]]
        for shaft in shafts[motor["id"]]:
            device.bank.shaft[device.row] = shaft
            port.elapse(0.01)
            angle = (device["present_position"] - joint.zero) / joint.pulses_per_radian
            assert angle == pytest.approx(seen[name, shaft], abs=2e-3)
            assert joint.lower < angle < joint.upper


def test_a_calibration_of_lerobot_knows_its_gripper_and_second_motors(tmp_path):
    motor = {"drive_mode": 0, "homing_offset": 0, "range_min": 1000, "range_max": 3000}
    shadow = motor | {"id": 2, "drive_mode": 1, "homing_offset": 4200}
    motors = {"shoulder": motor | {"id": 1}, "shoulder_shadow": shadow, "gripper": motor | {"id": 3}}
    file = tmp_path / "arm.json"
    file.write_text(json.dumps(motors))
    left = tuple(RigJoint(f"j{id}", id, "XM430-W350", 1, 2048, -1.0, 1.0, 1.0) for id in (1, 2, 3))
    port = EmulatedPort(EmulatedBus(RigConfig("p", 57_600, 100.0, left)))
    found = scan(lambda baud: Bus(port, baud))
    config, notes = imported(read_calibration(file), [one for one in found if one.baud == found[0].baud], "p")
    shoulder, gripper = config.joints
    assert shoulder.second == SecondServo(2, -1, 2200)
    assert (gripper.grip, gripper.current, gripper.mode) == (True, 1.15, 5)
    assert any("gripper grips with 1.15 A" in note for note in notes)
    save_rig(config, tmp_path / "arm.toml")
    assert load_rig(tmp_path / "arm.toml") == config


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[]", "is not a calibration file of LeRobot"),
        ('{"pan": {"id": 1}}', "is not a calibration file of LeRobot"),
        (json.dumps({"pan": MOTORS["elbow_flex"] | {"range_min": 2900}}), "pan has range_min 2900"),
        (json.dumps({"pan": MOTORS["elbow_flex"] | {"range_max": 10**400}}), "`int` <= .*range_max"),
        (json.dumps({"pan": MOTORS["elbow_flex"] | {"homing_offset": 2**40}}), "`int` <= .*homing_offset"),
    ],
)
def test_other_files_are_no_calibration(tmp_path, text, said):
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(RigError, match=said):
        read_calibration(tmp_path / "c.json")
    with pytest.raises(RigError, match="cannot read"):
        read_calibration(tmp_path / "none.json")


def test_motors_that_do_not_answer_are_named(tmp_path):
    (tmp_path / "c.json").write_text(json.dumps(MOTORS))
    with pytest.raises(RigError, match=r"shoulder_pan \(id 1\), elbow_flex \(id 2\).*Check power"):
        imported(read_calibration(tmp_path / "c.json"), [], "/dev/ttyUSB0")


def test_a_rig_file_is_made_of_what_answers(rig_of_four, port, tmp_path):
    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    made, left_out = rig_of(scan(open_bus), "/dev/serial/by-id/usb-U2D2")
    assert (made.names, left_out) == (rig_of_four.names, [])
    assert (made.port, made.baud) == ("/dev/serial/by-id/usb-U2D2", 1_000_000)
    save_rig(made, tmp_path / "rig.toml")
    assert load_rig(tmp_path / "rig.toml") == made
    port.bus[2]["baud_rate"] = 1
    with pytest.raises(RigError, match="answer at 57600 and 1000000 baud"):
        rig_of(scan(open_bus), "p")
    with pytest.raises(RigError, match="no servo answers on p"):
        rig_of([], "p")
    with pytest.raises(FileFormatError, match="cannot be written"):
        save_rig(made, tmp_path / "nowhere" / "rig.toml")


def test_a_port_is_written_into_a_rig_file_and_nothing_else_is_changed(servo20_file, tmp_path):
    path = tmp_path / "rig.toml"
    before = servo20_file.read_text()
    path.write_text(before)
    assert set_port(path, "/dev/serial/by-id/usb-U2D2-port0") == "/dev/ttyUSB0"
    assert load_rig(path).port == "/dev/serial/by-id/usb-U2D2-port0"
    changed = [
        line for line, old in zip(path.read_text().splitlines(), before.splitlines(), strict=True) if line != old
    ]
    assert changed == ['port = "/dev/serial/by-id/usb-U2D2-port0"']
    path.write_text(before.replace("id = 1, ", 'id = 1, port = "/dev/ttyUSB1", '))
    with pytest.raises(RigError, match="has the ports /dev/ttyUSB1, /dev/ttyUSB0"):
        set_port(path, "/dev/ttyUSB2")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "is not understood"),
        ("swing joint_1 0.5", "is not understood"),
        ("swing joint_1 0.5 in 2", "is not understood"),
        ("move elbow 0.5 in 2", "no joint 'elbow': joint_1"),
        ("move joint_1 up in 2", "'up' is not a number"),
        ("move joint_1 1 in 0", "is no time"),
        ("rest now", "is not understood"),
    ],
)
def test_hands_say_what_they_understand(rig_of_four, words, said):
    with pytest.raises(HandlingError, match=said):
        Handling(rig_of_four).command(words)


def test_hands_pull_servos_plug_them_in_and_warm_them(rig_of_four, port):
    hands, servo = Handling(rig_of_four), port.bus[2]
    for words, dead in (("pull joint_2", True), ("plug joint_2", False), ("warm joint_2 71", False)):
        hands.command(words)
        hands.move([port.bus], port.now())
        assert servo.dead == dead
    assert servo.bank.drive.temperature[servo.row] == 71.0


def test_hands_leave_servos_alone_that_hold(rig_of_four, port):
    hands = Handling(rig_of_four)
    hands.command("swing joint_1 0.5 joint_4 0.5 every 1")
    port.bus[4]["torque_enable"] = 1
    places = []
    for _ in range(100):
        port.elapse(0.01)
        hands.move([port.bus], port.now())
        places.append((port.bus[1].bank.shaft[0] - 2048, port.bus[4].bank.shaft[3] - 2048))
    swung, held = np.array(places).T
    assert swung.max() == pytest.approx(0.5 * 4096 / (2 * np.pi), rel=0.01)
    assert abs(swung[-1]) < 2
    assert np.abs(held).max() < 2
    assert max(abs(after - before) for before, after in pairwise(swung)) < 15
    hands.command("rest")
    port.elapse(0.1)
    hands.move([port.bus], port.now())
    assert port.bus[1].bank.shaft[0] - 2048 == pytest.approx(swung[-1], abs=1)


def test_a_servo_that_cannot_be_a_joint_is_left_out_with_its_reason(port):
    """The others are still a rig."""
    port.bus[2].swap(9999, port.now())
    port.bus[3].swap(MODELS["RH-P12-RN"].number, port.now())
    found = scan(lambda baud: Bus(port, baud), [1_000_000])
    made, left_out = rig_of(found, "p")
    assert made.names == ("joint_1", "joint_4")
    assert left_out[0] == "id 2: Motiondeck does not know its model (model number 9999)."
    assert left_out[1].startswith("id 3: model 'RH-P12-RN' cannot be a joint of a rig: ")
    with pytest.raises(RigError, match=r"id 2: .*9999"):
        rig_of(found[1:2], "p")
