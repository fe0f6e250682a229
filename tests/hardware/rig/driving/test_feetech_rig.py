"""An SO-101 arm of six STS3215, and rigs of several families, on the emulator."""

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, RigJoint, load_rig
from hardware.rig.supervision.rig import Rig
from hardware.tools.backup import back_up, restore
from hardware.tools.calibration import Sweep
from hardware.tools.doctor import examine, fix_settings
from hardware.tools.lerobot import MotorCalibration, imported
from hardware.tools.monitor import observe
from hardware.tools.scan import Found, scan, set_up
from motiondeck_base.shipped import shipped_configs

TICK = 0.01


@pytest.fixture(scope="module")
def so101():
    return load_rig(shipped_configs() / "rigs" / "so101.toml")


@pytest.fixture
def port(so101):
    return EmulatedPort(EmulatedBus(so101), paced=True)


@pytest.fixture
def bus(so101, port):
    bus = Bus(port, so101.baud)
    bus.families = so101.families
    return bus


def supervised(config, port):
    return Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)


def shafts(config, port):
    pairs = zip(config.joints, port.bus.devices, strict=True)
    return np.array([joint.angle(device.bank.shaft[device.row]) for joint, device in pairs])


def play(rig, port, targets, seconds):
    before, fastest = shafts(rig.config, port), 0.0
    for _ in range(round(seconds / TICK)):
        rig.collect_state()
        rig.write(targets)
        port.elapse(TICK)
        now = shafts(rig.config, port)
        fastest, before = max(fastest, np.abs(now - before).max() / TICK), now
    return fastest


def test_the_arm_follows_within_its_speed_and_reports_its_health(so101, port):
    rig = supervised(so101, port)
    targets = np.array([1.0, -0.8, 0.7, -0.6, 1.5, 0.9])
    fastest = play(rig, port, targets, 1.5)
    assert shafts(so101, port) == pytest.approx(targets, abs=0.02)
    assert rig.positions == pytest.approx(targets, abs=0.02)
    assert 2.0 < fastest < 1.1 * 3.0 + 0.1
    assert rig.voltages == pytest.approx(np.full(6, 7.4))
    assert (rig.recoveries, rig.faults.total, list(rig.incidents)) == (0, 0, [])
    assert rig.close() == []
    assert not any(device.torque for device in port.bus.devices)


def test_speed_and_current_have_the_direction_of_the_joint(so101, port):
    joints = tuple(msgspec.structs.replace(joint, direction=-1, lower=-1.5, upper=1.5) for joint in so101.joints)
    rig = supervised(msgspec.structs.replace(so101, joints=joints), port)
    play(rig, port, np.full(6, 1.2), 0.35)
    assert rig.velocities == pytest.approx(np.full(6, 3.0), abs=0.3)
    play(rig, port, np.full(6, -1.2), 0.7)
    assert rig.velocities == pytest.approx(np.full(6, -3.0), abs=0.3)


def test_a_silent_host_leaves_the_arm_at_its_last_goal(so101, port):
    """There is no bus watchdog: the last goal is at most a tick's way ahead of where the joint is."""
    rig = supervised(so101, port)
    play(rig, port, np.full(6, 1.0), 0.2)
    goals = rig.goals.copy()
    port.elapse(2.0)
    assert shafts(so101, port) == pytest.approx(goals, abs=0.02)
    assert np.abs(goals).max() < 0.8


@pytest.mark.parametrize(("fault", "said"), [(4, "overheated"), (32, "overload"), (8, "encoder")])
def test_a_fault_stops_the_arm_with_its_name(so101, port, fault, said):
    rig = supervised(so101, port)
    play(rig, port, np.zeros(6), 0.1)
    port.bus[2].fail(fault)
    with pytest.raises(RigError, match=f"shoulder_lift .*{said}"):
        play(rig, port, np.zeros(6), 0.5)


def test_doctor_monitor_and_backup_know_it(so101, port, bus):
    report = examine(so101, bus)
    assert report.problems == []
    assert [servo.model for servo in report.servos] == ["STS3215"] * 6
    rows, _ = next(observe(so101, bus, share=0.0))
    assert [row["heard"] for row in rows] == [True] * 6
    backup = back_up(so101, bus)
    port.bus[3]["homing_offset"] = 300 | 1 << 11
    assert any("homing_offset was -300 and is 0" in line for line in restore(so101, backup, bus))


LEFT_BEHIND = {
    "homing_offset": (300 | 1 << 11, "homing_offset is -300, the rig needs 0"),
    "phase": (8, "phase is 8, the rig needs 12"),
    "goal_time": (500, "goal_time is 500, the rig needs 0"),
    "control_mode": (1, "control_mode is 1, the rig needs 0"),
    "shutdown": (0, "shutdown is 0, the rig needs 44"),
    "temperature_limit": (90, "temperature_limit is 90, the rig needs 70"),
}


@pytest.mark.parametrize("name", LEFT_BEHIND)
def test_what_an_earlier_program_has_left_is_named_and_set_for_good(so101, port, bus, name):
    count, said = LEFT_BEHIND[name]
    port.bus[2][name] = count
    report = examine(so101, bus)
    assert any(said in line for line in (*report.problems, *report.notes))
    fix_settings(so101, bus)
    port.bus[2].reboot(port.now())
    wanted = so101.joints[1].table[name].default
    assert port.bus[2][name] == wanted
    assert port.bus[2]["lock"] == 1


