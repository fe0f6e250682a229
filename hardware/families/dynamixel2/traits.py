"""The series and models of Protocol 2.0: X, MX with its newer firmware, XL-320, P and PRO(A)."""

from dataclasses import replace
from types import MappingProxyType

from hardware.families.dynamixel2.family import FAMILY
from hardware.families.rows import file_beside
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

TRAITS = parse_traits(file_beside(__file__, "models.txt"), {series.name: series for series in _SERIES})  # by model name
