"""A record of where the shafts of emulated servos really are, which no reply on the bus tells exactly.

a line of JSON: {"joints": names}
rows of float64, little endian: CLOCK_MONOTONIC (s), time of the servos (s), shaft of each joint (rad)
"""

import json
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig


class ShaftRecord:
    """Writes a row whenever it is called; nothing is buffered, so that a killed emulator leaves all of them."""

    def __init__(self, path: Path, config: RigConfig) -> None:
        """Creates the file; raises RigError if it cannot be written."""
        joints = [joint for part in config.parts for joint in part.servos.joints]
        self._zero = np.array([joint.zero for joint in joints], dtype=np.float64)
        self._per_radian = np.array([joint.pulses_per_radian for joint in joints])
        self._row = np.empty(2 + len(joints))
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise RigError(f"cannot write the record {path}: {error.strerror}.") from error
        self._file.write(json.dumps({"joints": [joint.name for joint in joints]}).encode() + b"\n")

    def __call__(self, buses: Sequence[EmulatedBus]) -> None:
        """Writes where the shafts of the buses, in the order of the rig's ports, are now."""
        shafts = [device.bank.shaft[device.row] for bus in buses for device in bus.devices]
        self._row[0], self._row[1] = time.monotonic(), buses[0].time
        self._row[2:] = (np.array(shafts) - self._zero) / self._per_radian
        self._file.write(self._row.tobytes())
