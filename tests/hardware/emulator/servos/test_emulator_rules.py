"""The rules of the vendor's manuals, each against the emulator.

References: [P2] e-Manual, Dynamixel Protocol 2.0; [X] e-Manual, XM430-W350 (others where named); [S] dynamixel-sdk.
"""

import msgspec
import numpy as np
import pytest

from benchmarks.rig.burdens import dead_torque
from benchmarks.simulated_time import EmulatedPort
from hardware.emulator.bus import EmulatedBus
from hardware.families import emulation
from hardware.families import frames as codes
from hardware.families.dynamixel2 import frames as wire
from hardware.families.dynamixel2.frames import BROADCAST, Parser, as_status, build, checksum
from hardware.families.dynamixel2.group_reply import fast_reply, fast_reply_length
from hardware.families.models import MODELS

XM430 = MODELS["XM430-W350"]


class Servo:
    """Servo `id` behind a port, spoken to in frames."""

    def __init__(self, port, id=1, table=XM430):
        self.port, self.id, self.table = port, id, table

    def say(self, frame):
        self.port.send(frame)
        return [as_status(answer) for answer in Parser().feed(self.port.receive())]

    def put(self, name, value):
        register = self.table[name]
        data = value.to_bytes(register.length, "little", signed=value < 0)
        (status,) = self.say(wire.write(self.id, register.address, data))
        return status.error

    def get(self, name):
        return self.port.bus[self.id][name]

    def errors(self, frame):
        return [status.error for status in self.say(frame)]


@pytest.fixture
def servo(port):
    return Servo(port)


def servo_of(rig_of_four, model):
    joints = tuple(msgspec.structs.replace(joint, model=model) for joint in rig_of_four.joints)
    return Servo(EmulatedPort(EmulatedBus(msgspec.structs.replace(rig_of_four, joints=joints))), 1, MODELS[model])


def test_an_instruction_with_a_bad_checksum_is_error_3(servo):
    """[P2] Status packet, error 3: CRC error."""
    frame = bytearray(wire.write(1, 65, b"\x01"))
    frame[-1] ^= 1
    assert servo.errors(bytes(frame)) == [3]
    assert servo.get("led") == 0
    frame = bytearray(wire.ping(BROADCAST))
    frame[-1] ^= 1
    assert servo.say(bytes(frame)) == []


def test_a_gap_in_an_instruction_makes_the_servo_forget_it(servo, port):
    """[P2] Bytes of an instruction more than 1.5 ms apart are dropped; the tolerance is a switch."""
    frame = wire.ping(1)
    port.send(frame[:6])
    port.elapse(0.001)
    assert len(servo.say(frame[6:])) == 1
    port.send(frame[:6])
    port.elapse(0.002)
    assert servo.say(frame[6:]) == []
    port.bus.longest_gap = None
    port.send(frame[:6])
    port.elapse(0.5)
    assert len(servo.say(frame[6:])) == 1


def test_the_makers_golden_fast_reads_come_out_byte_for_byte():
    """[P2] Fast Sync Read: request and reply of the manual's example."""
    assert wire.sync_read(132, 4, [3, 7, 4], fast=True).hex() == "fffffd00fe0a008a8400040003070420f2"
    piece = bytes.fromhex("fffffd00fe1900550003a6000000")
    assert checksum(piece).to_bytes(2, "little").hex() == "8408"
    second = piece + bytes.fromhex("8408") + bytes.fromhex("00071f080000")
    assert checksum(second).to_bytes(2, "little").hex() == "16ca"


def test_a_fast_bulk_read_is_one_frame_of_different_lengths(port):
    """[P2] Fast Bulk Read: LEN = 1 + sum(length + 4), each piece with its own checksum over all before it."""
    port.send(wire.bulk_read([(3, 132, 4), (1, 7, 1), (2, 126, 10)], fast=True))
    answer = port.receive()
    assert answer[5] == 1 + (4 + 4) + (1 + 4) + (10 + 4)
    reply = fast_reply(answer, [3, 1, 2], [4, 1, 10])
    assert {id: len(status.params) for id, status in reply.statuses.items()} == {3: 4, 1: 1, 2: 10}
    assert reply.statuses[1].params == b"\x01"


