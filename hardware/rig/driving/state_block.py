"""What a rig reads from one servo each tick, as one block of bytes.

arranged   the servo's indirect cells show force, velocity, position, and all that health needs, side by side
motion     force, velocity and position where they stand, for a servo whose cells cannot be arranged
everything from torque to temperature where they stand; such a servo is asked for it now and then

The AX, RX, MX (Protocol 1.0) and XL-320 servos have so few registers that they are always asked for everything.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from hardware.control_table.old_models import OLD_MODELS
from hardware.control_table.register import Register
from hardware.control_table.table import USUAL_BITS, ControlTable

FIELDS = ("force", "present_velocity", "present_position", "hardware_error_status", "present_temperature",
          "torque_enable", "present_input_voltage")  # fmt: skip
"""Of a block with health; the first three alone without. `force` is current, or load where no current is measured."""
OLD_FIELDS = (*FIELDS[:3], *FIELDS[4:], "torque_limit")
"""Of a servo of Protocol 1.0, whose every answer tells its error, and which lets go by a torque limit of 0."""
XL320_FIELDS = (*OLD_FIELDS, "own_error_status")
"""Of an XL-320, which has error bits of its own."""

# The firmware from which these have their indirect data cells 16 bytes earlier; the model number does not tell.
_MOVED_CELLS, _MOVED_SINCE, _MOVED_BY = ("XL330", "XC330"), 52, 16


@dataclass(frozen=True, slots=True)
class StateBlock:
    """A block of registers.

    Attributes:
        address, length: what to read.
        layout: of the bytes read, with the names in FIELDS.
        healthy: whether health is in it.
    """

    address: int
    length: int
    layout: np.dtype[Any]
    healthy: bool


@dataclass(frozen=True, slots=True)
class Arrangement:
    """An arranged block and how to arrange it.

    Attributes:
        block: what to read afterwards.
        address: of the first indirect address.
        pointers: what to write there.
    """

    block: StateBlock
    address: int
    pointers: bytes


def arranged(table: ControlTable, firmware: int) -> Arrangement | None:
    """The indirect cells of a servo with this firmware as one block; None for a model without enough of them."""
    rows = _rows(table)
    size = sum(row.length for row in rows)
    if f"indirect_data_{size}" not in table.registers:
        return None
    moved = table.model.startswith(_MOVED_CELLS) and firmware >= _MOVED_SINCE
    cells = table["indirect_data_1"].address - (_MOVED_BY if moved else 0)
    places = [place for row in rows for place in range(row.address, row.address + row.length)]
    offsets = np.cumsum([0, *(row.length for row in rows)])[:-1].tolist()
    pointers = b"".join(place.to_bytes(2, "little") for place in places)
    return Arrangement(_block(cells, size, rows, offsets, FIELDS), table["indirect_address_1"].address, pointers)


def motion(table: ControlTable) -> StateBlock:
    """Force, velocity and position where they stand; everything of a servo with few registers."""
    return everything(table) if table.model in OLD_MODELS else _in_place(_rows(table)[:3], FIELDS[:3])


def everything(table: ControlTable) -> StateBlock:
    """All that is watched, from torque to temperature, where it stands."""
    return _in_place(_rows(table), _fields(table))


def _fields(table: ControlTable) -> tuple[str, ...]:
    """What a block with the health of this model has."""
    if table.protocol == 1:
        return OLD_FIELDS
    return FIELDS if table.problem_bits == USUAL_BITS else XL320_FIELDS


def _rows(table: ControlTable) -> list[Register]:
    """The registers of these fields."""
    force = "present_current" if "present_current" in table.registers else "present_load"
    names = {"force": force, "own_error_status": "hardware_error_status"}
    return [table[names.get(name, name)] for name in _fields(table)]


def _in_place(rows: list[Register], names: tuple[str, ...]) -> StateBlock:
    start = min(row.address for row in rows)
    end = max(row.address + row.length for row in rows)
    return _block(start, end - start, rows, [row.address - start for row in rows], names)


def _block(address: int, length: int, rows: list[Register], offsets: list[int], names: tuple[str, ...]) -> StateBlock:
    formats = tuple(f"<{'i' if row.signed else 'u'}{row.length}" for row in rows)
    return StateBlock(address, length, _layout(names, formats, tuple(offsets), length), "torque_enable" in names)


@lru_cache(maxsize=64)
def _layout(names: tuple[str, ...], formats: tuple[str, ...], offsets: tuple[int, ...], size: int) -> np.dtype[Any]:
    return np.dtype({"names": list(names), "formats": list(formats), "offsets": list(offsets), "itemsize": size})


def row_layout(layout: np.dtype[Any], stride: int, error: int, data: int) -> np.dtype[Any]:
    """The layout of a row of a `WholeReply` whose data have this layout; its error byte is the field `error`.

    A loop should keep it, and an array that has it: to make either takes longer than to read the rows.
    """
    fields = {"error": (np.dtype(np.uint8), error)}
    fields |= {name: (field[0], data + field[1]) for name, field in (layout.fields or {}).items()}
    formats, offsets = zip(*fields.values(), strict=True)
    return np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": stride})
