"""The rig as the loop drives it, against emulated servos in simulated time."""

from contextlib import closing

import msgspec
import numpy as np
import pytest

from hardware.errors import RigError
from hardware.families.dynamixel2.frames import Parser
from hardware.families.frames import SYNC_WRITE, WRITE
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.identities import check_identities, raise_answer_level

TICK = 0.01


@pytest.fixture
def rig(rig_of_four, port, bus):
    return Rig(rig_of_four, lambda part: bus, beside=False, sleep=port.elapse)


@pytest.fixture
def enduring_rig(rig_of_four, port, bus):
    """Goes on without a joint that is lost."""
    config = msgspec.structs.replace(rig_of_four, on_loss="go on")
    return Rig(config, lambda part: bus, beside=False, sleep=port.elapse)


def play(rig, port, targets, ticks=1):
    """Runs the loop; how many of its ticks brought something measured."""
    fresh = 0
    for _ in range(ticks):
        fresh += rig.collect_state()
        rig.write(np.asarray(targets, dtype=float))
        port.elapse(TICK)
    return fresh


def registers(servos, name):
    return [servos[id][name] for id in (1, 2, 3, 4)]


def test_angles_go_out_and_come_back(rig, port):
    targets = [0.5, 0.4, -0.3, 0.0]
    play(rig, port, targets, 150)
    assert np.allclose(rig.positions, targets, atol=2e-3)
    assert np.allclose(registers(port.bus, "present_position"), [2374, 1787, 1304, 2048], atol=1)
    assert rig.faults.by_joint(rig.names) == {}


def test_velocity_and_current_have_the_joints_own_direction(rig, port):
    play(rig, port, [1.0, 1.0, 1.0, 1.0], 15)
    assert (rig.velocities > 1.0).all()
    play(rig, port, [-0.5, -0.5, -0.5, -0.5], 10)
    assert (rig.velocities < -1.0).all()


def test_one_read_of_15_bytes_brings_all_that_is_watched(rig, port):
    """The indirect cells show current, velocity, position, error, temperature, torque and voltage in a row."""
    port.bus[2].fail(0x01)
    port.bus.devices[2].bank.drive.temperature[2] = 41.0
    port.elapse(0.01)
    port.sent.clear()
    rig.request_state()
    port.elapse(0.02)
    assert rig.collect_state()
    (request,) = Parser().feed(b"".join(port.sent))
    assert request.params[:4] == bytes((224, 0, 15, 0))
    assert rig.temperatures.tolist() == [32.0, 32.0, 41.0, 32.0]
    assert rig.measured.errors.tolist() == [0, 1, 0, 0]
    assert rig.measured.torque.all()
    assert rig.voltages.tolist() == [12.0] * 4
    cells = [port.bus[4][f"indirect_address_{cell}"] for cell in range(1, 16)]
    assert cells == [126, 127, 128, 129, 130, 131, 132, 133, 134, 135, 70, 146, 64, 144, 145]


def test_torque_comes_on_where_the_joints_stand(rig_of_four, port, bus):
    """A goal left from before would make the joints lunge."""
    port.bus[1].bank.shaft[:] = [1500.0, 2500.0, 1200.0, 2700.0]
    port.elapse(TICK)
    bus.sync_write(116, 4, b"".join(bytes((id,)) + (3000).to_bytes(4, "little") for id in (1, 2, 3, 4)))
    before = registers(port.bus, "present_position")
    rig = Rig(rig_of_four, lambda part: bus)
    assert registers(port.bus, "torque_enable") == [1, 1, 1, 1]
    for _ in range(50):
        port.elapse(TICK)
        assert registers(port.bus, "present_position") == before
    assert np.allclose(
        rig.positions, [(1500 - 2048), -(2500 - 2048), (1200 - 1500), (2700 - 2048)] * np.full(4, np.pi / 2048)
    )


def test_torque_comes_on_only_after_the_goal(rig_of_four, port, bus):
    Rig(rig_of_four, lambda part: bus)
    frames = list(Parser().feed(b"".join(port.sent)))
    writes = [(frame.id, frame.params[0], frame.params[2:]) for frame in frames if frame.instruction == WRITE]
    on = [frame.params[4] for frame in frames if frame.instruction == SYNC_WRITE and frame.params[5:] == b"\x01"]
    assert on == [1, 2, 3, 4]
    first = next(place for place, frame in enumerate(frames) if frame.params[:1] + frame.params[4:] == b"\x40\x01\x01")
    for id in (1, 2, 3, 4):
        own = [address for to, address, _ in writes if to == id]
        assert own.index(64) < own.index(116)
        assert (id, 64, b"\x01") not in writes
        goal = next(place for place, frame in enumerate(frames) if frame.id == id and frame.params[:1] == b"\x74")
        assert goal < first