@pytest.mark.parametrize("model", ["2XL430-W250", "2XC430-W250"])
def test_twin_servos_know_no_fast_reads(rig_of_four, model):
    """[P2] Fast Sync Read: not for the 2XL and 2XC."""
    servo = servo_of(rig_of_four, model)
    servo.port.send(wire.sync_read(132, 4, [1, 2], fast=True))
    assert servo.port.receive() == b""
    assert len(servo.say(wire.sync_read(132, 4, [1, 2]))) == 2


@pytest.mark.parametrize(
    ("keep", "id", "baud"),
    [(emulation.RESET_ALL, 1, 1), (emulation.RESET_BUT_ID, 2, 1), (emulation.RESET_BUT_ID_AND_BAUD, 2, 3)],
)
def test_a_factory_reset_keeps_what_it_is_told_to(port, keep, id, baud):
    """[P2] Factory Reset: FF all, 01 all but ID, 02 all but ID and baud rate; the servo restarts."""
    servo, device = Servo(port, 2), port.bus[2]
    servo.put("max_position_limit", 3000)
    assert servo.errors(build(2, codes.FACTORY_RESET, bytes((keep,)))) == [0]
    assert (device["id"], device["baud_rate"], device["max_position_limit"]) == (id, baud, 4095)
    assert servo.say(wire.ping(2)) == []


def test_a_factory_reset_of_everything_is_not_taken_from_a_broadcast(servo):
    """[P2] Factory Reset: FF to the broadcast ID is ignored from firmware 42 on."""
    servo.put("max_position_limit", 3000)
    assert servo.say(build(BROADCAST, codes.FACTORY_RESET, bytes((emulation.RESET_ALL,)))) == []
    assert servo.get("max_position_limit") == 3000
    assert servo.errors(build(1, codes.FACTORY_RESET, bytes((0x77,)))) == [4]


def test_clear_forgets_whole_turns_and_is_refused_while_moving(servo, port):
    """[P2] Clear: 01 44 58 4C 22; Result Fail while the servo moves."""
    servo.put("operating_mode", 4)
    port.bus[1].bank.shaft[0] = 3 * 4096 + 500.0
    port.elapse(0.01)
    assert servo.get("present_position") == 3 * 4096 + 500
    clear = build(1, codes.CLEAR, wire.CLEAR_TURNS)
    assert servo.errors(clear) == [0]
    assert servo.get("present_position") == 500
    servo.put("goal_position", 3000)
    servo.put("torque_enable", 1)
    port.elapse(0.2)
    assert servo.errors(clear) == [1]
    assert servo.errors(build(1, codes.CLEAR, b"\x01\x02")) == [4]


def test_the_eeprom_is_backed_up_and_restored(servo, port):
    """[P2] Control Table Backup: refused with torque on; restoring restarts; Backup Ready (147) says it is there."""
    assert servo.errors(build(1, codes.BACKUP, wire.BACKUP_RESTORE)) == [1]
    servo.put("max_position_limit", 3000)
    assert servo.errors(build(1, codes.BACKUP, wire.BACKUP_STORE)) == [0]
    assert servo.get("backup_ready") == 1
    servo.put("max_position_limit", 3500)
    servo.put("torque_enable", 1)
    assert servo.errors(build(1, codes.BACKUP, wire.BACKUP_STORE)) == [1]
    servo.put("torque_enable", 0)
    assert servo.errors(build(1, codes.BACKUP, wire.BACKUP_RESTORE)) == [0]
    port.elapse(1.0)
    assert servo.get("max_position_limit") == 3000


