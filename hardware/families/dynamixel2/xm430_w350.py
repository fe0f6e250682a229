"""The control table of the XM430-W350 (e-Manual, firmware 45 and later)."""

from __future__ import annotations

from hardware.families.dynamixel2.traits import X
from hardware.families.table import parse_table

XM430_W350 = parse_table(
    "XM430-W350",
    number=1020,
    pulses_per_turn=4096,
    series=X,
    text="""
    # address length name                   access memory  range              default  unit
      0       2      model_number           R      EEPROM  0..65535           1020     -
      2       4      model_information      R      EEPROM  0..4294967295      0        -
      6       1      firmware_version       R      EEPROM  0..255             46       -
      7       1      id                     RW     EEPROM  0..252             1        -
      8       1      baud_rate              RW     EEPROM  0..7               1        -
      9       1      return_delay_time      RW     EEPROM  0..254             250      2us
      10      1      drive_mode             RW     EEPROM  0..15              0        -
      11      1      operating_mode         RW     EEPROM  0..16              3        -
      12      1      secondary_id           RW     EEPROM  0..255             255      -
      13      1      protocol_type          RW     EEPROM  1..2               2        -
      20      4s     homing_offset          RW     EEPROM  -1044479..1044479  0        1pulse
      24      4      moving_threshold       RW     EEPROM  0..1023            10       0.229rpm
      31      1      temperature_limit      RW     EEPROM  0..100             80       1degC
      32      2      max_voltage_limit      RW     EEPROM  95..160            160      0.1V
      34      2      min_voltage_limit      RW     EEPROM  95..160            95       0.1V
      36      2      pwm_limit              RW     EEPROM  0..885             885      0.113%
      38      2      current_limit          RW     EEPROM  0..1193            1193     2.69mA
      40      4      acceleration_limit     RW     EEPROM  0..32767           32767    214.577rev/min2
      44      4      velocity_limit         RW     EEPROM  0..1023            200      0.229rpm
      48      4      max_position_limit     RW     EEPROM  0..4095            4095     1pulse
      52      4      min_position_limit     RW     EEPROM  0..4095            0        1pulse
      60      1      startup_configuration  RW     EEPROM  0..3               0        -
      63      1      shutdown               RW     EEPROM  0..63              52       -

      64      1      torque_enable          RW     RAM     0..1               0        -
      65      1      led                    RW     RAM     0..1               0        -
      68      1      status_return_level    RW     RAM     0..2               2        -
      69      1      registered_instruction R      RAM     0..1               0        -
      70      1      hardware_error_status  R      RAM     0..255             0        -
      76      2      velocity_i_gain        RW     RAM     0..16383           1920     -
      78      2      velocity_p_gain        RW     RAM     0..16383           100      -
      80      2      position_d_gain        RW     RAM     0..16383           0        -
      82      2      position_i_gain        RW     RAM     0..16383           0        -
      84      2      position_p_gain        RW     RAM     0..16383           800      -
      88      2      feedforward_2nd_gain   RW     RAM     0..16383           0        -
      90      2      feedforward_1st_gain   RW     RAM     0..16383           0        -
      98      1s     bus_watchdog           RW     RAM     -1..127            0        20ms
      100     2s     goal_pwm               RW     RAM     -885..885          885      0.113%
      102     2s     goal_current           RW     RAM     -1193..1193        1193     2.69mA
      104     4s     goal_velocity          RW     RAM     -1023..1023        0        0.229rpm
      108     4      profile_acceleration   RW     RAM     0..32767           0        214.577rev/min2
      112     4      profile_velocity       RW     RAM     0..32767           0        0.229rpm
      116     4s     goal_position          RW     RAM     -1048575..1048575  -        1pulse
      120     2      realtime_tick          R      RAM     0..32767           -        1ms
      122     1      moving                 R      RAM     0..1               -        -
      123     1      moving_status          R      RAM     0..255             -        -
      124     2s     present_pwm            R      RAM     -885..885          -        0.113%
      126     2s     present_current        R      RAM     -1193..1193        -        2.69mA
      128     4s     present_velocity       R      RAM     -32767..32767      -        0.229rpm
      132     4s     present_position       R      RAM     -2147483648..2147483647 -   1pulse
      136     4s     velocity_trajectory    R      RAM     -32767..32767      -        0.229rpm
      140     4s     position_trajectory    R      RAM     -2147483648..2147483647 -   1pulse
      144     2      present_input_voltage  R      RAM     0..65535           120      0.1V
      146     1      present_temperature    R      RAM     0..255             32       1degC
      147     1      backup_ready           R      RAM     0..1               0        -

      168     2      indirect_address*1:28  RW     RAM     64..661            224+     -
      224     1      indirect_data*1:28     RW     RAM     0..255             0        -
      578     2      indirect_address*29:56 RW     RAM     64..661            634+     -
      634     1      indirect_data*29:56    RW     RAM     0..255             0        -
    """,
)
