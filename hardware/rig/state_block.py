"""What a rig reads from its servos each tick, as one block of bytes.

Where all servos have indirect addressing, their cells are told to show current, velocity and position, and with them
what health needs: hardware error, temperature, torque. Else the block is what stands side by side anyway, and health is
not read in the loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hardware.control_table.table import ControlTable

_FORCE = ("present_current", "present_load")
_PACKED = ("present_velocity", "present_position", "hardware_error_status", "present_temperature", "torque_enable")
# Their cells moved with a firmware, and a table cannot know which one a servo has.
_MOVING_CELLS = ("XL330", "XC330")


class StateBlock:
    """The block for servos of these tables.

    Attributes:
        address, length: what to read.
        pointers: what to write to `pointer_address` first; empty where nothing is packed.
        pointer_address: of the first indirect address.
        layout: of the bytes read; the field `force` is current or load.
    """

    def __init__(self, tables: Sequence[ControlTable]) -> None:
        first = tables[0]
        force = next(name for name in _FORCE if name in first.registers)
        names = (force, *_PACKED)
        rows = [first[name] for name in names if name in first.registers]
        size = sum(row.length for row in rows)
        packed = len(rows) == len(names) and all(
            f"indirect_data_{size}" in table.registers and not table.model.startswith(_MOVING_CELLS) for table in tables
        )
        if packed:
            self.address, self.length = first["indirect_data_1"].address, size
            self.pointer_address = first["indirect_address_1"].address
            places = [place for row in rows for place in range(row.address, row.address + row.length)]
            self.pointers = b"".join(place.to_bytes(2, "little") for place in places)
            offsets = np.cumsum([0, *(row.length for row in rows)])[:-1].tolist()
        else:
            rows = rows[:3]
            self.address, self.length = first.block(force, "present_position")
            self.pointer_address, self.pointers = 0, b""
            offsets = [row.address - self.address for row in rows]
        self.layout: np.dtype[Any] = np.dtype(
            {
                "names": ["force", *(row.name for row in rows[1:])],
                "formats": [f"<{'i' if row.signed else 'u'}{row.length}" for row in rows],
                "offsets": offsets,
                "itemsize": self.length,
            }
        )
