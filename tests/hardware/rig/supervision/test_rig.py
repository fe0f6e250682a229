"""A rig that looks after itself, in simulated time: what it mends, what stops it, and what it never lets out."""

import threading
from itertools import count

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.errors import RigError, SerialPortError
from hardware.families.dynamixel2.frames import Parser
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.rig.supervision.servo_states import CONDITIONS
from hardware.rig.switching.torque import speed_counts

TICK = 0.01


@pytest.fixture
def build(rig_of_four):
    """A supervised rig on emulated servos with faults, and its port."""

    def make(*faults, **settings):
        config = msgspec.structs.replace(rig_of_four, **settings)
        plan = FaultPlan([parse_fault(fault) for fault in faults])
        port = EmulatedPort(EmulatedBus(config), paced=True, faults=plan)

        def open_bus():
            port.receive()
            return Bus(port, config.baud)

        return Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse), port

    return make


def play(rig, port, targets, seconds):
    """Runs the loop; for how long the joints were more than 0.05 rad off at the end of it."""
    off = 0.0
    for _ in range(round(seconds / TICK)):
        rig.collect_state()
        rig.write(np.asarray(targets, dtype=float))
        port.elapse(TICK)
        off = off + TICK if np.abs(rig.positions - targets).max() > 0.05 else 0.0
    return off


def test_without_faults_it_is_the_rig_it_looks_after(build):
    rig, port = build()
    assert play(rig, port, [0.5, 0.4, -0.3, 0.0], 2.0) == 0.0
    assert (rig.recoveries, rig.faults.total) == (0, 0)
    assert rig.temperatures == pytest.approx([32.0] * 4, abs=1.0)
    assert rig.close() == []


@pytest.mark.thorough
@pytest.mark.parametrize(
    "fault",
    [
        "reboot:id=2,at=1",
        "brownout:at=1,for=0.2",
        "unplug:at=1,for=1",
        "drop:at=1,for=1,chance=0.8",
        "dead:id=4,at=1,for=0.7",
    ],
)
def test_what_passes_is_mended_within_two_seconds(build, fault):
    rig, port = build(fault)
    play(rig, port, [0.3] * 4, 3.0)
    assert play(rig, port, [0.3] * 4, 1.0) == 0.0
    assert all(port.bus[id]["torque_enable"] for id in (1, 2, 3, 4))


@pytest.mark.parametrize(("rate", "silence"), [(20.0, 0.5), (20.0, 1.2), (100.0, 1.3)])
def test_a_servo_that_answers_again_in_time_is_not_lost(build, rate, silence):
    """A silent one was asked once in 50 ticks: at 20 Hz never again before it was given up."""
    rig, port = build(f"dead:id=2,at=1,for={silence}", rate_hz=rate)
    for _ in range(round(4.0 * rate)):
        rig.collect_state()
        rig.write(np.full(4, 0.3))
        port.elapse(1.0 / rate)
    assert rig.recoveries == 1
    assert rig.positions == pytest.approx(np.full(4, 0.3), abs=0.02)


def test_a_rig_that_is_read_rarely_plays_on_and_finds_a_joint_that_does_not_follow(build):
    """A position of a second ago was taken for one that does not change, and the run ended."""
    rig, port = build(read_hz=1.0)
    for tick in range(250):
        play(rig, port, np.full(4, 0.5 * np.sin(2.0 * TICK * tick)), TICK)
    assert (rig.recoveries, list(rig.incidents)) == (0, [])
    port.bus[2]["goal_pwm"] = 0
    with pytest.raises(RigError, match=r"joint_2 \(id 2\) does not follow its target"):
        play(rig, port, [1.0] * 4, 6.0)


