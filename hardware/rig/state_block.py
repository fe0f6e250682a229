"""The block of bytes that a rig reads from one servo each tick.

arranged   the servo's indirect cells show force, velocity, position, and all that health needs, side by side
motion     force, velocity and position where they stand, for a servo whose cells cannot be arranged
everything from torque to temperature where they stand; read of such a servo at intervals

Servos without indirect cells have so few registers that they are always asked for everything.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.errors import RefusedError
from hardware.families.register import Register
from hardware.families.table import ControlTable
from hardware.rig.registers import read_each, read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import Array, force_of

FIELDS = ("force", "present_velocity", "present_position", "hardware_error_status", "present_temperature",
          "torque_enable", "present_input_voltage", "torque_limit")  # fmt: skip
"""Of a block with health, as far as a model has them; the first three alone without.

`force` is current, or load without it. In some families every reply has the error. Torque limit 0 is no torque.
"""

_ALIKE = {"hardware_error_status": 0, "torque_enable": 0, "present_temperature": 3, "present_input_voltage": 10}
"""By how many counts two looks at a healthy servo may differ, a few ms apart."""


@dataclass(frozen=True, slots=True)
class StateBlock:
    """A block of registers."""

    address: int  # of the first byte that is read
    length: int  # bytes
    layout: np.dtype[Any]  # of the bytes read, with the names in FIELDS
    healthy: bool  # whether health is in it


@dataclass(frozen=True, slots=True)
class Arrangement:
    """An arranged block, and the pointers to write at the address of the first indirect address."""

    block: StateBlock
    address: int
    pointers: bytes


def arranged(table: ControlTable, firmware: int) -> Arrangement | None:
    """The indirect cells of a servo with this firmware as one block; None for a model without enough of them."""
    rows = _rows(table)
    size = sum(row.length for row in rows)
    if f"indirect_data_{size}" not in table.registers:
        return None
    since, earlier = table.series.cells_moved or (0, 0)
    cells = table["indirect_data_1"].address - (earlier if firmware >= since else 0)
    places = [place for row in rows for place in range(row.address, row.address + row.length)]
    starts = np.cumsum([0, *(row.length for row in rows)])[:-1].tolist()
    pointers = b"".join(place.to_bytes(2, "little") for place in places)
    return Arrangement(_block(cells, size, rows, starts, _fields(table)), table["indirect_address_1"].address, pointers)


def motion(table: ControlTable) -> StateBlock:
    """Force, velocity and position where they stand; everything of a servo with few registers."""
    has_cells = "indirect_data_1" in table.registers
    return _in_place(_rows(table)[:3], FIELDS[:3]) if has_cells else everything(table)


def everything(table: ControlTable) -> StateBlock:
    """All that is watched, from torque to temperature, where it stands."""
    return _in_place(_rows(table), _fields(table))


def _fields(table: ControlTable) -> tuple[str, ...]:
    return tuple(name for name in FIELDS if name == "force" or name in table.registers)


def _rows(table: ControlTable) -> list[Register]:
    return [table[force_of(table) if name == "force" else name] for name in _fields(table)]


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
    """The layout of a row of a `WholeReply` whose data have this layout; its error byte is the field `error`."""
    # A loop should keep it, and an array that has it: to make either takes longer than to read the rows.
    fields = {"error": (np.dtype(np.uint8), error)}
    fields |= {name: (field[0], data + field[1]) for name, field in (layout.fields or {}).items()}
    formats, offsets = zip(*fields.values(), strict=True)
    return np.dtype({"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": stride})


def arrange_state(config: RigConfig, bus: Bus) -> list[StateBlock]:
    """The block to read of each joint in the loop: its arranged cells, or its registers in place."""
    return [_arrange(joint, bus) for joint in config.joints]


def _arrange(joint: RigJoint, bus: Bus) -> StateBlock:
    in_place = motion(joint.table)
    plan = arranged(joint.table, read_register(joint, bus, "firmware_version"))
    if plan is None:
        return in_place
    try:
        # Some models keep these pointers in EEPROM, whose cells wear out.
        if bus.read(joint.id, plan.address, len(plan.pointers)).params != plan.pointers:
            bus.write(joint.id, plan.address, plan.pointers)
        shown = _look(joint, bus, plan.block)
    except RefusedError:
        return in_place
    beside = _look(joint, bus, everything(joint.table))
    alike = all(abs(int(shown[name]) - int(beside[name])) <= counts for name, counts in _ALIKE.items())
    return plan.block if alike and int(shown["present_input_voltage"]) else in_place


def _look(joint: RigJoint, bus: Bus, block: StateBlock) -> np.void:
    return np.frombuffer(bus.read(joint.id, block.address, block.length).params, dtype=block.layout)[0]


class OwnSettings(NamedTuple):
    """What J servos keep themselves and a rig file does not ask for: read when switched on, and never written."""

    hottest: Array  # the temperature at which each shuts down, shape (J,), degC
    slack: Array  # how far from its goal each drives with its full voltage, shape (J,), rad
    shutdown: NDArray[np.int64]  # the error bits for which each shuts down, shape (J,)


def read_own_settings(config: RigConfig, bus: Bus) -> OwnSettings:
    """Reads temperature limit, position gain and shutdown bits of every servo; a ServoError if one does not answer."""
    gain, limits = "position_p_gain", np.array(read_each(config, bus, "temperature_limit"), dtype=np.float64)
    slack = [one.slack(read_register(one, bus, gain) if gain in one.table.registers else None) for one in config.joints]
    shutdown = [one.table.series.usual_problems(read_register(one, bus, "shutdown")) for one in config.joints]
    return OwnSettings(limits, np.array(slack), np.array(shutdown))
