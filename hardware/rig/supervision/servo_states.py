"""The state of each servo of a rig: goal, measurements, and condition in a word."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # the page reads this file without the control tables
    from hardware.rig.scale import Array

CONDITIONS = (
    "well",
    "was cut off",
    "has a low supply voltage",
    "is getting hot",
    "gives way",
    "pulls against itself",
    "does not follow",
    "is off on command",
    "is limp",
    "has shut down",
    "does not answer",
    "is lost",
)
"""From the best to the worst; a servo in several of them is shown in the last one."""


class ServoStates(NamedTuple):
    """The servos of J joints, in the order of the rig file.

    Attributes:
        goals: last sent, shape (J,), rad.
        positions, currents: last measured, shape (J,), rad, A.
        temperatures, voltages: last measured, shape (J,), degC, V; NaN until first read.
        errors: hardware error bits, shape (J,).
        torque: whether torque is on, shape (J,).
        conditions: places in CONDITIONS, shape (J,).
    """

    goals: Array
    positions: Array
    currents: Array
    temperatures: Array
    voltages: Array
    errors: NDArray[np.int64]
    torque: NDArray[np.bool_]
    conditions: NDArray[np.int64]
