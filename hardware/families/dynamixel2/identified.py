"""Identified motors of servos of Protocol 2.0 (`xl330`, `mx64` and `mx106` of BAM, see `identified_motor`).

BAM names its XL330 no further; stall torque and no-load speed are those of the M288 (0.53 N·m and 111 rev/min at 5 V;
the maker has 0.52 and 103, and 0.215 and 383 of the M077). Its MX ran at 15 V with gains of Protocol 1.0: motor and
gears are the same with either firmware.
"""

from hardware.families.identified_motor import parse_motors

MOTORS = parse_motors("""
#model     kt    R     inertia duty  base   rest  motor load   rest:m rest:l quad:m  quad:l  slow  alpha viscous
XL330-M288 .3725 2.677 .001926 1     .01088 0     .2220 0      0      .1527  .003232 .003159 1.763 1.034 .005403
MX-64      1.602 2.316 .01227  .9625 0      .1227 .3115 0      .1877  .01407 .006909 .01000  2.575 .8409 .02534
MX-106     2.210 2.034 .02602  .9625 0      .1220 .1980 .02222 .1986  .08710 .01000  .00007  1.746 1.143 .05072
""")