@pytest.mark.parametrize(
    ("model", "modes"), [("XM430-W350", (0, 1, 3, 4, 5, 16)), ("XL430-W250", (1, 3, 4, 16)), ("MX-28", (1, 3, 4, 16))]
)
def test_a_model_has_its_own_operating_modes(rig_of_four, model, modes):
    """[X] and the XL430-W250's page: Operating Mode (11)."""
    servo = servo_of(rig_of_four, model)
    assert [mode for mode in range(20) if servo.put("operating_mode", mode) == 0] == list(modes)


def test_velocity_mode_turns_for_ever_at_its_goal(servo, port):
    """[X] Operating mode 1: Goal Velocity (104) in 0.229 rev/min, within Velocity Limit (44)."""
    servo.put("operating_mode", 1)
    servo.put("torque_enable", 1)
    assert servo.put("goal_velocity", 201) == 6
    assert servo.put("goal_velocity", -100) == 0
    port.elapse(5.0)
    assert servo.get("present_velocity") == pytest.approx(-100, abs=2)
    assert servo.get("present_position") < -1000


def test_pwm_mode_turns_as_fast_as_its_share_of_the_voltage(servo, port):
    """[X] Operating mode 16: Goal PWM (100) is the drive itself."""
    servo.put("operating_mode", 16)
    servo.put("goal_pwm", 0)
    servo.put("torque_enable", 1)
    servo.put("goal_pwm", 442)
    port.elapse(1.0)
    assert servo.get("present_velocity") == pytest.approx(46 / 0.229 / 2, rel=0.03)
    assert servo.get("present_pwm") == 442


def test_current_mode_holds_a_force_against_a_load(servo, port):
    """[X] Operating mode 0: Goal Current (102) in 2.69 mA."""
    servo.put("operating_mode", 0)
    servo.put("goal_current", 0)
    servo.put("torque_enable", 1)
    drive = port.bus[1].bank.drive
    drive.jammed[0] = True
    servo.put("goal_current", 200)
    port.elapse(0.2)
    assert servo.get("present_current") == pytest.approx(200, abs=1)


def test_current_based_position_mode_pushes_no_harder_than_its_goal_current(servo, port):
    """[X] Operating mode 5."""
    servo.put("operating_mode", 5)
    servo.put("goal_current", 100)
    servo.put("torque_enable", 1)
    port.bus[1].bank.drive.jammed[0] = True
    servo.put("goal_position", 5000)
    port.elapse(0.5)
    assert servo.get("present_current") == pytest.approx(100, abs=1)


@pytest.mark.parametrize("mode", [3, 4])
def test_the_other_position_modes_keep_to_no_current(servo, port, mode):
    """[X] Goal Current (102) and Current Limit (38) are used in modes 0 and 5."""
    servo.put("operating_mode", mode)
    servo.put("current_limit", 100)
    servo.put("goal_current", 50)
    servo.put("torque_enable", 1)
    port.bus[1].bank.drive.jammed[0] = True
    servo.put("goal_position", 3000)
    port.elapse(0.1)
    assert servo.get("present_current") == pytest.approx(2300 / 2.69, rel=0.02)


def test_user_limits_hold_in_mode_3_only(servo):
    """[X] Max/Min Position Limit (48, 52): ignored in the multi-turn modes."""
    servo.put("max_position_limit", 3000)
    assert servo.put("goal_position", 3001) == 6
    servo.put("operating_mode", 4)
    assert servo.put("goal_position", 20_000) == 0
    assert servo.put("goal_position", 1_048_576) == 4


def test_changing_to_mode_3_forgets_whole_turns(servo, port):
    """[X] Present Position (132) is reset to one turn when the operating mode becomes 3."""
    servo.put("operating_mode", 4)
    port.bus[1].bank.shaft[0] = 2 * 4096 + 7.0
    servo.put("operating_mode", 3)
    port.elapse(0.01)
    assert servo.get("present_position") == 7


