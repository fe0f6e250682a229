"""Servos as other tools leave them: refused or set right at switch-on, named by the audit, and never too fast."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.audit import audit, in_counts, settle
from hardware.tools.doctor import examine, fix_settings, look_elsewhere
from hardware.tools.scan import set_up

LIMIT = 1.5  # rad/s

LEFT_BEHIND = {
    "drive_mode": (4, r"drive_mode is 4, the rig needs 0 \(reversed, led by another servo, with a profile in time,"),
    "homing_offset": (700, r"homing_offset is 700, the rig needs 0 \(its zero is elsewhere"),
    "secondary_id": (2, r"secondary_id is 2, the rig needs 255 \(it also does all that is sent to that ID"),
    "startup_configuration": (1, r"startup_configuration is 1, the rig needs 0"),
    "shutdown": (0, r"shutdown is 0, the rig needs 52"),
    "temperature_limit": (100, r"temperature_limit is 100, the rig needs 80"),
    "pwm_limit": (0, r"pwm_limit is 0, the rig needs 885"),
}
SET_ANYWAY = {
    "operating_mode": 4,
    "status_return_level": 0,
    "goal_pwm": 300,
    "profile_velocity": 0,
    "bus_watchdog": -1,
}


@pytest.fixture
def used_rig():
    """Two joints of 1.5 rad/s, the first of which other tools have used."""
    joints = tuple(RigJoint(f"joint_{id}", id, "XM430-W350", 1, 2048, -1.5, 1.5, LIMIT) for id in (1, 2))
    return RigConfig("emulated", 1_000_000, 100.0, joints)


@pytest.fixture
def port(used_rig):
    return EmulatedPort(EmulatedBus(used_rig))


@pytest.fixture
def bus(port):
    return Bus(port, 1_000_000)


def fastest(rig, port, seconds=2.0):
    """The largest speed of the first shaft while it goes from one end to the other, rad/s."""
    device, shafts = port.bus.devices[0], []
    for _ in range(round(seconds / 0.01)):
        rig.collect_state()
        rig.write(np.full(2, 1.4))
        port.elapse(0.01)
        shafts.append(float(device.bank.shaft[device.row]))
    return float(np.abs(np.diff(shafts)).max()) / 0.01 * 2.0 * np.pi / 4096


# What the doctor says of a servo as LeRobot or DYNAMIXEL Wizard leave it, and whether it must be mended first.
AS_OTHER_TOOLS_LEAVE_IT = {
    "time-based profile": ({"drive_mode": 4}, "drive_mode is 4, the rig needs 0", "refused"),
    "homing offset": ({"homing_offset": 700}, "homing_offset is 700, the rig needs 0", "refused"),
    "reversed": ({"drive_mode": 1}, "drive_mode is 1, the rig needs 0", "refused"),
    "extended position": ({"operating_mode": 4}, "operating_mode is 4, the rig needs 3", "mended"),
    "status return level 0": ({"status_return_level": 0}, "its status_return_level is 0", "mended"),
    "from the box": ({"baud_rate": 1}, "XM430-W350 answers as id 1 at 57600 baud", "refused"),
    "another id": ({"id": 77}, "XM430-W350 answers as id 77 at 1000000 baud: connect it alone", "refused"),
    "Protocol 1.0": ({"protocol_type": 1}, "XM430-W350 answers as id 1 at 1000000 baud in Protocol 1.0", "refused"),
}


@pytest.mark.thorough
@pytest.mark.parametrize("left", AS_OTHER_TOOLS_LEAVE_IT)
def test_what_other_tools_leave_is_named_and_refused_or_mended_and_never_too_fast(used_rig, port, left):
    settings, said, then = AS_OTHER_TOOLS_LEAVE_IT[left]
    for register, value in settings.items():
        port.bus.devices[0][register] = value
    port.bus.reindex()

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    report = examine(used_rig, open_bus(used_rig.baud))
    assert said in "\n".join(report.problems + report.notes + look_elsewhere(used_rig, report, open_bus))
    bus = open_bus(used_rig.baud)
    if then == "refused":
        with pytest.raises(RigError, match=r"joint_1 \(id 1\)"):
            Rig(used_rig, lambda part: bus)
        assert [device["torque_enable"] for device in port.bus.devices] == [0, 0]
        if settings.keys() & {"baud_rate", "id", "protocol_type"}:
            port.bus[2].dead = True  # one servo at a time
            set_up(open_bus, 1, used_rig.baud)
            port.bus[2].dead = False
        else:
            assert fix_settings(used_rig, bus).refused == []
    rig = Rig(used_rig, lambda part: open_bus(part.baud))
    assert fastest(rig, port) < 1.05 * LIMIT
    assert rig.positions == pytest.approx([1.4, 1.4], abs=0.01)


@pytest.mark.parametrize(
    ("register", "sound", "unsound"),
    [("temperature_limit", (40, 80), (39, 81)), ("secondary_id", (253, 255), (0, 252))],
)
def test_a_register_is_refused_from_its_first_unsound_value_on(used_rig, port, bus, register, sound, unsound):
    for value in (*sound, *unsound):
        port.bus[1][register] = value
        refused = [difference for difference in audit(used_rig, bus) if difference.register == register]
        assert bool(refused) == (value in unsound), value


@pytest.mark.parametrize("model", ["XM430-W350", "AX-12A", "XL-320", "PH54-200-S500"])
@pytest.mark.parametrize("level", [0, 1])
def test_the_doctor_lists_the_status_return_level_that_it_has_set(model, level):
    joint = RigJoint("joint_1", 1, model, 1, 512, -0.5, 0.5, 0.5)
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
    port = EmulatedPort(EmulatedBus(config), paced=True)
    bus = Bus(port, 1_000_000)
    bus.families = config.families
    assert not any("status_return_level" in line for line in fix_settings(config, bus).done)
    port.bus[1]["status_return_level"] = level
    report = examine(config, bus)
    assert any(f"status_return_level is {level}, the rig needs 2" in line for line in report.problems + report.notes)
    assert f"joint_1 (id 1): status_return_level was {level} and is 2" in fix_settings(config, bus).done


@pytest.mark.parametrize("model", ["AX-12A", "MX-28(1.0)"])
def test_a_locked_eeprom_is_named_with_the_remedy(model):
    joint = RigJoint("joint_1", 1, model, 1, 512, -0.5, 0.5, 0.5)
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
    port = EmulatedPort(EmulatedBus(config), paced=True)
    bus = Bus(port, 1_000_000)
    bus.families = config.families
    port.bus[1]["lock"] = 1
    said = r"id 1 keeps its EEPROM locked, and its {} cannot be set: switch its power off and on"
    assert said.format("return_delay_time") in "".join(fix_settings(config, bus).refused)
    with pytest.raises(RigError, match=said.format("min_position_limit")):
        Rig(config, lambda part: bus)
    port.bus[1].reboot(port.now())
    assert fix_settings(config, bus).refused == []
    Rig(config, lambda part: bus)


@pytest.mark.parametrize("model", ["XM430-W350", "XL330-M288", "AX-12A", "PH54-200-S500"])
def test_a_speed_or_acceleration_between_two_counts_of_a_register_is_kept(model):
    one_speed = RigJoint("joint_1", 1, model, 1, 512, -0.5, 0.5, 1.0).table["profile_velocity"].si
    slow = RigJoint("joint_1", 1, model, 1, 512, -0.5, 0.5, 1.7 * one_speed)
    assert in_counts(slow, "profile_velocity", slow.velocity) == 1
    fast = RigJoint("joint_1", 1, model, 1, 512, -0.5, 0.5, 195.99 * one_speed)
    assert in_counts(fast, "profile_velocity", fast.velocity) == 196  # within 1 % of the limit


def test_the_doctor_mends_a_servo_that_answers_no_read(used_rig, port, bus):
    port.bus[1]["status_return_level"] = 0
    assert fix_settings(used_rig, bus).refused == []
    assert [servo.id for servo in examine(used_rig, bus).servos] == [1, 2]


@pytest.mark.thorough
@pytest.mark.parametrize("register", LEFT_BEHIND)
def test_what_could_move_a_joint_wrongly_is_refused_and_named_and_fixed_on_request(used_rig, port, bus, register):
    value, said = LEFT_BEHIND[register]
    port.bus[1][register] = value
    port.bus.reindex()
    with pytest.raises(RigError, match=r"joint_1 \(id 1\): " + said):
        Rig(used_rig, lambda part: bus)
    assert [port.bus[id]["torque_enable"] for id in (1, 2)] == [0, 0]
    assert port.bus[1][register] == value
    assert any(register in problem and "--fix sets it" in problem for problem in examine(used_rig, bus).problems)
    assert fix_settings(used_rig, bus).refused == []
    assert audit(used_rig, bus) == []
    assert fastest(Rig(used_rig, lambda part: bus), port) < 1.05 * LIMIT


@pytest.mark.thorough
@pytest.mark.parametrize("register", SET_ANYWAY)
def test_what_the_rig_file_states_or_is_in_ram_is_set_at_switch_on(used_rig, port, bus, register):
    port.bus[1][register] = SET_ANYWAY[register]
    rig = Rig(used_rig, lambda part: bus)
    assert fastest(rig, port) < 1.05 * LIMIT
    assert [difference for difference in audit(used_rig, bus) if difference.when == "switch-on"] == []
    assert rig.positions == pytest.approx([1.4, 1.4], abs=0.01)


def test_a_weaker_or_slower_servo_is_advice_only(used_rig, port, bus):
    port.bus[1]["pwm_limit"], port.bus[1]["velocity_limit"] = 600, 20
    problems = "\n".join(examine(used_rig, bus).problems)
    assert "pwm_limit is 600, the rig needs 885 (it is weaker than its model)" in problems
    assert "velocity_limit is 20" in problems
    Rig(used_rig, lambda part: bus)


def test_a_weak_servo_is_as_strong_as_its_model_after_one_fix(used_rig, port, bus):
    """Its goal PWM follows the limit that is set with it."""
    port.bus[1]["pwm_limit"] = port.bus[1]["goal_pwm"] = 100
    fix_settings(used_rig, bus)
    assert (port.bus[1]["pwm_limit"], port.bus[1]["goal_pwm"]) == (885, 885)
    assert audit(used_rig, bus) == []


@pytest.mark.parametrize(("register", "value"), [("drive_mode", 1), ("homing_offset", 1000)])
def test_a_position_that_a_setting_falsifies_is_no_problem_of_its_own(used_rig, port, bus, register, value):
    """To move the joint by hand, as is said of one outside its limits, would be wrong."""
    port.bus[1][register] = value
    port.elapse(0.01)
    problems = examine(used_rig, bus).problems
    assert any(register in problem for problem in problems)
    assert not any("stands at" in problem for problem in problems)


def test_a_servo_that_has_counted_turns_is_where_position_mode_will_show_it(used_rig, port, bus):
    port.bus[1]["operating_mode"] = 4
    bank = port.bus.devices[0].bank
    bank.shaft[0] = 2048 + 3 * 4096 + 300
    port.elapse(0.01)
    report = examine(used_rig, bus)
    assert report.servos[0].position == pytest.approx(300 * 2 * np.pi / 4096)
    assert not any("stands at" in problem for problem in report.problems)
    Rig(used_rig, lambda part: bus).close()
    assert examine(used_rig, bus).servos[0].position == pytest.approx(300 * 2 * np.pi / 4096)
    port.bus[1]["operating_mode"] = 4
    bank.shaft[0] = 2048 + 4096 + 1200
    port.elapse(0.01)
    assert any("joint_1 (id 1) stands at 1.84 rad" in problem for problem in examine(used_rig, bus).problems)


@pytest.mark.parametrize(
    ("register", "value", "said"),
    [
        ("min_voltage_limit", 140, "input voltage (12.0 V; its own limits are 14.0 and 16.0 V)"),
        ("temperature_limit", 30, "overheated (32 degC; its own limit is 30 degC)"),
    ],
)
def test_a_servo_in_trouble_is_told_with_the_limit_that_it_keeps(used_rig, port, bus, register, value, said):
    port.bus[1][register] = value
    port.elapse(0.1)
    assert any(f"joint_1 (id 1) reports {said}" in problem for problem in examine(used_rig, bus).problems)


def test_nothing_is_written_where_nothing_differs(used_rig, port, bus):
    settle(audit(used_rig, bus), used_rig, bus)
    port.sent.clear()
    settle(audit(used_rig, bus), used_rig, bus)
    assert len(port.sent) == 4  # two blocks a servo, read


def test_every_difference_of_every_joint_is_in_one_message(used_rig, port, bus):
    port.bus[1]["drive_mode"], port.bus[2]["homing_offset"] = 1, -300
    with pytest.raises(RigError, match=r"joint_1 .*drive_mode is 1.*; joint_2 .*homing_offset is -300.*--fix"):
        Rig(used_rig, lambda part: bus)
