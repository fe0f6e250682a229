"""Identified motors of servos of Protocol 1.0 (`mx64` and `mx106` of BAM at 15 V, see `identified_motor`)."""

from hardware.families.identified_motor import parse_motors

MOTORS = parse_motors("""
#model      kt    R     inertia duty  base rest  motor load   rest:m rest:l quad:m  quad:l slow  alpha viscous
MX-64(1.0)  1.602 2.316 .01227  .9625 0    .1227 .3115 0      .1877  .01407 .006909 .01000 2.575 .8409 .02534
MX-106(1.0) 2.210 2.034 .02602  .9625 0    .1220 .1980 .02222 .1986  .08710 .01000  .00007 1.746 1.143 .05072
""")