def test_homing_offsets_beyond_a_quarter_turn_count_in_multi_turn_modes_only(servo, port):
    """[X] Homing Offset (20): in mode 3 offsets outside +-1024 are ignored."""
    servo.put("homing_offset", 1025)
    port.elapse(0.01)
    assert servo.get("present_position") == 2048
    servo.put("operating_mode", 4)
    port.elapse(0.01)
    assert servo.get("present_position") == 3073


def test_a_time_based_profile_takes_its_time_whatever_the_way(servo, port):
    """[X] Drive Mode (10) bit 2: Profile Velocity is ms of the whole way, Profile Acceleration ms of speeding up."""
    servo.put("drive_mode", 4)
    servo.put("torque_enable", 1)
    for goal in (2148, 3048):
        servo.put("profile_acceleration", 200)
        servo.put("profile_velocity", 1000)
        servo.put("goal_position", goal)
        way = []
        for _ in range(120):
            port.elapse(0.01)
            way.append(servo.get("position_trajectory"))
        arrived = next(index for index, place in enumerate(way) if abs(place - goal) <= 1)
        assert arrived == pytest.approx(100, abs=10)  # the last pulse is slow


def test_torque_comes_on_with_a_goal_if_the_drive_mode_says_so(servo, port):
    """[X] Drive Mode (10) bit 3, firmware 45."""
    servo.put("goal_position", 2500)
    assert servo.get("torque_enable") == 0
    servo.put("drive_mode", 8)
    servo.put("goal_position", 2400)
    assert servo.get("torque_enable") == 1
    port.elapse(1.0)
    assert servo.get("present_position") == pytest.approx(2400, abs=1)


def test_only_the_540_series_can_follow(servo, rig_of_four):
    """[X] Drive Mode (10) bit 1."""
    assert servo.put("drive_mode", 2) == 4
    assert servo_of(rig_of_four, "XM540-W270").put("drive_mode", 2) == 0


def test_the_moving_status_names_the_profile(servo, port):
    """[X] Moving Status (123): bit 0 in position, bit 1 profile ongoing, bits 4-5 its shape."""
    servo.put("torque_enable", 1)
    servo.put("profile_velocity", 50)
    servo.put("goal_position", 3000)
    port.elapse(0.1)
    assert servo.get("moving_status") == 0x12
    servo.put("profile_acceleration", 4)
    servo.put("goal_position", 500)
    port.elapse(0.1)
    assert servo.get("moving_status") == 0x32
    port.elapse(6.0)
    assert servo.get("moving_status") == 0x01


def test_the_moving_status_tells_when_the_profile_is_not_followed(servo, port):
    """[X] Moving Status (123) bit 3: following error."""
    servo.put("torque_enable", 1)
    servo.put("profile_velocity", 50)
    port.bus[1].bank.drive.jammed[0] = True
    servo.put("goal_position", 2600)
    port.elapse(0.8)
    assert servo.get("moving_status") & 0x08
    port.bus[1].bank.drive.jammed[0] = False
    port.elapse(1.0)
    assert servo.get("moving_status") == 0x01


def test_a_trip_of_the_watchdog_zeroes_the_profile_and_keeps_torque(servo, port):
    """[X] Bus Watchdog (98): on a trip the profile (108, 112) is 0, torque stays; writing 0 clears it."""
    servo.put("torque_enable", 1)
    servo.put("profile_velocity", 50)
    servo.put("profile_acceleration", 4)
    servo.put("bus_watchdog", 5)
    port.elapse(0.2)
    names = ("bus_watchdog", "profile_velocity", "profile_acceleration", "torque_enable")
    assert [servo.get(name) for name in names] == [-1, 0, 0, 1]
    assert servo.put("goal_position", 2100) == 4
    assert (servo.put("bus_watchdog", 0), servo.put("goal_position", 2100)) == (0, 0)


def test_a_reboot_forgets_whole_turns(servo, port):
    """[X] Present Position (132) is reset to one turn by power-up and reboot."""
    port.bus[1].bank.shaft[0] = 2 * 4096 + 700.0
    port.elapse(0.01)
    assert servo.get("present_position") == 2 * 4096 + 700
    servo.say(wire.reboot(1))
    port.elapse(0.2)
    assert servo.get("present_position") == 700