def test_how_long_a_port_is_looked_for_is_the_ports_own_time(build, monkeypatch):
    """A simulated rig must not depend on how fast the machine computes it."""
    monkeypatch.setattr("time.monotonic", count(0.0, 100.0).__next__)
    rig, port = build("unplug:at=0.5,for=1", reconnect_s=3.0)
    play(rig, port, [0.3] * 4, 2.5)
    assert rig.recoveries == 1
    port.wire.faults.unplugged = True
    with pytest.raises(RigError, match="the rig has stopped: the port emulated is gone"):
        play(rig, port, [0.3] * 4, 5.0)


def test_a_stalled_loop_starts_again_from_where_the_joints_stand_and_slowly(build):
    rig, port = build()
    play(rig, port, [0.0] * 4, 0.5)
    port.elapse(0.5)
    rig.write(np.full(4, 1.0))
    assert rig.faults.unsent.tolist() == [1] * 4
    rig.collect_state()
    assert rig.recoveries == 1
    assert (rig.pace.part == 0.25).all()
    play(rig, port, [1.0] * 4, 0.3)
    # A quarter of 4 rad/s for 0.3 s.
    assert (rig.positions < 0.35).all()
    assert play(rig, port, [1.0] * 4, 2.0) == 0.0
    assert (rig.pace.part == 1.0).all()


def test_a_joint_that_turns_back_while_it_catches_up_does_not_hurry(build):
    """With an acceleration limit its own path turns back later than its goal, and went after it 1.6 times as fast."""
    joint = RigJoint("hand", 1, "XM430-W350", 1, 2048, -1.3, 1.3, velocity=2.5, acceleration=4.0)
    rig, port = build("dead:id=1,at=2.5,for=0.5", joints=(joint,))
    drive, fastest = port.bus.devices[0].bank.drive, 0.0
    play(rig, port, [-1.2], 2.6)
    play(rig, port, [1.2], 2.5)
    assert rig.recoveries == 1
    for _ in range(150):
        play(rig, port, [-1.2], TICK)
        fastest = max(fastest, abs(float(drive.speed[0])) / joint.pulses_per_radian)
    assert 0.9 * 0.25 * 2.5 < fastest < 1.1 * 0.25 * 2.5
    play(rig, port, [-1.2], 1.0)
    play(rig, port, [1.2], 0.8)
    assert drive.speed[0] / joint.pulses_per_radian > 0.9 * 2.5


@pytest.mark.parametrize("back", [0.3, 0.6])
def test_a_joint_whose_goal_arrives_before_it_does_not_hurry_after_it(build, back):
    """The port is lost in full swing: the joint runs on past its target, and the goal has gone back there meanwhile."""
    joint = RigJoint("hand", 1, "XM430-W350", 1, 2048, -1.3, 1.3, velocity=2.5, acceleration=4.0)
    rig, port = build("unplug:at=2.3,for=0.05", joints=(joint,))
    drive, speeds = port.bus.devices[0].bank.drive, []
    play(rig, port, [-1.2], 1.8)
    play(rig, port, [1.2], 0.5)
    assert rig.recoveries == 1
    target = float(rig.goals[0]) - back
    for _ in range(250):
        play(rig, port, [target], TICK)
        speeds.append(float(drive.speed[0]) / joint.pulses_per_radian)
    assert max(speeds) > 1.5  # it was still turning away
    quarter, swing = 0.25 * 2.5, 0.1  # rad/s; a shaft swings about its path
    assert quarter - swing < -min(speeds) < quarter + swing
    assert abs(rig.positions[0] - target) < 0.02
    assert (rig.pace.part == 1.0).all()


def test_a_joint_has_caught_up_with_a_target_that_stands_only_when_it_is_there(build):
    """It was let go 0.14 rad before, and when the target then jumped to the other end, it went there at full speed."""
    joint = RigJoint("hand", 1, "MX-64", 1, 2048, -1.3, 1.3, velocity=2.5, acceleration=4.0)
    rig, port = build("dead:id=1,at=2.5,for=0.5", joints=(joint,))
    play(rig, port, [-1.2], 2.6)
    play(rig, port, [1.2], 1.0)
    assert rig.pace.part[0] == 0.25
    while rig.pace.part[0] < 1.0:
        play(rig, port, [1.2], TICK)
    assert abs(rig.positions[0] - 1.2) < 0.06