@pytest.mark.parametrize("cause", ["reboot", "swap"])
def test_a_servo_that_restarts_while_it_is_switched_on_gets_no_torque(rig_of_four, port, bus, monkeypatch, cause):
    """It has lost its speed limit, and may be another servo than the one whose model was checked."""

    def then_restart(config, bus):
        check_identities(config, bus)
        device = port.bus[3]
        if config.names == ("joint_3",):  # it is set up, and this was the last check
            device.swap(1190, port.now() + 0.1) if cause == "swap" else device.reboot(port.now() + 0.1)

    monkeypatch.setattr("hardware.rig.switching.identities.check_identities", then_restart)
    with pytest.raises(RigError, match=r"joint_3 \(id 3\) has restarted while it was switched on"):
        Rig(rig_of_four, lambda part: bus)
    assert registers(port.bus, "torque_enable") == [0, 0, 0, 0]


def test_a_servo_that_is_swapped_after_its_model_was_checked_gets_no_torque(rig_of_four, port, bus, monkeypatch):
    """It is set up as the one before it would be, with its speed limit."""

    def swap_first(*args):
        port.bus[3].swap(1190, port.now())
        raise_answer_level(*args)

    monkeypatch.setattr("hardware.rig.switching.identities.raise_answer_level", swap_first)
    with pytest.raises(RigError, match=r"joint_3 \(id 3\) answers as XL330-M077, not as XM430-W350"):
        Rig(rig_of_four, lambda part: bus)
    assert registers(port.bus, "torque_enable") == [0, 0, 0, 0]


def test_limits_stand_in_the_servos_too(rig, servos):
    assert registers(servos, "min_position_limit") == [1070, 1070, 848, 1070]
    assert registers(servos, "max_position_limit") == [3026, 3026, 2478, 3026]
    assert set(registers(servos, "profile_velocity")) == {round(4.0 / (0.229 * 2 * np.pi / 60))}


def test_eeprom_is_not_written_again(rig_of_four, port, bus):
    Rig(rig_of_four, lambda part: bus).close()
    port.sent.clear()
    Rig(rig_of_four, lambda part: bus)
    written = {frame.params[0] for frame in Parser().feed(b"".join(port.sent)) if frame.instruction == 0x03}
    assert min(written) >= 64


def test_a_target_beyond_a_limit_is_clipped_and_counted(rig, port):
    play(rig, port, [9.0, -9.0, -9.0, 0.0], 150)
    assert np.allclose(rig.positions, [1.5, -1.5, -1.0, 0.0], atol=2e-3)
    assert rig.faults.clipped.tolist() == [150, 150, 150, 0]
    assert rig.faults.total == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_target_that_is_no_number_leaves_the_goal(rig, port, bad):
    play(rig, port, [0.2, 0.2, 0.2, 0.2], 2)
    goals = registers(port.bus, "goal_position")
    play(rig, port, [bad, 0.2, 0.4, 0.2], 1)
    now = registers(port.bus, "goal_position")
    assert now[0] == goals[0]
    assert now[2] != goals[2]
    assert rig.faults.refused.tolist() == [1, 0, 0, 0]


def test_missing_servos_are_all_named_in_one_error(rig_of_four, port, bus):
    port.bus[2].dead = port.bus[4].dead = True
    with pytest.raises(
        RigError, match=r"no answer on emulated at 1000000 baud from joint_2 \(id 2\), joint_4 \(id 4\)"
    ):
        Rig(rig_of_four, lambda part: bus)


def test_another_model_is_named(rig_of_four, port, bus):
    port.bus[3]["model_number"] = 1060
    with pytest.raises(RigError, match=r"joint_3 \(id 3\) answers as XL430-W250, not as XM430-W350"):
        Rig(rig_of_four, lambda part: bus)


def test_a_servo_in_shutdown_is_named_and_no_torque_comes_on(rig_of_four, port, bus):
    port.bus[2].fail(0x04)
    with pytest.raises(RigError, match=r"joint_2 \(id 2: overheated\)"):
        Rig(rig_of_four, lambda part: bus)
    assert registers(port.bus, "torque_enable") == [0, 0, 0, 0]


def test_a_joint_outside_its_limits_is_named_and_no_torque_comes_on(rig_of_four, port, bus):
    port.bus[3].bank.shaft[2] = 3000.0
    port.elapse(TICK)
    with pytest.raises(RigError, match=r"joint_3 stands at 2\.30 rad, its limits are -1\.0 to 1\.5"):
        Rig(rig_of_four, lambda part: bus)
    assert registers(port.bus, "torque_enable") == [0, 0, 0, 0]