def test_an_indirect_cell_has_the_access_and_range_of_its_target(servo):
    """[X] Indirect Address (168): RAM places 64 to 661 only; Indirect Data (224) inherits access and range."""
    assert servo.put("indirect_address_1", 63) == 4
    assert servo.put("indirect_address_1", 662) == 4
    assert servo.put("indirect_address_1", 132) == 0  # present position: read-only
    assert servo.put("indirect_data_1", 1) == 7
    assert servo.put("indirect_address_1", 65) == 0  # LED: 0 or 1
    assert servo.put("indirect_data_1", 2) == 4
    assert (servo.put("indirect_data_1", 1), servo.get("led")) == (0, 1)


def test_the_realtime_tick_counts_milliseconds_and_starts_over(servo, port):
    """[X] Realtime Tick (120): 0 to 32767 ms."""
    port.elapse(1.5)
    assert servo.get("realtime_tick") == pytest.approx(1500, abs=2)
    port.elapse(32.0)
    assert servo.get("realtime_tick") == pytest.approx(33500 - 32768, abs=2)


def test_each_servo_waits_its_return_delay_in_a_sync_read_and_once_in_a_fast_one(rig_of_four):
    """[X] Return Delay Time (9): 2 us a count; DynamixelSDK issue 302: a sync read pays it for each servo."""
    port = EmulatedPort(EmulatedBus(rig_of_four), paced=True)
    baud, ids = rig_of_four.baud, [1, 2, 3, 4]

    def time_of(frame, size):
        since = port.now()
        port.send(frame)
        received = b""
        while len(received) < size:
            assert port.wait(1.0)
            received += port.receive()
        port.elapse(0.01)
        return port.now() - 0.01 - since

    request = wire.sync_read(132, 4, ids)
    slow = time_of(request, 4 * 15)
    assert slow == pytest.approx(10 * (len(request) + 60) / baud + 4 * 500e-6, abs=1e-6)
    request = wire.sync_read(132, 4, ids, fast=True)
    fast = time_of(request, fast_reply_length(4, 4))
    assert fast == pytest.approx(10 * (len(request) + fast_reply_length(4, 4)) / baud + 500e-6, abs=1e-6)


def test_a_host_that_speaks_into_an_answer_destroys_both(rig_of_four):
    """[P2] Half duplex: one wire for both directions."""
    port = EmulatedPort(EmulatedBus(rig_of_four), paced=True)
    port.send(wire.ping(1))
    port.elapse(0.0006)
    port.send(wire.write(2, 65, b"\x01"))
    port.elapse(0.1)
    assert port.receive() == b""
    assert port.bus[2]["led"] == 0
    assert port.wire.collisions == 1


def test_nobody_hears_a_host_at_another_speed(servo, port):
    """[X] Baud Rate (8); a servo changes after it has answered."""
    assert servo.put("baud_rate", 6) == 0
    assert servo.say(wire.ping(1)) == []
    assert len(servo.say(wire.ping(2))) == 1
    port.bus.baud = 4_000_000
    assert len(servo.say(wire.ping(1))) == 1
    assert servo.say(wire.ping(2)) == []


def test_a_second_id_obeys_and_keeps_silent(port):
    """[X] Secondary ID (12): same command, no reply, no EEPROM write; the primary answers."""
    shadow = Servo(port, 2)
    shadow.put("secondary_id", 1)
    assert [status.id for status in shadow.say(wire.write(1, 65, b"\x01"))] == [1]
    assert (port.bus[1]["led"], port.bus[2]["led"]) == (1, 1)
    limit = XM430["max_position_limit"]
    assert shadow.errors(wire.write(1, limit.address, limit.encode(3000))) == [0]
    assert (port.bus[1]["max_position_limit"], port.bus[2]["max_position_limit"]) == (3000, 4095)
    shadow.say(wire.sync_write(65, 1, b"\x01\x00"))
    assert (port.bus[1]["led"], port.bus[2]["led"]) == (0, 0)
    assert [status.id for status in shadow.say(build(1, codes.REG_WRITE, b"\x41\x00\x01"))] == [1]
    shadow.say(build(1, codes.ACTION, b""))
    assert (port.bus[1]["led"], port.bus[2]["led"]) == (1, 1)