@pytest.mark.thorough
@pytest.mark.parametrize(("at", "misled"), [(0.55, 0.0), (0.75, 0.0), (0.95, 0.0), (1.09, 0.1)])
def test_a_servo_that_takes_the_id_of_a_faster_joint_keeps_its_own_speed(build, rig_of_four, at, misled):
    """It shares that joint's goals then. Only if speeds are just under way does it take them, for less than 0.1 s."""
    joints = [msgspec.structs.replace(joint, zero=2048, lower=-1.5) for joint in rig_of_four.joints]
    joints[2] = msgspec.structs.replace(joints[2], velocity=0.8)
    rig, port = build(f"duplicate:id=3,at={at},for=0.8", joints=tuple(joints))
    slow, own, misled_for, fastest = port.bus.devices[2], speed_counts(joints[2], 1.0), 0.0, 0.0
    began = port.now()
    while (now := port.now() - began) < 2.5:
        rig.collect_state()
        rig.write(np.full(4, np.sin(3.0 * now)))
        port.elapse(TICK)
        misled_for += TICK * (slow["profile_velocity"] > own)
        fastest = max(fastest, abs(slow.bank.drive.speed[slow.row]) / joints[2].pulses_per_radian)
    assert (misled_for > 0.0) == (misled > 0.0)
    assert misled_for <= misled
    assert misled_for or fastest < 1.1 * 0.8
    assert slow.id == 3
    assert play(rig, port, [0.0] * 4, 3.0) == 0.0


def test_a_short_stall_while_catching_up_is_no_reason_for_a_large_step(build):
    """0.12 s is too short for the watchdogs; a servo would take the whole step at its own speed limit."""
    rig, port = build()
    play(rig, port, [0.0] * 4, 0.5)
    port.elapse(0.5)
    play(rig, port, [1.4] * 4, 0.2)
    assert (rig.pace.part == 0.25).all()
    before = rig.goals.copy()
    port.elapse(0.12)
    play(rig, port, [1.4] * 4, TICK)
    # Two ticks at a quarter of 4 rad/s.
    assert (rig.goals - before).max() <= 0.25 * 4.0 * 2 * TICK + 1e-9


@pytest.mark.parametrize("model", ["XM430-W350", "XL330-M288", "MX-64"])
@pytest.mark.parametrize("cause", ["another restarts", "the end"])
def test_a_moving_joint_that_has_to_hold_brakes_without_turning_back(build, rig_of_four, model, cause):
    """Its goal must not be nearer than it can stop: a servo would hurry back there."""
    joints = tuple(
        msgspec.structs.replace(joint, model=model, velocity=2.5, acceleration=20.0) for joint in rig_of_four.joints
    )
    rig, port = build(*(["reboot:id=4,at=0.2"] if cause == "another restarts" else []), joints=joints, on_exit="hold")
    angles = []

    def play_on(ticks):
        for _ in range(ticks):
            play(rig, port, [1.4, 1.4, 1.4, 0.0], TICK)
            bank = port.bus[1].bank
            angles.append(2.0 * np.pi * bank.shaft[port.bus[1].row] / bank.table.pulses_per_turn)

    play_on(30)
    if cause == "the end":
        rig.close()
    play_on(60)
    assert rig.recoveries == (cause == "another restarts")
    assert 0.5 < angles[-1] - angles[0] < 1.3
    assert np.diff(angles).min() > -0.002


def test_a_target_beyond_a_limit_does_not_keep_a_joint_slow_after_a_recovery(build):
    rig, port = build()
    play(rig, port, [1.5] * 4, 1.0)
    port.elapse(0.5)
    play(rig, port, [3.0] * 4, 0.3)
    assert rig.recoveries == 1
    assert (rig.pace.part == 1.0).all()


