"""What an emulated servo allows and refuses, in bytes (the e-Manual's Protocol 2.0 and XM430-W350 pages)."""

import pytest

from hardware.families import frames as codes
from hardware.families.dynamixel2 import frames as wire
from hardware.families.dynamixel2.frames import BROADCAST, Parser, as_status, build
from hardware.families.dynamixel2.group_reply import fast_reply, fast_reply_length
from hardware.families.models import MODELS

XM430 = MODELS["XM430-W350"]


@pytest.fixture
def say(port):
    """Sends a frame and gives the statuses that come back."""

    def exchange(frame):
        port.send(frame)
        return [as_status(answer) for answer in Parser().feed(port.receive())]

    return exchange


@pytest.fixture
def put(say):
    """Writes a register of servo 1 and gives the error number."""

    def write(name, value, id=1):
        register = XM430[name]
        data = value.to_bytes(register.length, "little", signed=value < 0)
        (status,) = say(wire.write(id, register.address, data))
        return status.error

    return write


@pytest.fixture
def get(say):
    def read(name, id=1):
        register = XM430[name]
        (status,) = say(wire.read(id, register.address, register.length))
        return register.decode(status.params)

    return read


def test_a_ping_tells_model_and_firmware(say):
    (status,) = say(wire.ping(2))
    assert (status.id, status.params) == (2, bytes.fromhex("fc03 2e"))


def test_everybody_answers_a_broadcast_ping_in_order_of_id(say):
    assert [status.id for status in say(wire.ping(BROADCAST))] == [1, 2, 3, 4]


def test_nobody_answers_for_an_unknown_id_or_a_broadcast_read(say):
    assert say(wire.ping(77)) == []
    assert say(wire.read(BROADCAST, 132, 4)) == []


def test_after_power_up_the_goal_is_where_the_servo_stands(get):
    assert get("goal_position", 3) == get("present_position", 3) == 1500
    assert get("torque_enable") == 0


def test_what_is_written_is_read_back(put, get):
    assert put("position_p_gain", 640) == 0
    assert get("position_p_gain") == 640


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("present_position", 5, 7),  # read-only
        ("model_number", 5, 7),
        ("position_p_gain", 16384, 4),  # beyond the register's range
        ("torque_enable", 2, 4),
        ("goal_position", 3000, 6),  # beyond the user's limit
        ("goal_position", 2_000_000, 4),
        ("goal_pwm", 801, 6),
        ("goal_pwm", -801, 6),
        ("goal_pwm", 800, 0),
        ("goal_position", 2900, 0),
        ("operating_mode", 2, 4),
        ("id", 253, 4),
    ],
)
def test_a_write_is_refused_with_the_right_error(put, name, value, error):
    put("max_position_limit", 2900)
    put("pwm_limit", 800)
    assert put(name, value) == error


def test_eeprom_is_locked_while_torque_is_on(put, get):
    assert put("torque_enable", 1) == 0
    assert put("max_position_limit", 3000) == 7
    assert get("max_position_limit") == 4095
    assert put("torque_enable", 0) == 0
    assert put("max_position_limit", 3000) == 0


def test_a_write_that_stops_inside_a_register_is_too_short(say):
    assert [status.error for status in say(wire.write(1, 116, b"\x00\x08"))] == [5]
    assert [status.error for status in say(wire.write(1, 116, b""))] == [5]


def test_a_write_that_one_register_refuses_changes_none(say, get):
    profile_and_goal = (100).to_bytes(4, "little") + (9999).to_bytes(4, "little")
    assert [status.error for status in say(wire.write(1, 112, profile_and_goal))] == [6]
    assert get("profile_velocity") == 0


def test_an_undefined_place_takes_no_write_and_reads_as_zero(say):
    assert [status.error for status in say(wire.write(1, 66, b"\x01"))] == [7]
    assert [status.params for status in say(wire.read(1, 66, 2))] == [b"\x00\x00"]
    assert [status.error for status in say(wire.read(1, 660, 4))] == [5]


def test_an_unknown_instruction_is_error_2(say):
    assert [status.error for status in say(build(1, 0x77))] == [2]


def test_a_registered_write_waits_for_the_action(say, get):
    assert [status.error for status in say(build(1, codes.ACTION))] == [2]
    assert [status.error for status in say(build(1, codes.REG_WRITE, b"\x41\x00\x01"))] == [0]
    assert (get("registered_instruction"), get("led")) == (1, 0)
    assert [status.error for status in say(build(1, codes.ACTION))] == [0]
    assert (get("registered_instruction"), get("led")) == (0, 1)


def test_a_registered_write_is_checked_at_once(say):
    assert [status.error for status in say(build(1, codes.REG_WRITE, b"\x41\x00\x05"))] == [4]