def test_a_servo_left_silent_and_tripped_is_found_and_freed(rig_of_four, port, bus):
    port.bus[1]["status_return_level"] = 0
    port.bus[2]["bus_watchdog"] = -1
    rig = Rig(rig_of_four, lambda part: bus)
    play(rig, port, [0.3, 0.3, 0.3, 0.3], 150)
    assert np.allclose(rig.positions, 0.3, atol=2e-3)


def test_a_hot_servo_is_counted_and_the_others_go_on(enduring_rig, port):
    rig = enduring_rig
    play(rig, port, [0.0] * 4, 5)
    port.bus[2].fail(0x04)
    play(rig, port, [0.3] * 4, 100)
    assert np.allclose(rig.positions[[0, 2, 3]], 0.3, atol=2e-3)
    assert abs(rig.positions[1]) < 0.05
    assert rig.faults.alert[1] > 50
    assert rig.faults.alert[[0, 2, 3]].sum() == 0


@pytest.mark.parametrize("dead", [1, 2, 4])
def test_a_dead_servo_costs_only_itself(enduring_rig, port, dead):
    rig = enduring_rig
    play(rig, port, [0.0] * 4, 5)
    port.bus[dead].dead = True
    fresh = play(rig, port, [0.3] * 4, 200)
    alive = [index for index in range(4) if index != dead - 1]
    assert np.allclose(rig.positions[alive], 0.3, atol=2e-3)
    assert fresh > 150
    assert rig.faults.missed[dead - 1] >= 3
    assert rig.faults.missed[alive].max() <= 1


def test_a_servo_that_falls_silent_makes_nobody_elses_state_older(rig, port):
    """Its answer is waited for; those of the servos before it in the line have come meanwhile."""
    play(rig, port, [0.0] * 4, 5)
    port.bus.devices[0].bank.drive.supply[:3] = 9.0
    port.bus[4].dead = True
    play(rig, port, [0.0] * 4, 2)
    rig.collect_state()
    assert rig.voltages.tolist() == [9.0, 9.0, 9.0, 12.0]


def test_a_servo_that_comes_back_is_heard_again(rig, port):
    play(rig, port, [0.0] * 4, 5)
    port.bus[1].dead = True
    play(rig, port, [0.3] * 4, 15)  # less than its watchdog takes
    port.bus[1].dead = False
    play(rig, port, [0.3] * 4, 100)
    assert np.allclose(rig.positions, 0.3, atol=2e-3)
    missed = rig.faults.missed.copy()
    assert play(rig, port, [0.3] * 4, 50) == 50
    assert (rig.faults.missed == missed).all()


def test_several_that_come_back_are_all_heard_within_a_second(rig, port):
    play(rig, port, [0.0] * 4, 5)
    for id in (1, 2, 3):
        port.bus[id].dead = True
    play(rig, port, [0.3] * 4, 100)
    for id in (1, 2, 3):
        port.bus[id].dead = False
    play(rig, port, [0.3] * 4, 100)
    assert (rig.measured.missed_in_a_row == 0).all()


def test_all_servos_dead_is_no_exception(rig, port):
    for id in (1, 2, 3, 4):
        port.bus[id].dead = True
    play(rig, port, [0.3] * 4, 100)
    assert (rig.faults.missed > 3).all()
    assert rig.close() == list(rig.names)


def test_a_corrupt_reply_is_counted_for_its_servo(rig, port):
    play(rig, port, [0.0] * 4, 3)
    rig.collect_state()
    rig.request_state()
    receive = port.receive
    damaged = bytearray(receive())
    damaged[8 + 14 + 5] ^= 1  # in the second servo's piece
    port.receive = lambda likely=False: bytes(damaged)
    assert rig.collect_state()
    port.receive = receive
    assert rig.faults.corrupt.tolist() == [0, 1, 0, 0]


def test_silence_stops_the_rig_within_the_watchdog_time(rig, port):
    """What a killed player leaves behind: nobody says a word any more."""
    play(rig, port, [0.0] * 4, 5)
    play(rig, port, [1.4] * 4, 8)
    assert any(device.moving for device in port.bus.devices)
    port.elapse(0.25)
    stopped = np.array(registers(port.bus, "present_position"))
    assert registers(port.bus, "bus_watchdog") == [-1] * 4
    assert registers(port.bus, "torque_enable") == [1] * 4
    port.elapse(5.0)
    assert not any(device.moving for device in port.bus.devices)
    # From 4 rad/s they stop within half a degree.
    assert np.abs(np.array(registers(port.bus, "present_position")) - stopped).max() <= 6


