"""The state of each servo of a rig: goal, measurements, and condition in a word."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # the page reads this file without the control tables
    from hardware.rig.scale import Array

CONDITIONS = (
    "well", "was cut off", "has a low supply voltage", "is getting hot", "gives way", "pulls against itself",
    "does not follow", "is off on command", "is limp", "has shut down", "does not answer", "is lost",
)  # fmt: skip
"""From the best to the worst; a servo in several of them is shown in the last one."""


class ServoStates(NamedTuple):
    """The servos of J joints, in the order of the rig file."""

    goals: Array  # last sent, shape (J,), rad
    positions: Array  # last measured, shape (J,), rad
    currents: Array  # last measured, shape (J,), A
    temperatures: Array  # last measured, shape (J,), degC; NaN until first read
    voltages: Array  # last measured, shape (J,), V; NaN until first read
    errors: NDArray[np.int64]  # hardware error bits, shape (J,)
    torque: NDArray[np.bool_]  # whether torque is on, shape (J,)
    conditions: NDArray[np.int64]  # places in CONDITIONS, shape (J,)
