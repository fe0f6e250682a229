"""The Dynamixel servos of Protocol 2.0 as a family: X, MX with its newer firmware, XL-320, P and PRO(A)."""

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel2 import frames
from hardware.families.dynamixel2.group_reply import group_read, status_length
from hardware.families.facts import file_beside, parse_traits
from hardware.families.family import Family, Identification
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE, Series

FAMILY = Family(
    name="dynamixel2",
    spoken="",
    instructions=frames.INSTRUCTIONS,
    parser=frames.Parser,
    as_status=frames.as_status,
    status_length=status_length,
    trailer=frames.trailer,
    identification=Identification(number=0, firmware=2, length=3, by_ping=True),
    group_read=group_read,
    lines=lambda blocks: (blocks,),
    dialect="2.0",
    reboot=frames.reboot,
    stuffed=frames.STUFFED_PATTERN,
    fast_reads=True,
    choice=("protocol_type", 2),
)

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

TRAITS = parse_traits(file_beside(__file__, "models.txt"), {series.name: series for series in _SERIES})  # by model name