def test_the_servos_own_watchdog_does_it_without_any_help(rig_of_four, port, bus):
    """The same while the servos are under way to a goal far off, at a speed that would take seconds."""
    rig = Rig(rig_of_four, lambda part: bus)
    rig.write(np.zeros(4))
    bus.sync_write(112, 4, b"".join(bytes((id,)) + (20).to_bytes(4, "little") for id in (1, 2, 3, 4)))
    bus.sync_write(116, 4, b"".join(bytes((id,)) + (2400).to_bytes(4, "little") for id in (1, 2, 3, 4)))
    port.elapse(0.19)
    assert any(device.moving for device in port.bus.devices)
    port.elapse(0.11)
    stopped = np.array(registers(port.bus, "present_position"))
    port.elapse(5.0)
    assert not any(device.moving for device in port.bus.devices)
    assert np.abs(np.array(registers(port.bus, "present_position")) - stopped).max() <= 2
    assert np.abs(np.array(registers(port.bus, "goal_position")) - registers(port.bus, "present_position")).min() > 200


def test_a_servo_that_missed_the_arming_of_its_watchdog_is_armed_within_a_second(rig, port):
    play(rig, port, [0.0] * 4, 5)
    port.bus[3]["bus_watchdog"] = 0  # as if the frame had been corrupted on its way
    play(rig, port, [0.0] * 4, 105)
    assert registers(port.bus, "bus_watchdog") == [10] * 4


def test_before_the_first_target_the_rig_may_take_its_time(rig, port):
    port.elapse(10.0)
    play(rig, port, [0.2] * 4, 100)
    assert rig.recoveries == 0
    assert np.allclose(rig.positions, 0.2, atol=2e-3)


def test_reading_alone_keeps_the_rig_awake(rig, port):
    play(rig, port, [0.0] * 4, 2)
    for _ in range(50):
        rig.collect_state()
        rig.request_state()
        port.elapse(TICK)
    assert rig.recoveries == 0
    assert registers(port.bus, "bus_watchdog") == [10] * 4


def test_closing_takes_the_torque_off_and_may_be_done_twice(rig, port):
    play(rig, port, [0.2] * 4, 3)
    assert rig.close() == []
    assert rig.close() == []
    assert registers(port.bus, "torque_enable") == [0] * 4
    sent = len(port.sent)
    play(rig, port, [0.2] * 4, 3)
    assert len(port.sent) == sent


def test_closing_goes_past_a_dead_servo(rig, port):
    port.bus[1].dead = True
    assert rig.close() == ["joint_1"]
    assert registers(port.bus, "torque_enable") == [1, 0, 0, 0]


def test_a_servo_that_is_deaf_for_a_moment_at_the_end_is_switched_off_too(rig, port):
    port.bus[3].reboot(port.now() + 0.2)
    port.bus[3]["torque_enable"] = 1  # as a startup configuration would set it
    assert rig.close() == []
    assert registers(port.bus, "torque_enable") == [0] * 4


def test_leaving_the_block_takes_the_torque_off(rig_of_four, bus, servos):
    with pytest.raises(KeyError), closing(Rig(rig_of_four, lambda part: bus)):
        raise KeyError
    assert registers(servos, "torque_enable") == [0] * 4


def test_a_vanished_port_is_raised_once(rig_of_four, bus, port):
    rig = Rig(msgspec.structs.replace(rig_of_four, reconnect_s=0.0), lambda part: bus)
    play(rig, port, [0.0] * 4, 3)
    port.unplug()
    with pytest.raises(RigError, match="is gone"):
        rig.write(np.zeros(4))
    rig.write(np.zeros(4))
    assert not rig.collect_state()
    assert rig.close() == list(rig.names)


def test_a_full_port_is_counted(rig, port):
    play(rig, port, [0.0] * 4, 3)
    send = port.send
    port.send = lambda data: False
    rig.write(np.full(4, 0.3))
    port.send = send
    assert rig.faults.unsent.tolist() == [1] * 4
    play(rig, port, [np.nan] * 4, 100)
    assert np.allclose(rig.positions, 0.0, atol=2e-3)


def test_a_port_is_busy_with_the_bytes_that_go_over_it(rig, port):
    """Counted beside the bus, where they are carried; 10 bits a byte."""
    play(rig, port, [0.0] * 4, 3)
    rig.collect_state()
    carried, send, receive, before = [], port.send, port.receive, rig.busy
    port.send = lambda data: (carried.append(len(data)), send(data))[1]
    port.receive = lambda likely=False: (carried.append(len(data := receive(likely))), data)[1]
    play(rig, port, [0.2, 0.1, 0.0, -0.1], 30)
    rig.collect_state()
    assert len(carried) >= 60
    assert rig.busy - before == pytest.approx(10.0 * sum(carried) / 1_000_000)


def test_calls_are_timed(rig, port):
    assert len(rig.write_us.microseconds) == 0
    play(rig, port, [0.0] * 4, 3)
    assert rig.write_us.microseconds.shape == (3,)
    assert rig.read_us.microseconds.shape == (3,)
    assert (rig.write_us.microseconds > 0.0).all()