def test_a_locked_eeprom_forgets_what_is_written_when_power_goes(so101, port, bus):
    table = so101.joints[0].table
    register = table["position_p_gain"]
    bus.write(1, register.address, register.encode(16))
    assert port.bus[1][register.name] == 16
    port.bus[1].reboot(port.now())
    assert port.bus[1][register.name] == 32


def test_a_scan_tells_families_with_the_same_frames_apart():
    joints = tuple(
        RigJoint(f"j{id}", id, model, 1, MODELS[model].one_turn[1] // 2, -1.0, 1.0, 2.0)
        for id, model in ((1, "AX-12A"), (2, "STS3215"), (9, "STS3215"), (4, "XM430-W350"), (5, "MX-28(1.0)"))
    )
    port = EmulatedPort(EmulatedBus(RigConfig("emulated", 1_000_000, 100.0, joints)))
    # Its own bytes where the other family has the ID: both fit, and the model number decides.
    port.bus[2]["model_number"] = 777

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    found = scan(open_bus, bauds=(1_000_000,))
    assert {one.identity.id: one.identity.model for one in found} == {joint.id: joint.model for joint in joints}
    bus = open_bus(1_000_000)
    bus.families = {2: MODELS["AX-12A"].family}
    assert bus.ping(2).model == "STS3215"


def test_a_servo_from_the_box_gets_its_id(so101):
    joint = msgspec.structs.replace(so101.joints[0], id=1)
    port = EmulatedPort(EmulatedBus(RigConfig("emulated", 115_200, 50.0, (joint,))))

    def open_bus(baud):
        port.bus.baud = baud
        return Bus(port, baud)

    before, after = set_up(open_bus, 6, 1_000_000)
    assert (before.identity.id, before.baud, after.id, after.model) == (1, 115_200, 6, "STS3215")
    port.bus[6].reboot(port.now())
    port.elapse(0.2)
    port.bus.reindex()
    bus = open_bus(1_000_000)
    bus.families = {6: after.family}
    assert bus.ping(6) == after


def test_a_sweep_counts_on_where_the_position_begins_anew(so101):
    sweep = Sweep(so101)
    for place in (3900, 4050, 30, 200, 30, 4050, 3000, 2100):
        sweep.see("wrist_roll", place)
    one = sweep.measured["wrist_roll"]
    assert (one.low, one.high) == (2100, 4296)
    sweep.zero_here("wrist_roll")
    config, notes = sweep.result()
    roll = config.joints[4]
    # The middle of its range, 3198, is half a turn from now on.
    assert (roll.homing_offset, roll.zero) == (1150, 2100 - 1150)
    assert roll.in_one_turn
    assert any("homing_offset 1150" in note for note in notes)


def test_a_calibration_of_lerobot_keeps_its_homing_offset(so101, port):
    """LeRobot puts the middle of each range at half a turn by the servo's own offset: present = actual - offset."""
    device = port.bus[5]
    device["homing_offset"] = 900 | 1 << 11  # -900
    device.bank.settle()
    motors = {
        joint.name: MotorCalibration(joint.id, 0, -900 if joint.name == "wrist_roll" else 0, 700, 3400)
        for joint in so101.joints
    }
    found = [Found(1_000_000, one) for one in Bus(port, 1_000_000).ping_each()]
    config, _ = imported(motors, found, "emulated")
    roll = config.joints[4]
    assert (roll.homing_offset, roll.zero) == (-900, 2050)
    rig = supervised(config, port)
    play(rig, port, np.full(6, 0.5), 0.6)
    assert device["present_position"] == pytest.approx(roll.pulses(0.5), abs=8)
    assert device.bank.shaft[device.row] == pytest.approx(roll.pulses(0.5) - 900, abs=8)


MIXED = ("STS3215", "AX-12A", "STS3215", "XM430-W350", "MX-28(1.0)", "XL330-M288", "STS3215")


def test_a_rig_of_several_families_plays():
    joints = tuple(
        RigJoint(f"j{id}", id, model, 1, (MODELS[model].one_turn[1] + 1) // 2, -1.0, 1.0, 2.0)
        for id, model in enumerate(MIXED, 1)
    )
    config = RigConfig("emulated", 1_000_000, 100.0, joints)
    port = EmulatedPort(EmulatedBus(config), paced=True)
    rig = supervised(config, port)
    fastest = play(rig, port, np.full(len(MIXED), 0.6), 1.2)
    assert shafts(config, port) == pytest.approx(np.full(len(MIXED), 0.6), abs=0.02)
    assert rig.positions == pytest.approx(np.full(len(MIXED), 0.6), abs=0.02)
    assert fastest < 1.15 * 2.0 + 0.1
    assert (rig.recoveries, rig.faults.total) == (0, 0)
    port.bus[4].reboot(port.now())
    play(rig, port, np.full(len(MIXED), -0.6), 2.5)
    assert rig.recoveries == 1
    assert shafts(config, port) == pytest.approx(np.full(len(MIXED), -0.6), abs=0.02)
