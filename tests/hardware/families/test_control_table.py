import math

import numpy as np
import pytest

from hardware.families.models import MODELS
from hardware.families.table import parse_table
from motiondeck_base.errors import MotiondeckError

XM430 = MODELS["XM430-W350"]

# From the table in the maker's e-Manual.
PRINTED = [
    ("id", 7, 1, "EEPROM"),
    ("homing_offset", 20, 4, "EEPROM"),
    ("velocity_limit", 44, 4, "EEPROM"),
    ("torque_enable", 64, 1, "RAM"),
    ("hardware_error_status", 70, 1, "RAM"),
    ("bus_watchdog", 98, 1, "RAM"),
    ("goal_position", 116, 4, "RAM"),
    ("present_current", 126, 2, "RAM"),
    ("present_position", 132, 4, "RAM"),
    ("indirect_address_28", 222, 2, "RAM"),
    ("indirect_data_1", 224, 1, "RAM"),
    ("indirect_address_56", 632, 2, "RAM"),
    ("indirect_data_56", 661, 1, "RAM"),
]


@pytest.mark.parametrize(("name", "address", "length", "memory"), PRINTED)
def test_registers_stand_where_the_manual_says(name, address, length, memory):
    register = XM430[name]
    assert (register.address, register.length, register.memory) == (address, length, memory)


def test_units_are_si():
    assert XM430["velocity_limit"].si * 200 == pytest.approx(45.8 * 2 * math.pi / 60)
    assert XM430["present_current"].si * 1000 == pytest.approx(2.69)
    assert XM430["bus_watchdog"].si == pytest.approx(0.02)


def test_signed_registers_hold_negative_numbers():
    register = XM430["goal_position"]
    assert register.encode(-131073) == bytes.fromhex("fffffdff")
    assert register.decode(register.encode(-131073)) == -131073
    assert XM430["profile_velocity"].decode(b"\xff\xff\x00\x00") == 65535


def test_a_count_outside_the_range_is_refused():
    with pytest.raises(ValueError, match="profile_velocity takes 0 to 32767, not -1"):
        XM430["profile_velocity"].encode(-1)


def test_an_unknown_register_names_the_nearest():
    with pytest.raises(MotiondeckError, match="goal_position"):
        XM430["goal_positon"]


def test_a_record_has_every_register_at_its_address():
    layout = XM430.dtype()
    assert (layout.names, layout.itemsize) == (tuple(XM430.registers), XM430.size)
    assert layout.fields["present_position"] == (np.dtype("<i4"), 132)


def test_indirect_addresses_first_point_to_their_own_data():
    for number in range(1, 57):
        assert XM430[f"indirect_address_{number}"].default == XM430[f"indirect_data_{number}"].address


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ("0 2 a R RAM 0..1 0 -\n1 1 b R RAM 0..1 0 -", "overlaps"),
        ("0 2 a X RAM 0..1 0 -", "access is R or RW"),
        ("0 2 a R RAM 0..1 0 5furlongs", "furlongs"),
        ("0 2 a R RAM 0..1 0", "row '0 2 a R RAM 0..1 0'"),
    ],
)
def test_a_wrong_row_is_quoted(rows, reason):
    with pytest.raises(ValueError, match=reason):
        parse_table("X", 1, 4096, rows, MODELS["XM430-W350"].series)
