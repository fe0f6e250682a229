"""The series and models of Protocol 2.0: X, MX with its newer firmware, XL-320, P and PRO(A)."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel2.family import FAMILY
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE, Series
from hardware.families.traits import parse_traits

X = Series("X", FAMILY)
_XL_320 = MappingProxyType({VOLTAGE: 4, HEAT: 2, OVERLOAD: 1})
_SERIES = (
    X,
    replace(X, name="X330", cells_moved=(52, 16)),
    replace(X, name="X540", follows=True),
    # No manual tells the gain unit; an estimate that makes them about as stiff as the X series.
    Series(
        "P",
        FAMILY,
        checks_profiles=True,
        modes=(0, 1, 3, 4, 16),
        current_limited=(1, 3, 4),
        full_pwm=2009.0,
        gain_unit=2048.0,
    ),
    Series("XL320", FAMILY, problems=_XL_320, shuts_down_by="torque_limit"),
)

# Estimates: the stall torque of the P and PRO(A) series is unknown, their stall current is the current limit, and the
# stiffness is explained above. XW430-T200: the motor of the T333. XW540-H260: speed and current are estimates.
# XM335-T323: the motor is a dealer's figures, as the maker's page has none.
_ROWS = """
# model         series rpm  stall_A N·m  V    mA   stiffness fast  number/figures of the series' tables
XM430-W350      X      46   2.3   4.1    12   2.69 -    45
XM430-W210      X      77   2.3   3.0    12   2.69 -    45
XH430-W350      X      30   1.3   3.4    12   2.69 -    45
XH430-W210      X      50   1.3   2.5    12   2.69 -    45
XH430-V350      X      31   0.7   3.3    24   1.34 -    45
XH430-V210      X      52   0.7   2.6    24   1.34 -    45
XD430-T350      X      30   1.3   3.4    12   2.69 -    45
XD430-T210      X      50   1.3   2.5    12   2.69 -    45
XM540-W270      X540   30   4.4   10.6   12   2.69 -    45
XM540-W150      X540   53   4.4   7.3    12   2.69 -    45
XH540-W270      X540   39   4.9   9.9    12   2.69 -    45
XH540-W150      X540   70   4.9   7.1    12   2.69 -    45
XH540-V270      X540   34   2.4   9.2    24   2.69 -    45
XH540-V150      X540   60   2.4   6.4    24   2.69 -    45
XD540-T270      X540   39   4.9   9.9    12   2.69 -    45
XD540-T150      X540   70   4.9   7.1    12   2.69 -    45
XW430-T200      X      53   1.3   -      12   2.69 -    45  1280
XW430-T333      X      31   1.3   3.1    12   2.69 -    45
XW540-T260      X      40   4.9   9.5    12   2.69 -    45
XW540-T140      X      72   4.9   6.9    12   2.69 -    45
XW540-H260      X      37   2.4   -      24   2.69 -    45
XL430-W250      X      61   1.4   1.5    12   0    -    45
XC430-W150      X      106  1.4   1.6    12   0    -    45
XC430-W240      X      70   1.4   1.9    12   0    -    45
2XL430-W250     X      61   1.4   1.5    12   0    -    -
2XC430-W250     X      64   1.4   1.8    12   0    -    -
XL330-M077      X330   383  1.47  0.215  5    1.0  -    46
XL330-M288      X330   103  1.47  0.52   5    1.0  -    46
XC330-M181      X330   129  1.8   0.60   5    1.0  -    46
XC330-M288      X330   81   1.8   0.93   5    1.0  -    46
XC330-T181      X330   113  0.88  0.80   12   1.0  -    46
XC330-T288      X330   71   0.88  1.00   12   1.0  -    46
XM335-T323      X330   53   0.8   1.03   11.1 1.0 -    46  1710
MX-28           X      55   1.4   2.5    12   0    -    -
MX-64           X      63   4.1   6.0    12   3.36 -    -
MX-106          X540   45   5.2   8.4    12   3.36 -    -
XL-320          XL320  114  1.1   0.39   7.4  0    2835 -   350
PH54-200-S500   P      33.1 22.7  -      24   1.0  314  -   2020/22740/2900/501923/501433/3992644/3992644/52
PH54-100-S500   P      33.3 15.9  -      24   1.0  314  -   2010/15900/2920/501923/501433/4255632/10639/58
PH42-020-S300   P      32.7 4.5   -      24   1.0  314  -   2000/4500/2920/303750/303454/4306173/10765/58
PM54-060-S250   P      33.1 8.0   -      24   1.0  314  -   2120/7980/2830/251417/251173/4457932/11145/58
PM54-040-S250   P      28.4 4.5   -      24   1.0  314  -   2110/4470/2840/251417/251173/4414976/11037/58
PM42-010-S260   P      28.0 1.5   -      24   1.0  314  -   2100/1461/2600/263187/262931/4346756/10867/58
H54-200-S500-RA P      33.1 22.7  -      24   1.0  314  -   54025/22740/2900/501923/501433/3992644/9982/52
H54-100-S500-RA P      33.3 15.9  -      24   1.0  314  -   53769/15900/2920/501923/501433/4255632/10639/52
H42-20-S300-RA  P      32.7 4.5   -      24   1.0  314  -   51201/4500/2920/303750/303454/4306173/10765/52
M54-60-S250-RA  P      33.1 8.0   -      24   1.0  314  -   46353/7980/2830/251417/251173/4457932/11145/52
M54-40-S250-RA  P      28.4 4.5   -      24   1.0  314  -   46097/4470/2840/251417/251173/4414976/11037/52
M42-10-S260-RA  P      28.0 1.5   -      24   1.0  314  -   43289/1461/2600/263187/262931/4346756/10867/52
"""

TRAITS = parse_traits(_ROWS, {series.name: series for series in _SERIES})
"""By model name."""
