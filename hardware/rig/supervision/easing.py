"""Easing: the part of its speed limit that a joint may use while it is hot, or while its supply has fallen.

Heat: full speed up to 12 degC below the servo's limit, a quarter from 2 degC below it on.

Supply: speed and loop gain of a servo are proportional to its voltage. At V of its V0, a shaft that turns as fast as
before is V0 / V times as far behind its path, and when the voltage is back it hurries after it that much too fast. At
V / V0 of the speed it is no farther behind than before.
"""

from __future__ import annotations

import numpy as np

from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.supervision.health import EASED_FROM

_EASED_TO = 2.0  # degC below the servo's limit
_LEAST = 0.25
_SAGS_FROM = 0.9  # of the highest voltage seen, because every load takes some


class Easing:
    """The easing of a rig's J joints.

    Attributes:
        part: of its speed limit that each joint may use now, shape (J,).
    """

    def __init__(self, config: RigConfig) -> None:
        self.part = np.ones(len(config.joints))
        self._hottest = np.array([joint.hottest for joint in config.joints])
        self._strongest = np.full(len(config.joints), np.nan)

    def note(self, temperatures: Array, voltages: Array) -> None:
        """Takes in the temperatures, degC, and supply voltages, V, both (J,) and NaN where not measured yet."""
        self._strongest = np.fmax(self._strongest, voltages)
        heat = (self._hottest - temperatures - _EASED_TO) / (EASED_FROM - _EASED_TO)
        supply = voltages / (_SAGS_FROM * self._strongest)
        self.part = np.maximum(np.fmin(np.fmin(heat, supply), 1.0), _LEAST)