def test_a_second_id_that_no_servo_has_as_its_own_is_obeyed_by_all_in_silence(port):
    """[X] Secondary ID (12), the maker's example: with 100 on all, a write to 100 is carried out and unanswered."""
    for id in (1, 2):
        Servo(port, id).put("secondary_id", 100)
    assert Servo(port, 1).say(wire.write(100, 65, b"\x01")) == []
    assert (port.bus[1]["led"], port.bus[2]["led"]) == (1, 1)
    assert [status.id for status in Servo(port, 1).say(wire.write(1, 65, b"\x00"))] == [1]
    assert (port.bus[1]["led"], port.bus[2]["led"]) == (0, 1)


def test_two_servos_with_one_id_mix_their_answers_where_they_differ(port):
    """A 0 on a shared line wins against a 1: equal answers stay whole, others arrive with a bad checksum."""
    servo = Servo(port, 1)
    port.bus.devices[1]["id"] = 1
    port.bus.reindex()
    assert [status.id for status in servo.say(wire.ping(1))] == [1]
    port.bus.devices[1].bank.shaft[1] = 1234.0
    port.elapse(0.01)
    parser = Parser()
    port.send(wire.read(1, 132, 4))
    assert parser.feed(port.receive()) == []
    assert parser.corrupt == 1


def test_startup_configuration_switches_torque_on_and_keeps_gains(servo, port):
    """[X] Startup Configuration (60), firmware 45: bit 0 torque on, bit 1 RAM restored."""
    servo.put("startup_configuration", 3)
    servo.put("position_p_gain", 500)
    servo.say(wire.reboot(1))
    port.elapse(1.0)
    assert (servo.get("torque_enable"), servo.get("position_p_gain")) == (1, 500)
    servo.put("torque_enable", 0)
    servo.put("startup_configuration", 0)
    servo.say(wire.reboot(1))
    port.elapse(1.0)
    assert (servo.get("torque_enable"), servo.get("position_p_gain")) == (0, 800)


def test_heat_shuts_a_servo_down(servo, port):
    """[X] Shutdown (63), bit 2: overheating; Temperature Limit (31)."""
    servo.put("torque_enable", 1)
    port.bus[1].bank.drive.temperature[0] = 81.0
    port.elapse(0.01)
    assert (servo.get("hardware_error_status"), servo.get("torque_enable")) == (0x04, 0)


def test_a_blocked_horn_draws_current_heats_the_motor_and_ends_in_overload(servo, port):
    """[X] Shutdown (63), bit 5: overload."""
    servo.put("torque_enable", 1)
    port.bus[1].bank.drive.jammed[0] = True
    servo.put("goal_position", 4000)
    port.elapse(0.5)
    assert servo.get("present_current") == pytest.approx(2300 / 2.69, rel=0.02)
    assert servo.get("torque_enable") == 1
    port.elapse(1.0)
    assert (servo.get("hardware_error_status"), servo.get("torque_enable")) == (0x20, 0)
    assert port.bus[1].bank.drive.temperature[0] > 32.5


def test_a_wrong_voltage_is_an_alert_and_too_little_restarts_the_servo(servo, port):
    """[X] Shutdown (63) leaves bit 0 out by default: voltage is reported, and torque stays."""
    servo.put("torque_enable", 1)
    drive = port.bus[1].bank.drive
    drive.supply[0] = 8.0
    port.elapse(0.01)
    assert (servo.get("hardware_error_status"), servo.get("torque_enable")) == (0x01, 1)
    drive.supply[0] = 4.0
    port.elapse(0.01)
    drive.supply[0] = 12.0
    assert servo.say(wire.ping(1)) == []
    port.elapse(0.2)
    assert (servo.get("hardware_error_status"), servo.get("torque_enable")) == (0, 0)


