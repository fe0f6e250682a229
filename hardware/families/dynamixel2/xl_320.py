"""The control table of the XL-320 (e-Manual): laid out like one of Protocol 1.0, read by Protocol 2.0.

Present speed and load hold their size and, in bit 10, their sign. No watchdog, no fast read and no acceleration.
"""

from __future__ import annotations

from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.table import parse_table

XL_320 = parse_table(
    "XL-320",
    number=350,
    pulses_per_turn=1228,  # 1023 of them are 300 degrees
    series=TRAITS["XL-320"].series,
    text="""
    # address length name                   access memory  range              default  unit
      0       2      model_number           R      EEPROM  0..65535           350      -
      2       1      firmware_version       R      EEPROM  0..255             29       -
      3       1      id                     RW     EEPROM  0..252             1        -
      4       1      baud_rate              RW     EEPROM  0..3               3        -
      5       1      return_delay_time      RW     EEPROM  0..254             250      2us
      6       2      min_position_limit     RW     EEPROM  0..1023            0        1pulse       # CW angle limit
      8       2      max_position_limit     RW     EEPROM  0..1023            1023     1pulse       # CCW angle limit
      11      1      control_mode           RW     EEPROM  1..2               2        -
      12      1      temperature_limit      RW     EEPROM  0..150             65       1degC
      13      1      min_voltage_limit      RW     EEPROM  50..250            60       0.1V
      14      1      max_voltage_limit      RW     EEPROM  50..250            90       0.1V
      15      2      max_torque             RW     EEPROM  0..1023            1023     0.1%
      17      1      status_return_level    RW     EEPROM  0..2               2        -
      18      1      shutdown               RW     EEPROM  0..7               3        -
      24      1      torque_enable          RW     RAM     0..1               0        -
      25      1      led                    RW     RAM     0..7               0        -
      27      1      position_d_gain        RW     RAM     0..254             0        -            # D gain
      28      1      position_i_gain        RW     RAM     0..254             0        -            # I gain
      29      1      position_p_gain        RW     RAM     0..254             32       -            # P gain
      30      2      goal_position          RW     RAM     0..1023            -        1pulse
      32      2m     profile_velocity       RW     RAM     0..2047            0        0.111rpm     # moving speed
      35      2      torque_limit           RW     RAM     0..1023            1023     0.1%
      37      2      present_position       R      RAM     0..65535           -        1pulse
      39      2m     present_velocity       R      RAM     0..2047            -        0.111rpm     # present speed
      41      2m     present_load           R      RAM     0..2047            -        0.1%
      45      1      present_input_voltage  R      RAM     0..255             -        0.1V         # present voltage
      46      1      present_temperature    R      RAM     0..255             -        1degC
      47      1      registered_instruction R      RAM     0..1               0        -
      49      1      moving                 R      RAM     0..1               -        -
      50      1      hardware_error_status  R      RAM     0..255             0        -
      51      2      punch                  RW     RAM     0..1023            32       -
    """,
)
