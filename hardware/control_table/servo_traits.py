"""What the maker's `.model` files lack about the servos: their motors, units, limits and operating modes.

Speeds and currents are rounded figures of the data sheets at the voltage named; they serve the emulator and the checks
of a rig file, not a thesis. Where a figure differs from a servo's own register, the register counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hardware.control_table.p_series import P_SERIES

CURRENT_MODES = (0, 1, 3, 4, 5, 16)
VOLTAGE_MODES = (1, 3, 4, 16)
P_MODES = (0, 1, 3, 4, 16)


@dataclass(frozen=True, slots=True)
class Traits:
    """A model of the X, MX, AX, RX, P or PRO(A) series, or the XL-320.

    Attributes:
        no_load_speed: of the horn at `voltage`, rev/min.
        stall_current: A.
        voltage: V.
        current_unit: mA that one count of current means; 0 where the model measures load, in 0.1 %.
        current_limit: the largest current it takes, in counts.
        velocity_limit: its default, in 0.229 rev/min.
        temperature_limit: its default, degC.
        position_p: default of the position P gain, or what would be as stiff in the unit of the X series.
        fast_read: the firmware from which it answers fast sync and fast bulk reads; None for never.
        modes: the operating modes it has.
        full_pwm: the count of PWM that means full voltage.
        gain_unit: the position P gain with which a pulse of error is one count of PWM.
    """

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
    full_pwm: float = 885.0
    gain_unit: float = 128.0

    def error_for(self, part: float) -> float:
        """How far from its goal a servo with its gain from the box drives with this part of its voltage, pulses."""
        return part * self.full_pwm * self.gain_unit / self.position_p


_ROWS = """
# model        rpm   stall_A  V     unit_mA  current  velocity  degC  P    fast
XM430-W350      46   2.3      12    2.69     1193     200       80    800  45
XM430-W210      77   2.3      12    2.69     1193     330       80    800  45
XH430-W350      30   1.3      12    2.69      648     135       80    800  45
XH430-W210      50   1.3      12    2.69      648     210       80    800  45
XH430-V350      27   0.7      24    1.34      689     135       80    800  45
XH430-V210      46   0.7      24    1.34      689     230       80    800  45
XD430-T350      30   1.3      12    2.69      648     135       80    800  45
XD430-T210      50   1.3      12    2.69      648     210       80    800  45
XM540-W270      30   4.4      12    2.69     2047     128       80    800  45
XM540-W150      53   4.4      12    2.69     2047     230       80    800  45
XH540-W270      39   4.9      12    2.69     2047     167       80    800  45
XH540-W150      70   4.9      12    2.69     2047     300       80    800  45
XH540-V270      33   2.4      24    2.69     1188     167       80    800  45
XH540-V150      61   2.4      24    2.69     1188     300       80    800  45
XD540-T270      39   4.9      12    2.69     2047     167       80    800  45
XD540-T150      70   4.9      12    2.69     2047     300       80    800  45
XW430-T200      53   2.3      12    2.69     2047     235       80    900  45
XW430-T333      36   1.3      12    2.69      648     135       80    800  45
XW540-T260      37   4.9      12    2.69     2047     167       80    800  45
XW540-T140      65   4.9      12    2.69     2047     300       80    800  45
XW540-H260      37   2.4      24    2.69     2047     167       80    800  45
XL430-W250      61   1.4      12    0           0     265       72    640  45
XC430-W150     106   1.4      12    0           0     460       72    640  45
XC430-W240      70   1.4      12    0           0     300       72    640  45
2XL430-W250     61   1.4      12    0           0     265       72    640  -
2XC430-W250     64   1.8      12    0           0     280       72    640  -
XL330-M077     383   1.47     5     1.0      1750     1620      70    400  46
XL330-M288     104   1.47     5     1.0      1750     445       70    400  46
XC330-M181     129   1.8      5     1.0      1750     600       70    400  46
XC330-M288      81   1.8      5     1.0      1750     380       70    400  46
XC330-T181     127   0.8     12     1.0       910     560       70    400  46
XC330-T288      80   0.8     12     1.0       910     360       70    400  46
MX-28           55   1.4      12    0           0     230       80    850  -
MX-64           63   4.1      12    3.36     1941     285       80    850  -
MX-106          45   5.2      12    3.36     2047     210       80    850  -
MX-28(1.0)      55   1.4      12    0           0       0       80    850  -
MX-64(1.0)      63   4.1      12    0           0       0       80    850  -
MX-106(1.0)     45   5.2      12    0           0       0       80    850  -
AX-12A          59   1.5      12    0           0       0       70   2835  -
AX-12W         470   1.4      12    0           0       0       70   2835  -
AX-18A          97   2.2      12    0           0       0       75   2835  -
RX-10           54   1.3      12    0           0       0       80   2835  -
RX-24F         126   2.4      12    0           0       0       80   2835  -
RX-28           79   1.9      14.8  0           0       0       80   2835  -
RX-64           64   2.6      14.8  0           0       0       80   2835  -
XL-320         114   1.1      7.4   0           0       0       65   2835  -
PH54-200-S500   33.1  22.7     24   1.0      22740     2900     80    314  -
PH54-100-S500   33.3  15.9     24   1.0      15900     2920     80    314  -
PH42-020-S300   32.7   4.5     24   1.0       4500     2920     80    314  -
PM54-060-S250   33.1   8.0     24   1.0       7980     2830     80    314  -
PM54-040-S250   28.4   4.5     24   1.0       4470     2840     80    314  -
PM42-010-S260   28.0   1.5     24   1.0       1461     2600     80    314  -
H54-200-S500-RA 33.1  22.7     24   1.0      22740     2900     80    314  -
H54-100-S500-RA 33.3  15.9     24   1.0      15900     2920     80    314  -
H42-20-S300-RA  32.7   4.5     24   1.0       4500     2920     80    314  -
M54-60-S250-RA  33.1   8.0     24   1.0       7980     2830     80    314  -
M54-40-S250-RA  28.4   4.5     24   1.0       4470     2840     80    314  -
M42-10-S260-RA  28.0   1.5     24   1.0       1461     2600     80    314  -
"""
_P_FULL_PWM = 2009.0
_P_GAIN_UNIT = 2048.0  # no manual tells it; an estimate that makes them about as stiff as the X series


def _traits(row: Sequence[str]) -> Traits:
    model, rpm, stall, volt, unit, current, velocity, temperature, gain, fast = row
    traits = Traits(
        float(rpm),
        float(stall),
        float(volt),
        float(unit),
        int(current),
        int(velocity),
        int(temperature),
        int(gain),
        None if fast == "-" else int(fast),
        CURRENT_MODES if float(unit) else VOLTAGE_MODES,
    )
    if model not in P_SERIES:
        return traits
    return replace(traits, modes=P_MODES, full_pwm=_P_FULL_PWM, gain_unit=_P_GAIN_UNIT)


TRAITS: dict[str, Traits] = {
    row[0]: _traits(row) for line in _ROWS.splitlines() if (row := line.partition("#")[0].split())
}
"""By model name."""
