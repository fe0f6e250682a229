"""The control tables of the X series and of the MX servos of Protocol 2.0: how each model differs from the XM430-W350.

The figures are those of each model's page in the maker's e-Manual; what a row lacks is as in the XM430-W350. Both
voltage limits have the range `volts`, and its ends are their defaults. The pages of the MX servos are of their first
firmware for Protocol 2.0, all others of firmware 45 and later. By the maker's word an XD has the table of the XH of its
size. The page of the XW430 has protocol type 1 as the default; taken for a slip, as its siblings have 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.register import Register
from hardware.families.rows import rows_of
from hardware.families.traits import Traits

_ROWS = """
# model        volts     degC   current  velocity  position        velocity   exceptions
#              0.1 V     limit  limit    limit     P     I    D     I     P
XM430-W210     95..160   80     1193     330       800   0    0     1920  100
XH430-W350     95..160   80     648      130       900   0    0     1920  100
XH430-W210     95..160   80     648      210       900   0    0     1920  100
XH430-V350     110..300  80     689      135       800   0    0     1920  100
XH430-V210     110..300  80     689      230       800   0    0     1920  100
XD430-T350     95..160   80     648      130       900   0    0     1920  100
XD430-T210     95..160   80     648      210       900   0    0     1920  100
XM540-W270     95..160   80     2047     128       800   0    0     1920  100
XM540-W150     95..160   80     2047     230       800   0    0     1920  100
XH540-W270     95..160   80     2047     167       800   0    0     1920  100
XH540-W150     95..160   80     2047     300       800   0    0     1920  100
XH540-V270     110..300  80     1188     128       800   0    0     1920  100
XH540-V150     110..300  80     1188     230       800   0    0     1920  100
XD540-T270     95..160   80     2047     167       800   0    0     1920  100
XD540-T150     95..160   80     2047     300       800   0    0     1920  100
XW430-T200     95..160   80     2047     235       900   0    0     1920  100
XW430-T333     95..160   80     2047     139       900   0    0     1920  100
XW540-T260     95..160   80     2047     167       800   0    0     1920  100
XW540-T140     95..160   80     2047     304       800   0    0     1920  100
XW540-H260     110..300  80     1188     145       800   0    0     1920  100
XL430-W250     60..140   72     -        265       640   0    4000  1000  100
XC430-W150     60..160   80     -        460       460   0    0     1920  100  moving_threshold=20
XC430-W240     60..160   80     -        306       700   0    0     1920  100
2XL430-W250    60..140   72     -        250       640   0    2000  1800  100
2XC430-W250    60..160   80     -        275       700   0    0     1920  100
XL330-M077     31..70    70     1750     1620      400   400  0     400   40   shutdown=53 min_voltage_limit=35
XL330-M288     31..70    70     1750     445       400   0    0     1600  180  shutdown=53 min_voltage_limit=35
XC330-M181     31..70    70     2352     545       1200  0    500   1400  100  min_voltage_limit=35
XC330-M288     31..70    70     2352     350       1100  0    500   1600  50   min_voltage_limit=35
XC330-T181     55..140   70     910      510       900   0    0     1200  40   pwm_slope=255
XC330-T288     55..140   70     910      320       900   0    0     1200  40   pwm_slope=255
XM335-T323     55..140 70 910 280 2000 0 0 1800 50 pwm_slope=255 min_position_limit=1024 max_position_limit=3072
MX-28          95..160   80     -        380       850   0    0     1920  100
MX-64          95..160   80     1941     435       850   0    0     1920  100
MX-106         95..160   80     2047     360       850   0    0     1920  100
"""
_COLUMNS = ("position_p_gain", "position_i_gain", "position_d_gain", "velocity_i_gain", "velocity_p_gain")
_Facts = dict[str, dict[str, int]]


def _facts(row: Sequence[str], traits: Traits) -> _Facts:
    """By register what differs from the XM430-W350: `minimum`, `maximum`, `default`."""
    volts, degrees, current, velocity, *rest = row
    low, high = (int(end) for end in volts.split(".."))
    facts: _Facts = {
        "min_voltage_limit": {"minimum": low, "maximum": high, "default": low},
        "max_voltage_limit": {"minimum": low, "maximum": high, "default": high},
        "temperature_limit": {"default": int(degrees)},
        "velocity_limit": {"default": int(velocity)},
        "present_input_voltage": {"default": round(traits.voltage * 10)},
        "drive_mode": {"maximum": 15 if traits.series.follows else 13},
        "external_port_mode_1": (port := {"maximum": 3, "default": 3}),
        "external_port_mode_2": port,
        "external_port_mode_3": port,
    }
    if current != "-":
        most = int(current)
        facts["current_limit"] = {"maximum": most, "default": most}
        facts["goal_current"] = {"minimum": -most, "maximum": most, "default": most}
        facts["present_current"] = {"minimum": -most, "maximum": most}
    if traits.series.name == "X330":
        facts["baud_rate"] = {"maximum": 6}
        facts["protocol_type"] = {"minimum": 2, "maximum": 22}
        facts["pwm_slope"] = {"minimum": 1, "maximum": 255, "default": 140}
        facts["velocity_limit"]["maximum"] = 2047
        facts["goal_velocity"] = {"minimum": -2047, "maximum": 2047}
    gains, exceptions = rest[: len(_COLUMNS)], rest[len(_COLUMNS) :]
    for name, value in (*zip(_COLUMNS, gains, strict=True), *(word.split("=") for word in exceptions)):
        facts.setdefault(name, {})["default"] = int(value)
    return facts


_FACTS: Mapping[str, _Facts] = {model: _facts(row, TRAITS[model]) for model, *row in rows_of(_ROWS)}


def as_in_manual(model: str, register: Register) -> Register:
    """A register as the XM430-W350 has it, or one that it lacks, with the figures of this model."""
    if register.name == "present_load":
        return replace(register, signed=True, minimum=-1000, maximum=1000, unit="%", scale=0.1)
    if register.unit == "mA":
        register = replace(register, scale=TRAITS[model].current_unit)
    facts = _FACTS[model].get(register.name, {})
    return replace(
        register,
        minimum=facts.get("minimum", register.minimum),
        maximum=facts.get("maximum", register.maximum),
        default=facts.get("default", register.default),
    )
