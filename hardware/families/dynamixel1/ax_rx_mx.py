"""The control tables of the AX, RX and MX servos of Protocol 1.0 (e-Manual, each model's page).

A register that does what one of the X series does has its name here; the manual's own is behind the #. Present speed
and load hold their size and, in bit 10, their sign. No watchdog, no fast read and (AX, RX) no acceleration.
"""

from __future__ import annotations

from dataclasses import replace

from hardware.families.dynamixel1.traits import TRAITS
from hardware.families.table import ControlTable, parse_table
from hardware.families.traits import Traits

_EEPROM = """
    # address length name                   access memory  range              default  unit
      0       2      model_number           R      EEPROM  0..65535           0        -
      2       1      firmware_version       R      EEPROM  0..255             24       -
      3       1      id                     RW     EEPROM  0..253             1        -
      4       1      baud_rate              RW     EEPROM  0..254             1        -
      5       1      return_delay_time      RW     EEPROM  0..254             250      2us
      6       2      min_position_limit     RW     EEPROM  0..1023            0        1pulse       # CW angle limit
      8       2      max_position_limit     RW     EEPROM  0..1023            1023     1pulse       # CCW angle limit
      11      1      temperature_limit      RW     EEPROM  0..150             70       1degC
      12      1      min_voltage_limit      RW     EEPROM  50..250            60       0.1V
      13      1      max_voltage_limit      RW     EEPROM  50..250            140      0.1V
      14      2      max_torque             RW     EEPROM  0..1023            1023     0.1%
      16      1      status_return_level    RW     EEPROM  0..2               2        -
      17      1      alarm_led              RW     EEPROM  0..127             36       -
      18      1      shutdown               RW     EEPROM  0..127             36       -
"""
_MEASURED = """
      34      2      torque_limit           RW     RAM     0..1023            1023     0.1%
      36      2      present_position       R      RAM     0..65535           -        1pulse
      38      2m     present_velocity       R      RAM     0..2047            -        0.111rpm     # present speed
      40      2m     present_load           R      RAM     0..2047            -        0.1%
      42      1      present_input_voltage  R      RAM     0..255             -        0.1V         # present voltage
      43      1      present_temperature    R      RAM     0..255             -        1degC
      44      1      registered_instruction R      RAM     0..1               0        -
      46      1      moving                 R      RAM     0..1               -        -
      47      1      lock                   RW     RAM     0..1               0        -
      48      2      punch                  RW     RAM     0..1023            32       -
"""
_SLOPES = """
      24      1      torque_enable          RW     RAM     0..1               0        -
      25      1      led                    RW     RAM     0..1               0        -
      26      1      cw_compliance_margin   RW     RAM     0..255             1        1pulse
      27      1      ccw_compliance_margin  RW     RAM     0..255             1        1pulse
      28      1      cw_compliance_slope    RW     RAM     2..254             32       -
      29      1      ccw_compliance_slope   RW     RAM     2..254             32       -
      30      2      goal_position          RW     RAM     0..1023            -        1pulse
      32      2m     profile_velocity       RW     RAM     0..2047            0        0.111rpm     # moving speed
"""
_MX_EEPROM = """
      20      2s     multi_turn_offset      RW     EEPROM  -24576..24576      0        1pulse
      22      1      resolution_divider     RW     EEPROM  1..4               1        -
"""
_MX_GAINS = """
      24      1      torque_enable          RW     RAM     0..1               0        -
      25      1      led                    RW     RAM     0..1               0        -
      26      1      position_d_gain        RW     RAM     0..254             0        -            # D gain
      27      1      position_i_gain        RW     RAM     0..254             0        -            # I gain
      28      1      position_p_gain        RW     RAM     0..254             32       -            # P gain
      30      2      goal_position          RW     RAM     0..4095            -        1pulse
      32      2m     profile_velocity       RW     RAM     0..2047            0        0.114rpm     # moving speed
"""
_MX_TICK = """
      50      2      realtime_tick          R      RAM     0..32767           -        1ms
"""
_MX_CURRENT = """
      68      2      current                R      RAM     0..4095            2048     4.5mA
      70      1      torque_control_mode    RW     RAM     0..1               0        -
      71      2      goal_torque            RW     RAM     0..2047            0        4.5mA
"""
_MX_ACCELERATION = """
      73      1      profile_acceleration   RW     RAM     0..254             0        8.583deg/s2  # goal acceleration
"""
_STEPS = 1228  # to a turn: 1023 of them are 300 degrees


# What a model has otherwise than its series.
_EXCEPTIONS: dict[str, dict[str, int]] = {
    "AX-12W": {
        f"{way}_compliance_{what}": value for way in ("cw", "ccw") for what, value in (("margin", 4), ("slope", 64))
    },
    "AX-18A": {"max_torque": 983, "torque_limit": 983},
}


def _ax(model: str, traits: Traits, **defaults: int) -> ControlTable:
    table = parse_table(model, traits.figures[0], _STEPS, _EEPROM + _SLOPES + _MEASURED, traits.series)
    _set_defaults(table, traits, **defaults)
    return table


def _rx(model: str, traits: Traits) -> ControlTable:
    return _ax(model, traits, baud_rate=34, max_voltage_limit=190)


def _mx(model: str, traits: Traits) -> ControlTable:
    number = traits.figures[0]
    current = _MX_CURRENT if number != 29 else ""
    reverse = "\n      10      1      drive_mode             RW     EEPROM  0..3               0        -\n"
    eeprom = _EEPROM.replace("\n      11 ", f"{reverse}      11 ") if number == 320 else _EEPROM
    text = eeprom + _MX_EEPROM + _MX_GAINS + _MEASURED + _MX_TICK + current + _MX_ACCELERATION
    table = parse_table(model, number, 4096, text, traits.series)
    registers = table.registers
    for name in ("min_position_limit", "max_position_limit"):
        registers[name] = replace(registers[name], maximum=4095)
    registers["present_velocity"] = replace(registers["present_velocity"], scale=0.114)
    volts = 240 if number == 310 else 160
    _set_defaults(table, traits, baud_rate=34, max_position_limit=4095, max_voltage_limit=volts, punch=0)
    return table


def _set_defaults(table: ControlTable, traits: Traits, **defaults: int) -> None:
    defaults |= {"model_number": table.number, "temperature_limit": traits.figures[1]}
    defaults |= _EXCEPTIONS.get(table.model, {})
    for name, value in defaults.items():
        table.registers[name] = replace(table.registers[name], default=value)


_MAKE = {"AX": _ax, "RX": _rx, "MX1": _mx}

AX_RX_MX: dict[str, ControlTable] = {
    model: _MAKE[traits.series.name](model, traits) for model, traits in TRAITS.items()
}
"""By model name."""