def test_a_servo_in_another_ones_place_is_not_switched_on_after_replugging(build):
    rig, port = build("unplug:at=1,for=0.5", reconnect_s=1.5)
    play(rig, port, [0.1] * 4, 0.9)
    port.bus[3]["model_number"] = 1060
    with pytest.raises(RigError, match=r"the rig has stopped: joint_3 \(id 3\) answers as XL430-W250"):
        play(rig, port, [0.1] * 4, 5.0)
    sent = len(port.sent)
    play(rig, port, [0.1] * 4, 0.5)
    assert len(port.sent) == sent


def test_a_servo_with_lost_settings_gets_them_again(build):
    rig, port = build("unplug:at=0.5,for=0.5")
    play(rig, port, [0.1] * 4, 0.4)
    for name, value in (("torque_enable", 0), ("max_position_limit", 4095)):
        port.bus[2][name] = value
    play(rig, port, [0.1] * 4, 4.0)
    assert port.bus[2]["max_position_limit"] == 3026
    assert port.bus[2]["torque_enable"] == 1


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("dead:id=2,at=0.5", r"joint_2 \(id 2\) does not answer"),
        ("overheat:id=3,at=0.5", r"joint_3 \(id 3\) has shut down: overheated"),
        ("alert:id=4,at=0.5,value=32", r"joint_4 \(id 4\) has shut down: overload"),
        ("unplug:at=0.5", "the port emulated is gone"),
    ],
)
def test_what_lasts_ends_in_a_stop_that_names_it_once(build, fault, said):
    rig, port = build(fault, reconnect_s=1.0)
    with pytest.raises(RigError, match=said):
        play(rig, port, [0.3] * 4, 6.0)
    play(rig, port, [1.4] * 4, 1.0)
    assert not any(device.moving for device in port.bus.devices)
    rig.close()


def test_without_a_wish_to_reconnect_a_vanished_port_stops_it_at_once(build):
    rig, port = build("unplug:at=0.5,for=0.2", reconnect_s=0.0)
    with pytest.raises(RigError, match="is gone"):
        play(rig, port, [0.3] * 4, 2.0)


def test_a_rig_file_may_ask_to_go_on_without_a_joint(build):
    rig, port = build("dead:id=2,at=0.5", on_loss="go on")
    play(rig, port, [0.3] * 4, 4.0)
    assert rig.positions[[0, 2, 3]] == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize(("degrees", "part"), [(67.0, 1.0), (73.0, 0.5), (77.5, 0.25)])
def test_heat_slows_a_joint_from_12_to_2_degrees_below_its_limit(build, degrees, part):
    """An XM430 shuts down at 80 degC."""
    rig, port = build(f"overheat:id=1,at=0.5,value={degrees}")
    play(rig, port, [0.0] * 4, 0.6)
    assert rig.pace.part == pytest.approx([part, 1.0, 1.0, 1.0], abs=0.06)


def test_only_the_eased_joint_is_held_back_and_by_its_own_speed(build):
    rig, port = build("overheat:id=1,at=0.1,value=79")
    play(rig, port, [0.0] * 4, 0.5)
    play(rig, port, [1.0] * 4, 0.1)
    # 4 rad/s for 0.1 s, and a quarter of it.
    assert rig.goals == pytest.approx([0.1, 0.4, 0.4, 0.4], abs=0.02)