@pytest.mark.parametrize("volts", [10.0, 12.0, 14.8])
def test_current_follows_the_supply_as_torque_does(servo, port, volts):
    """A load takes the same current at any voltage, a blocked horn as much as the voltage gives."""
    drive = port.bus[1].bank.drive
    drive.supply[0] = volts
    servo.put("torque_enable", 1)
    drive.load[0] = 0.1
    port.elapse(1.0)
    assert drive.current[0] == pytest.approx(0.1, abs=0.002)
    drive.jammed[0] = True
    servo.put("goal_position", 4000)
    port.elapse(0.5)
    assert drive.current[0] == pytest.approx(volts / 12.0)


def test_a_load_sags_a_servo_and_an_integral_gain_lifts_it_again(servo, port):
    """[X] Position I Gain (82)."""
    servo.put("torque_enable", 1)
    port.bus[1].bank.drive.load[0] = 0.05
    port.elapse(1.0)
    sagged = 2048 - servo.get("present_position")
    assert sagged >= 5
    servo.put("position_i_gain", 200)
    port.elapse(10.0)
    assert abs(2048 - servo.get("present_position")) <= 1


def test_a_limp_servo_falls_under_a_load(servo, port):
    port.bus[1].bank.drive.load[0] = 0.2
    port.elapse(0.5)
    assert servo.get("present_position") < 2000


@pytest.mark.parametrize("model", ["XL430-W250", "XM540-W270", "XL330-M288", "MX-64", "XC330-T181", "XW540-T260"])
def test_every_x_model_goes_to_its_goal(rig_of_four, model):
    servo = servo_of(rig_of_four, model)
    servo.put("torque_enable", 1)
    assert servo.put("goal_position", 3000) == 0
    servo.port.elapse(3.0)
    # Where a real servo was identified, friction holds it a little before its goal.
    bank = servo.port.bus[1].bank
    short = dead_torque(bank.drive.motor) * bank.drive.motor.full_pwm / bank.drive.p_gain[0]
    assert servo.get("present_position") == pytest.approx(3000, abs=1 + short)
    assert servo.get("hardware_error_status") == 0


def test_a_mixed_rig_is_emulated_side_by_side(rig_of_four):
    joints = tuple(
        msgspec.structs.replace(joint, model=model)
        for joint, model in zip(rig_of_four.joints, ["XM430-W350", "XL430-W250"] * 2, strict=True)
    )
    bus = EmulatedBus(msgspec.structs.replace(rig_of_four, joints=joints))
    assert [device.model for device in bus.devices] == ["XM430-W350", "XL430-W250"] * 2
    assert np.array_equal([bus[id].id for id in (1, 2, 3, 4)], [1, 2, 3, 4])


def test_a_change_of_mode_puts_gains_profile_and_goals_back_and_the_same_mode_does_not(servo):
    """[X] Operating Mode (11): gains, profile, goal PWM and goal current are reset when the mode changes."""
    changed = {"position_p_gain": 400, "position_i_gain": 7, "feedforward_1st_gain": 9, "profile_velocity": 50,
               "profile_acceleration": 60, "goal_pwm": 200, "goal_current": 100}  # fmt: skip
    for name, value in changed.items():
        servo.put(name, value)
    servo.put("operating_mode", 3)
    assert {name: servo.get(name) for name in changed} == changed
    servo.put("operating_mode", 4)
    back = {name: servo.get(name) for name in changed}
    assert back == {"position_p_gain": 800, "position_i_gain": 0, "feedforward_1st_gain": 0, "profile_velocity": 0,
                    "profile_acceleration": 0, "goal_pwm": 885, "goal_current": 1193}  # fmt: skip
