"""The control table of the STS3215 (memory table of the STS series, FT-SMS-STS e-manual; initial values of firmware 3).

A register that does what one of the Dynamixel X series does has its name here; the manual's own is behind the #.
Numbers with a size and a sign in some bit are `2m` and the bit.
"""

from __future__ import annotations

from hardware.families.feetech.traits import TRAITS
from hardware.families.table import parse_table

STS3215 = parse_table(
    "STS3215",
    number=777,
    pulses_per_turn=4096,
    series=TRAITS["STS3215"].series,
    text="""
    # address length name                   access memory  range              default  unit
      0       1      firmware_version       R      EEPROM  0..255             3        -            # major
      1       1      firmware_minor         R      EEPROM  0..255             6        -
      2       1      byte_order             R      EEPROM  0..1               0        -            # 0 is little-endian
      3       2      model_number           R      EEPROM  0..65535           777      -            # servo version
      5       1      id                     RW     EEPROM  0..253             1        -
      6       1      baud_rate              RW     EEPROM  0..7               0        -
      7       1      return_delay_time      RW     EEPROM  0..254             0        2us
      8       1      status_return_level    RW     EEPROM  0..1               1        -            # response level
      9       2      min_position_limit     RW     EEPROM  0..4094            0        1pulse
      11      2      max_position_limit     RW     EEPROM  0..4095            4095     1pulse
      13      1      temperature_limit      RW     EEPROM  0..100             70       1degC
      14      1      max_voltage_limit      RW     EEPROM  0..254             80       0.1V
      15      1      min_voltage_limit      RW     EEPROM  0..254             40       0.1V
      16      2      max_torque             RW     EEPROM  0..1000            1000     0.1%
      18      1      phase                  RW     EEPROM  0..254             12       -
      19      1      shutdown               RW     EEPROM  0..254             44       -            # unloading
      20      1      alarm_led              RW     EEPROM  0..254             47       -
      21      1      position_p_gain        RW     EEPROM  0..254             32       -
      22      1      position_d_gain        RW     EEPROM  0..254             32       -
      23      1      position_i_gain        RW     EEPROM  0..254             0        -
      24      2      minimum_startup_force  RW     EEPROM  0..1000            16       0.1%
      26      1      cw_dead_zone           RW     EEPROM  0..32              1        1pulse
      27      1      ccw_dead_zone          RW     EEPROM  0..32              1        1pulse
      28      2      protection_current     RW     EEPROM  0..2047            500      6.5mA
      30      1      angular_resolution     RW     EEPROM  1..128             1        -
      31      2m11   homing_offset          RW     EEPROM  0..4095            0        1pulse       # correction
      33      1      control_mode           RW     EEPROM  0..3               0        -            # operating mode
      34      1      protective_torque      RW     EEPROM  0..254             20       1%
      35      1      protection_time        RW     EEPROM  0..254             200      10ms
      36      1      overload_torque        RW     EEPROM  0..254             80       1%
      37      1      velocity_p_gain        RW     EEPROM  0..254             10       -
      38      1      overcurrent_time       RW     EEPROM  0..254             200      10ms
      39      1      velocity_i_gain        RW     EEPROM  0..254             10       -
      40      1      torque_enable          RW     RAM     0..2               0        -
      41      1      profile_acceleration   RW     RAM     0..254             0        8.789deg/s2  # 100 steps/s2
      42      2m15   goal_position          RW     RAM     0..65535           -        1pulse
      44      2      goal_time              RW     RAM     0..65535           0        1ms
      46      2m15   profile_velocity       RW     RAM     0..65535           0        0.014648rpm  # 1 step/s
      48      2      torque_limit           RW     RAM     0..1000            1000     0.1%
      55      1      lock                   RW     RAM     0..1               1        -
      56      2m15   present_position       R      RAM     0..65535           -        1pulse
      58      2m15   present_velocity       R      RAM     0..65535           -        0.014648rpm
      60      2m10   present_load           R      RAM     0..2047            -        0.1%
      62      1      present_input_voltage  R      RAM     0..255             -        0.1V
      63      1      present_temperature    R      RAM     0..255             -        1degC
      64      1      registered_instruction R      RAM     0..1               0        -
      65      1      hardware_error_status  R      RAM     0..255             0        -            # servo status
      66      1      moving                 R      RAM     0..1               -        -
      69      2m15   present_current        R      RAM     0..65535           -        6.5mA
      80      1      moving_threshold       RW     EEPROM  0..255             0        -            # 80 to 86: factory
      81      1      control_period         RW     EEPROM  0..255             0        1ms
      82      1      velocity_unit          RW     EEPROM  0..255             0        -
      83      1      hts                    RW     EEPROM  0..255             0        -
      84      1      most_velocity          RW     EEPROM  0..255             0        0.732rpm
      85      1      most_acceleration      RW     EEPROM  0..255             0        8.789deg/s2
      86      1      acceleration_factor    RW     EEPROM  0..255             0        -
    """,
)