@pytest.mark.parametrize(("model", "volts"), [("XL-320", 4.0), ("XM430-W350", 6.0), ("AX-12A", 6.0)])
def test_a_joint_does_not_hurry_when_its_supply_is_back(build, model, volts):
    """A shaft at half the voltage is twice as far behind its path, and makes up for it at 1.5 times its speed."""
    joint = RigJoint("hand", 1, model, 1, sum(MODELS[model].one_turn) // 2, -1.3, 1.3, velocity=2.5)
    rig, port = build(f"brownout:at=1.2,for=0.5,value={volts}", joints=(joint,))
    drive, fastest = port.bus.devices[0].bank.drive, 0.0
    play(rig, port, [-1.2], 1.2)
    for _ in range(160):
        play(rig, port, [1.2], TICK)
        fastest = max(fastest, float(drive.speed[0]) / joint.pulses_per_radian)
    assert rig.positions[0] == pytest.approx(1.2, abs=0.02)
    assert 0.9 * 2.5 < fastest < 1.1 * 2.5


def test_a_servo_heard_again_before_its_watchdog_has_tripped_is_left_alone(build):
    rig, port = build("dead:id=2,at=0.5,for=0.1")
    play(rig, port, [0.2] * 4, 2.0)
    assert rig.recoveries == 0


def test_a_hot_joint_gets_slower_before_it_shuts_down(build):
    rig, port = build("overheat:id=1,at=0.5,value=76")
    play(rig, port, [0.0] * 4, 1.0)
    assert rig.pace.part[0] < 0.5
    assert (rig.pace.part[1:] == 1.0).all()
    play(rig, port, [1.0] * 4, 0.4)
    assert rig.positions[0] < 0.7 * rig.positions[3]
    assert play(rig, port, [1.0] * 4, 2.0) == 0.0


@pytest.mark.thorough
def test_a_blocked_joint_yields_before_it_shuts_down_and_catches_up_when_it_is_free(build):
    rig, port = build("jam:id=1,at=0.5,for=6")
    play(rig, port, [0.0] * 4, 0.6)
    play(rig, port, [1.0] * 4, 4.0)
    assert (
        rig.pace.strain.yielding.tolist() == [True, False, False, False] or np.abs(rig.currents[0]) < 0.75 * 0.8 * 2.3
    )
    assert port.bus[1]["hardware_error_status"] == 0
    assert rig.positions[1:] == pytest.approx([1.0] * 3, abs=0.02)
    play(rig, port, [1.0] * 4, 4.0)
    assert rig.positions == pytest.approx([1.0] * 4, abs=0.02)
    assert not rig.pace.strain.yielding.any()


def test_it_may_hold_in_the_end(build):
    rig, port = build(on_exit="hold")
    play(rig, port, [0.3] * 4, 1.0)
    assert rig.close() == []
    port.elapse(1.0)
    assert [port.bus[id]["torque_enable"] for id in (1, 2, 3, 4)] == [1] * 4
    assert port.bus[1]["present_position"] == pytest.approx(2048 + 0.3 * 2048 / np.pi, abs=1)


def test_a_dead_servo_is_named_in_the_end_and_the_others_go_on_holding(build):
    rig, port = build(on_exit="hold", on_loss="go on")
    play(rig, port, [0.3] * 4, 1.0)
    port.bus[2].dead = True
    assert rig.close() == ["joint_2"]
    port.elapse(1.0)
    for id in (1, 3, 4):
        assert (port.bus[id]["torque_enable"], port.bus[id]["bus_watchdog"]) == (1, 0)
    assert port.bus[1]["present_position"] == pytest.approx(2048 + 0.3 * 2048 / np.pi, abs=1)


def test_the_state_is_read_less_often_than_targets_are_sent(build):
    rig, port = build(read_hz=20.0)
    port.sent.clear()
    play(rig, port, [0.0] * 4, 2.0)
    said = [(frame.instruction, frame.params[0]) for frame in Parser().feed(b"".join(port.sent))]
    assert said.count((0x83, 116)) == pytest.approx(200, abs=2)  # goals
    assert [instruction for instruction, _ in said].count(0x8A) == pytest.approx(40, abs=2)


def test_a_servo_cut_off_for_longer_than_its_watchdog_follows_again(rig_of_four):
    port = EmulatedPort(EmulatedBus(rig_of_four), faults=FaultPlan([parse_fault("dead:id=2,at=1,for=0.7")]))
    rig = Rig(rig_of_four, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
    play(rig, port, [0.0] * 4, 1.6)
    play(rig, port, [0.3] * 4, 2.5)
    assert rig.positions == pytest.approx(0.3, abs=0.01)
    assert rig.recoveries == 1


def test_a_recovery_beside_the_loop_never_holds_it_up(rig_of_four):
    port = EmulatedPort(EmulatedBus(rig_of_four))
    rig = Rig(rig_of_four, lambda part: Bus(port, part.baud))
    play(rig, port, [0.0] * 4, 0.2)
    port.elapse(0.5)
    rig.write(np.zeros(4))
    for thread in threading.enumerate():
        if thread.name == "rig-recovery":
            thread.join()
    play(rig, port, [0.2] * 4, 1.0)
    assert rig.recoveries == 1
    assert rig.positions == pytest.approx(0.2, abs=0.01)
    assert rig.close() == []


@pytest.mark.parametrize("seconds", [0.6, 2.5])
def test_a_vanished_port_is_waited_for_as_long_as_the_rig_file_asks(build, seconds):
    rig, port = build("unplug:at=0.5", reconnect_s=seconds)
    with pytest.raises(RigError, match="is gone"):
        play(rig, port, [0.1] * 4, 5.0)
    assert port.now() - 0.5 == pytest.approx(seconds, abs=0.1)


def test_a_stopped_rig_whose_servo_is_another_one_is_tried_for_two_seconds_and_moves_nobody(build):
    rig, port = build()
    play(rig, port, [0.1] * 4, 0.5)
    port.bus[3]["model_number"] = 1060
    port.elapse(0.5)  # the watchdogs trip
    began = port.now()
    with pytest.raises(RigError, match=r"the rig has stopped: joint_3 \(id 3\) answers as XL430-W250"):
        play(rig, port, [1.0] * 4, 5.0)
    assert 2.0 <= port.now() - began < 4.0
    assert not any(device.moving for device in port.bus.devices)


def test_targets_that_a_rig_takes_no_more_are_counted(build):
    rig, port = build("unplug:at=0.2", reconnect_s=0.0)
    with pytest.raises(RigError):
        play(rig, port, [0.1] * 4, 1.0)
    before = rig.faults.unsent.copy()
    play(rig, port, [0.1] * 4, 10 * TICK)
    assert (rig.faults.unsent - before).tolist() == [10] * 4
    assert not rig.collect_state()


def test_incidents_name_the_port_that_went_and_came(build):
    rig, port = build("unplug:at=0.5,for=0.4", reconnect_s=2.0)
    play(rig, port, [0.1] * 4, 2.0)
    assert rig.recoveries == 1
    happened = [incident.what for incident in rig.incidents if incident.source == "the port emulated"]
    assert happened == ["is gone", "is back"]
    assert [incident.time for incident in rig.incidents] == sorted(incident.time for incident in rig.incidents)


def test_a_port_that_goes_while_torque_is_taken_off_is_named_when_it_comes_as_well(build, monkeypatch):
    rig, port = build()
    play(rig, port, [0.1] * 4, 0.2)
    rig.switch_off(1)

    def vanish(*unsent):
        raise SerialPortError("the port emulated is gone")

    with monkeypatch.context() as patched:
        patched.setattr("hardware.rig.driving.servo_port.sync_write_all", vanish)
        rig.collect_state()
    play(rig, port, [0.1] * 4, 0.2)
    assert [incident.what for incident in rig.incidents] == ["was switched off on command", "is gone", "is back"]


def conditions(rig):
    return [CONDITIONS[place] for place in rig.states.conditions]


def test_a_joint_switched_off_on_command_stays_limp_and_comes_back_slowly(build):
    rig, port = build()
    play(rig, port, [0.3] * 4, 1.0)
    rig.switch_off(1)
    play(rig, port, [0.3] * 4, 1.0)
    assert [port.bus[id]["torque_enable"] for id in (1, 2, 3, 4)] == [1, 0, 1, 1]
    assert conditions(rig) == ["well", "is off on command", "well", "well"]
    assert rig.recoveries == 0
    far = [0.3, 1.3, 0.3, 0.3]
    play(rig, port, far, 0.5)
    rig.set_up_again(1)
    play(rig, port, far, 0.2)
    assert (rig.pace.part[1], rig.positions[1] < 0.6) == (0.25, True)
    assert play(rig, port, far, 2.0) == 0.0
    assert port.bus[2]["torque_enable"] == 1
    assert conditions(rig) == ["well"] * 4


def test_a_servo_restarts_on_command_and_is_set_up_again(build):
    rig, port = build()
    play(rig, port, [0.3] * 4, 1.0)
    rig.restart(2)
    play(rig, port, [0.3] * 4, 2.0)
    assert play(rig, port, [0.3] * 4, 1.0) == 0.0
    assert rig.recoveries >= 1
    assert port.bus[3]["torque_enable"] == 1


@pytest.mark.parametrize(
    ("fault", "condition"),
    [
        ("dead:id=3,at=1", "does not answer"),
        ("overheat:id=3,at=1,value=72", "is getting hot"),
        ("jam:id=3", "gives way"),
    ],
)
def test_the_state_of_a_servo_names_what_is_wrong_within_two_seconds(build, fault, condition):
    rig, port = build(fault, on_loss="go on")
    seen = set()
    for tick in range(30):
        play(rig, port, [0.3, 0.3, 0.3 + 0.4 * (tick > 10), 0.3], 0.1)
        seen.add(conditions(rig)[2])
    assert any(word.startswith(condition) for word in seen), seen
    assert rig.states.goals[0] == pytest.approx(0.3)


@pytest.mark.parametrize("restarts_at", [0.45, 0.5, 0.6, 1.2])
def test_a_servo_that_dies_while_another_is_set_up_again_does_not_end_a_rig_that_is_to_go_on(build, restarts_at):
    rig, port = build("dead:id=2,at=0.5", f"reboot:id=3,at={restarts_at}", on_loss="go on")
    play(rig, port, [0.3] * 4, 7.0)
    assert rig.positions[[0, 2, 3]] == pytest.approx(0.3, abs=0.01)
    assert conditions(rig)[1] == "is lost"


@pytest.mark.parametrize("restarts_at", [0.45, 0.6])
def test_a_servo_that_is_back_from_there_is_set_up_again(build, restarts_at):
    rig, port = build("dead:id=2,at=0.5,for=5", f"reboot:id=3,at={restarts_at}", on_loss="go on")
    play(rig, port, [0.3] * 4, 10.0)
    assert rig.positions == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("other", ["reboot:id=3,at=0.365", "unplug:at=0.4,for=0.5"])
def test_nor_does_one_that_shuts_down_meanwhile(build, other):
    rig, port = build("alert:id=2,at=0.5,value=32", other, on_loss="go on", reconnect_s=1.0)
    play(rig, port, [0.3] * 4, 6.0)
    assert rig.positions[[0, 2, 3]] == pytest.approx(0.3, abs=0.01)
    assert conditions(rig)[1] == "is lost"
    assert "joint_2 (id 2)', what='has shut down; the rig goes on without it" in str(rig.incidents)


def test_a_servo_that_falls_silent_is_not_told_together_with_one_that_was_lost_before(build):
    rig, port = build("dead:id=2,at=0.5", "dead:id=3,at=3", "dead:id=4,at=3", on_loss="go on")
    play(rig, port, [0.3] * 4, 4.0)
    both = ("joint_3 (id 3)", "joint_4 (id 4)")
    assert [one.silent for one in rig.incidents if one.silent] == [("joint_2 (id 2)",), both, both]
