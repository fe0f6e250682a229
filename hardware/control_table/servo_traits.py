"""The facts about each servo model that can be a joint of a rig, one row a model.

Addresses of registers come from the maker's `.model` files, or from `ax_rx_mx` and `p_series`. Speeds and currents are
rounded figures of the data sheets at the voltage named; they serve the emulator and the checks of a rig file, not a
thesis. Where a figure differs from a servo's own register, the register counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hardware.control_table.family import FAMILIES, Family

_CURRENT_MODES = (0, 1, 3, 4, 5, 16)
_VOLTAGE_MODES = (1, 3, 4, 16)


@dataclass(frozen=True, slots=True)
class Traits:
    """A servo model.

    Attributes:
        series: the name of its family, by which its control table is made.
        family: what it shares with others.
        no_load_speed: of the horn at `voltage`, rev/min.
        stall_current: A.
        voltage: V.
        current_unit: mA that one count of current means; 0 where the model measures load, in 0.1 %.
        current_limit: the largest current it takes, in counts.
        velocity_limit: its default, in 0.229 rev/min; in 0.01 rev/min in the P family.
        temperature_limit: its default, degC.
        position_p: default of the position P gain, or the equivalent in the unit of the X series.
        fast_read: the firmware from which it answers fast sync and fast bulk reads; None for never.
        figures: the model number where the maker's files lack it, then what the tables of its family need besides.
    """

    series: str
    family: Family
    no_load_speed: float
    stall_current: float
    voltage: float
    current_unit: float
    current_limit: int
    velocity_limit: int
    temperature_limit: int
    position_p: int
    fast_read: int | None
    modes: tuple[int, ...]
    figures: tuple[int, ...]

    def error_for(self, part: float) -> float:
        """How far from its goal a servo with its default gain drives with this part of its voltage, pulses."""
        return part * self.family.full_pwm * self.family.gain_unit / self.position_p


_ROWS = """
# model         family rpm  stall_A V    mA   current velocity degC P fast  number/figures of the family's tables
XM430-W350      X      46   2.3   12   2.69 1193   200   80  800   45
XM430-W210      X      77   2.3   12   2.69 1193   330   80  800   45
XH430-W350      X      30   1.3   12   2.69 648    135   80  800   45
XH430-W210      X      50   1.3   12   2.69 648    210   80  800   45
XH430-V350      X      27   0.7   24   1.34 689    135   80  800   45
XH430-V210      X      46   0.7   24   1.34 689    230   80  800   45
XD430-T350      X      30   1.3   12   2.69 648    135   80  800   45
XD430-T210      X      50   1.3   12   2.69 648    210   80  800   45
XM540-W270      X540   30   4.4   12   2.69 2047   128   80  800   45
XM540-W150      X540   53   4.4   12   2.69 2047   230   80  800   45
XH540-W270      X540   39   4.9   12   2.69 2047   167   80  800   45
XH540-W150      X540   70   4.9   12   2.69 2047   300   80  800   45
XH540-V270      X540   33   2.4   24   2.69 1188   167   80  800   45
XH540-V150      X540   61   2.4   24   2.69 1188   300   80  800   45
XD540-T270      X540   39   4.9   12   2.69 2047   167   80  800   45
XD540-T150      X540   70   4.9   12   2.69 2047   300   80  800   45
XW430-T200      X      53   2.3   12   2.69 2047   235   80  900   45  1280
XW430-T333      X      36   1.3   12   2.69 648    135   80  800   45
XW540-T260      X540   37   4.9   12   2.69 2047   167   80  800   45
XW540-T140      X540   65   4.9   12   2.69 2047   300   80  800   45
XW540-H260      X540   37   2.4   24   2.69 2047   167   80  800   45
XL430-W250      X      61   1.4   12   0    0      265   72  640   45
XC430-W150      X      106  1.4   12   0    0      460   72  640   45
XC430-W240      X      70   1.4   12   0    0      300   72  640   45
2XL430-W250     X      61   1.4   12   0    0      265   72  640   -
2XC430-W250     X      64   1.8   12   0    0      280   72  640   -
XL330-M077      X330   383  1.47  5    1.0  1750   1620  70  400   46
XL330-M288      X330   104  1.47  5    1.0  1750   445   70  400   46
XC330-M181      X330   129  1.8   5    1.0  1750   600   70  400   46
XC330-M288      X330   81   1.8   5    1.0  1750   380   70  400   46
XC330-T181      X330   127  0.8   12   1.0  910    560   70  400   46
XC330-T288      X330   80   0.8   12   1.0  910    360   70  400   46
MX-28           X      55   1.4   12   0    0      230   80  850   -
MX-64           X      63   4.1   12   3.36 1941   285   80  850   -
MX-106          X      45   5.2   12   3.36 2047   210   80  850   -
MX-28(1.0)      MX1    55   1.4   12   0    0      0     80  850   -   29
MX-64(1.0)      MX1    63   4.1   12   0    0      0     80  850   -   310
MX-106(1.0)     MX1    45   5.2   12   0    0      0     80  850   -   320
AX-12A          AX     59   1.5   12   0    0      0     70  2835  -   12
AX-12W          AX     470  1.4   12   0    0      0     70  2835  -   300
AX-18A          AX     97   2.2   12   0    0      0     75  2835  -   18
RX-10           RX     54   1.3   12   0    0      0     80  2835  -   10
RX-24F          RX     126  2.4   12   0    0      0     80  2835  -   24
RX-28           RX     79   1.9   14.8 0    0      0     80  2835  -   28
RX-64           RX     64   2.6   14.8 0    0      0     80  2835  -   64
XL-320          XL320  114  1.1   7.4  0    0      0     65  2835  -   350
PH54-200-S500   P      33.1 22.7  24   1.0  22740  2900  80  314   -   2020/501923/501433/3992644/3992644/52
PH54-100-S500   P      33.3 15.9  24   1.0  15900  2920  80  314   -   2010/501923/501433/4255632/10639/58
PH42-020-S300   P      32.7 4.5   24   1.0  4500   2920  80  314   -   2000/303750/303454/4306173/10765/58
PM54-060-S250   P      33.1 8.0   24   1.0  7980   2830  80  314   -   2120/251417/251173/4457932/11145/58
PM54-040-S250   P      28.4 4.5   24   1.0  4470   2840  80  314   -   2110/251417/251173/4414976/11037/58
PM42-010-S260   P      28.0 1.5   24   1.0  1461   2600  80  314   -   2100/263187/262931/4346756/10867/58
H54-200-S500-RA P      33.1 22.7  24   1.0  22740  2900  80  314   -   54025/501923/501433/3992644/9982/52
H54-100-S500-RA P      33.3 15.9  24   1.0  15900  2920  80  314   -   53769/501923/501433/4255632/10639/52
H42-20-S300-RA  P      32.7 4.5   24   1.0  4500   2920  80  314   -   51201/303750/303454/4306173/10765/52
M54-60-S250-RA  P      33.1 8.0   24   1.0  7980   2830  80  314   -   46353/251417/251173/4457932/11145/52
M54-40-S250-RA  P      28.4 4.5   24   1.0  4470   2840  80  314   -   46097/251417/251173/4414976/11037/52
M42-10-S260-RA  P      28.0 1.5   24   1.0  1461   2600  80  314   -   43289/263187/262931/4346756/10867/52
"""


def _traits(row: Sequence[str]) -> Traits:
    series, rpm, stall, volt, unit, current, velocity, temperature, gain, fast, *figures = row
    family = FAMILIES[series]
    return Traits(
        series,
        family,
        float(rpm),
        float(stall),
        float(volt),
        float(unit),
        int(current),
        int(velocity),
        int(temperature),
        int(gain),
        None if fast == "-" else int(fast),
        family.modes or (_CURRENT_MODES if float(unit) else _VOLTAGE_MODES),
        tuple(int(number) for text in figures for number in text.split("/")),
    )


TRAITS: dict[str, Traits] = {
    row[0]: _traits(row[1:]) for line in _ROWS.splitlines() if (row := line.partition("#")[0].split())
}
"""By model name."""