def test_the_status_return_level_says_what_is_answered(say, put):
    assert put("led", 1) == 0
    assert say(wire.write(1, 68, b"\x01")) == []
    assert say(wire.write(1, 65, b"\x01")) == []
    assert len(say(wire.read(1, 65, 1))) == 1
    say(wire.write(1, 68, b"\x00"))
    assert say(wire.read(1, 65, 1)) == []
    assert len(say(wire.ping(1))) == 1


def test_a_servo_answers_to_its_new_id(say, put):
    assert put("id", 40) == 0
    assert say(wire.ping(1)) == []
    assert [status.id for status in say(wire.ping(40))] == [40]


def test_an_alert_is_a_bit_beside_the_data(servos, get, say):
    servos[1].fail(0x01)  # voltage: reported, and no reason to shut down by default
    (status,) = say(wire.read(1, 132, 4))
    assert status.alert
    assert status.error == 0
    assert XM430["present_position"].decode(status.params) == 2048
    assert get("hardware_error_status") == 1


def test_after_a_shutdown_only_a_reboot_brings_torque_back(servos, say, put, get, port):
    put("torque_enable", 1)
    servos[1].fail(0x20)  # overload
    assert get("torque_enable") == 0
    assert put("torque_enable", 1) == 1
    assert [status.id for status in say(wire.reboot(1))] == [1]
    assert say(wire.ping(1)) == []  # it boots
    port.elapse(1.0)
    assert get("hardware_error_status") == 0
    assert put("torque_enable", 1) == 0


def test_a_reboot_forgets_ram_and_keeps_eeprom(say, put, get, port):
    put("led", 1)
    put("max_position_limit", 3000)
    say(wire.reboot(1))
    port.elapse(1.0)
    assert (get("led"), get("max_position_limit")) == (0, 3000)


def test_indirect_data_stands_for_what_its_address_names(say, put, get):
    position = XM430["goal_position"].address
    for cell in range(4):
        assert put(f"indirect_address_{cell + 1}", position + cell) == 0
    assert put("indirect_address_5", XM430["led"].address) == 0
    data = (2100).to_bytes(4, "little") + b"\x01"
    assert [status.error for status in say(wire.write(1, 224, data))] == [0]
    assert (get("goal_position"), get("led")) == (2100, 1)
    assert [status.params for status in say(wire.read(1, 224, 5))] == [data]
    assert [status.error for status in say(wire.write(1, 224, (9000).to_bytes(4, "little")))] == [6]


def test_an_indirect_cell_of_its_own_just_keeps_a_byte(put, get):
    assert put("indirect_data_9", 77) == 0
    assert get("indirect_data_9") == 77


def test_groups_are_read_in_the_order_asked(say):
    assert [status.id for status in say(wire.sync_read(132, 4, [3, 1, 2]))] == [3, 1, 2]
    found = say(wire.bulk_read([(2, 7, 1), (1, 132, 4)]))
    assert [(status.id, len(status.params)) for status in found] == [(2, 1), (1, 4)]


def test_groups_are_written_without_an_answer(say, get):
    assert say(wire.sync_write(65, 1, bytes([1, 1, 3, 1]))) == []
    assert [get("led", id) for id in (1, 2, 3)] == [1, 0, 1]
    assert say(build(BROADCAST, codes.BULK_WRITE, bytes([2, 65, 0, 1, 0, 1]) + bytes([1, 84, 0, 2, 0, 0, 1]))) == []
    assert (get("led", 2), get("position_p_gain", 1)) == (1, 256)


def test_a_fast_read_is_one_frame_of_all(port):
    port.send(wire.sync_read(132, 4, [1, 2, 3], fast=True))
    answer = port.receive()
    assert len(answer) == fast_reply_length(3, 4)
    reply = fast_reply(answer, [1, 2, 3], [4] * 3)
    assert [XM430["present_position"].decode(status.params) for status in reply.statuses.values()] == [2048, 2048, 1500]


def test_a_dead_servo_hushes_those_behind_it_if_strict(servos, say, port):
    servos[2].dead = True
    assert [status.id for status in say(wire.sync_read(132, 4, [1, 2, 3]))] == [1]
    port.send(wire.sync_read(132, 4, [1, 2, 3], fast=True))
    assert list(fast_reply(port.receive(), [1, 2, 3], [4] * 3).statuses) == [1]
    servos.strict = False
    assert [status.id for status in say(wire.sync_read(132, 4, [1, 2, 3]))] == [1, 3]
    port.send(wire.sync_read(132, 4, [1, 2, 3], fast=True))
    assert list(fast_reply(port.receive(), [1, 2, 3], [4] * 3).statuses) == [1, 3]


@pytest.mark.parametrize("params", [b"", b"\x84", b"\x84\x00\x04\x00", b"\x84\x00\x00\x00\x01\x02"])
@pytest.mark.parametrize("instruction", [0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x02, 0x03, 0x04, 0x06, 0x10, 0x20])
def test_a_malformed_instruction_breaks_nothing(say, port, instruction, params):
    for id in (1, BROADCAST):
        port.send(build(id, instruction, params))
        port.receive()
    assert len(say(wire.ping(1))) == 1
