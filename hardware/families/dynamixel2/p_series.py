"""The control tables of the P series and of PRO(A) (e-Manual, each model's page): one layout, each model's own limits.

PRO(A) is the older series, with the same limits and without the newest registers. Both count positions from half a turn
below 0 to half a turn above, and refuse a profile beyond their velocity or acceleration limit. Only the PH54-200's page
tells gains; those of the others are left as they are. The indirect addresses are in EEPROM.
"""

from __future__ import annotations

from dataclasses import replace

from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.table import ControlTable, parse_table
from hardware.families.traits import Traits

_LAYOUT = """
    # address length name                   access memory  range                     default  unit
      0       2      model_number           R      EEPROM  0..65535                  2020     -
      2       4      model_information      R      EEPROM  0..4294967295             0        -
      6       1      firmware_version       R      EEPROM  0..255                    45       -
      7       1      id                     RW     EEPROM  0..252                    1        -
      8       1      baud_rate              RW     EEPROM  0..9                      1        -
      9       1      return_delay_time      RW     EEPROM  0..254                    250      2us
      10      1      drive_mode             RW     EEPROM  0..13                     0        -
      11      1      operating_mode         RW     EEPROM  0..16                     3        -
      12      1      secondary_id           RW     EEPROM  0..255                    255      -
      13      1      protocol_type          RW     EEPROM  2..10                     2        -
      20      4s     homing_offset          RW     EEPROM  -2147483648..2147483647   0        1pulse
      24      4      moving_threshold       RW     EEPROM  0..2900                   20       0.01rpm
      31      1      temperature_limit      RW     EEPROM  0..100                    80       1degC
      32      2      max_voltage_limit      RW     EEPROM  150..350                  350      0.1V
      34      2      min_voltage_limit      RW     EEPROM  150..350                  150      0.1V
      36      2      pwm_limit              RW     EEPROM  0..2009                   2009     0.0498%
      38      2      current_limit          RW     EEPROM  0..22740                  22740    1mA
      40      4      acceleration_limit     RW     EEPROM  0..3992644                3992644  1rev/min2
      44      4      velocity_limit         RW     EEPROM  0..2900                   2900     0.01rpm
      48      4s     max_position_limit     RW     EEPROM  -501923..501923           501433   1pulse
      52      4s     min_position_limit     RW     EEPROM  -501923..501923           -501433  1pulse
      56      1      external_port_mode*1:4 RW     EEPROM  0..3                      3        -
      60      1      startup_configuration  RW     EEPROM  0..3                      0        -
      63      1      shutdown               RW     EEPROM  0..63                     52       -
      168     2      indirect_address*1:128 RW     EEPROM  512..1023                 634+     -

      512     1      torque_enable          RW     RAM     0..1                      0        -
      513     1      led_red                RW     RAM     0..255                    0        -
      514     1      led_green              RW     RAM     0..255                    0        -
      515     1      led_blue               RW     RAM     0..255                    0        -
      516     1      status_return_level    RW     RAM     0..2                      2        -
      517     1      registered_instruction R      RAM     0..1                      0        -
      518     1      hardware_error_status  R      RAM     0..255                    0        -
      524     2      velocity_i_gain        RW     RAM     0..32767                  2209     -
      526     2      velocity_p_gain        RW     RAM     0..32767                  6153     -
      528     2      position_d_gain        RW     RAM     0..32767                  0        -
      530     2      position_i_gain        RW     RAM     0..32767                  0        -
      532     2      position_p_gain        RW     RAM     0..32767                  314      -
      536     2      feedforward_2nd_gain   RW     RAM     0..32767                  0        -
      538     2      feedforward_1st_gain   RW     RAM     0..32767                  0        -
      546     1s     bus_watchdog           RW     RAM     -1..127                   0        20ms
      548     2s     goal_pwm               RW     RAM     -2009..2009               2009     0.0498%
      550     2s     goal_current           RW     RAM     -22740..22740             22740    1mA
      552     4s     goal_velocity          RW     RAM     -2900..2900               0        0.01rpm
      556     4      profile_acceleration   RW     RAM     0..3992644                0        1rev/min2
      560     4      profile_velocity       RW     RAM     0..2900                   0        0.01rpm
      564     4s     goal_position          RW     RAM     -2147483648..2147483647   -        1pulse
      568     2      realtime_tick          R      RAM     0..32767                  -        1ms
      570     1      moving                 R      RAM     0..1                      -        -
      571     1      moving_status          R      RAM     0..255                    -        -
      572     2s     present_pwm            R      RAM     -2009..2009               -        0.0498%
      574     2s     present_current        R      RAM     -22740..22740             -        1mA
      576     4s     present_velocity       R      RAM     -32767..32767             -        0.01rpm
      580     4s     present_position       R      RAM     -2147483648..2147483647   -        1pulse
      584     4s     velocity_trajectory    R      RAM     -32767..32767             -        0.01rpm
      588     4s     position_trajectory    R      RAM     -2147483648..2147483647   -        1pulse
      592     2      present_input_voltage  R      RAM     0..65535                  240      0.1V
      594     1      present_temperature    R      RAM     0..255                    32       1degC
      600     2      external_port_data*1:4 RW     RAM     0..4095                   0        -
      634     1      indirect_data*1:128    RW     RAM     0..255                    0        -
      878     1      backup_ready           R      RAM     0..1                      0        -
"""

_NOT_IN_PRO_A = ("protocol_type", "startup_configuration", "backup_ready")
_GAINS = ("velocity_i_gain", "velocity_p_gain", "position_d_gain", "position_i_gain", "position_p_gain",
          "feedforward_2nd_gain", "feedforward_1st_gain")  # fmt: skip


def _table(model: str, traits: Traits) -> ControlTable:
    number, current, velocity, half_turn, ends, most_acceleration, acceleration, shutdown = traits.figures
    table = parse_table(model, number, 2 * half_turn, _LAYOUT, traits.series)

    def limit(name: str, minimum: int, maximum: int, default: int | None) -> None:
        table.registers[name] = replace(table[name], minimum=minimum, maximum=maximum, default=default)

    limit("model_number", 0, 65535, number)
    limit("moving_threshold", 0, velocity, 20)
    limit("current_limit", 0, current, current)
    limit("acceleration_limit", 0, most_acceleration, acceleration)
    limit("velocity_limit", 0, velocity, velocity)
    limit("max_position_limit", -half_turn, half_turn, ends)
    limit("min_position_limit", -half_turn, half_turn, -ends)
    limit("shutdown", 0, 63 if number == 2020 else 255, shutdown)
    limit("goal_current", -current, current, current)
    limit("present_current", -current, current, None)
    limit("goal_velocity", -velocity, velocity, 0)
    limit("profile_acceleration", 0, most_acceleration, 0)
    limit("profile_velocity", 0, velocity, 0)
    if number != 2020:
        for name in _GAINS:
            table.registers[name] = replace(table[name], default=None)
    for name in _NOT_IN_PRO_A if model.endswith("-RA") else ():
        del table.registers[name]
    return table


P_SERIES: dict[str, ControlTable] = {
    model: _table(model, traits) for model, traits in TRAITS.items() if traits.series.name == "P"
}
"""By model name."""
