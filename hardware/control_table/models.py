"""The servo models whose control tables are known: the maker's addresses, and what the maker's files lack.

The `.model` files of the installed dynamixel-sdk give address and length of each register. Sign, access, memory, range,
default and unit come from the XM430-W350's manual, whose register names the others share, with the figures of
`x_series` for each model. The tables of `ax_rx_mx` and `p_series` are complete. For the Y series and the
RH-P12-RN the range is what the bytes can hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache

from hardware.control_table.ax_rx_mx import AX_RX_MX
from hardware.control_table.family import X
from hardware.control_table.other_devices import OTHER_DEVICES
from hardware.control_table.p_series import P_SERIES
from hardware.control_table.register import Register
from hardware.control_table.sdk_models import Row, model_file, model_numbers
from hardware.control_table.servo_traits import TRAITS
from hardware.control_table.table import ControlTable
from hardware.control_table.x_series import as_in_manual
from hardware.control_table.xm430_w350 import XM430_W350
from motiondeck_base.near_names import near_names

_COMMON = XM430_W350.registers
_READ_ONLY = (
    *("present_", "model_", "firmware_", "moving", "realtime_", "registered_", "hardware_", "error_code", "backup_"),
    *("position_trajectory", "velocity_trajectory", "controller_state"),
)
_RAD_PER_S = 2.0 * math.pi / 60.0


class Models(Mapping[str, ControlTable]):
    """Control tables by model name; a table is made when it is first asked for."""

    def __getitem__(self, model: str) -> ControlTable:
        if model not in _numbers():
            raise KeyError(model)
        return _table(model)

    def __iter__(self) -> Iterator[str]:
        return iter(_numbers())

    def __len__(self) -> int:
        return len(_numbers())

    def near(self, model: str) -> list[str]:
        """The names most like this one."""
        return near_names(model, self)


MODELS = Models()


def model_name(number: int) -> str:
    """The name of the model with this number, or the number where it is not known."""
    known = _names().get(number) or OTHER_DEVICES.get(number, (None,))[0]
    return known or f"model number {number}"


@cache
def _numbers() -> dict[str, int]:
    own = {model: traits.figures[0] for model, traits in TRAITS.items() if traits.figures}
    return {XM430_W350.model: XM430_W350.number} | model_numbers() | own


@cache
def _names() -> dict[int, str]:
    return {number: model for model, number in _numbers().items()}


@cache
def _table(model: str) -> ControlTable:
    if model == XM430_W350.model:
        return XM430_W350
    if (own := AX_RX_MX.get(model) or P_SERIES.get(model)) is not None:
        return own
    file = model_file(model)
    traits = TRAITS.get(model)
    rows = list(_with_cells(file.rows, traits is not None))
    torque = next((row.address for row in rows if row.name == "torque_enable"), 0)
    make = _register_like_xm430 if traits is not None else _plain_register
    registers = {row.name: make(row, torque, file.rad_per_s) for row in rows}
    if traits is not None:
        registers = {name: as_in_manual(model, register) for name, register in registers.items()}
    registers["model_number"] = replace(registers["model_number"], default=_numbers()[model])
    family = traits.family if traits is not None else X
    return ControlTable(model, _numbers()[model], file.pulses_per_turn, registers, family)


def _with_cells(rows: tuple[Row, ...], whole: bool) -> Iterator[Row]:
    """The rows, with those indirect cells that the file leaves to its reader, and the XM430's newer registers."""
    have = {row.name: row for row in rows}
    first, data = have.get("indirect_address_1"), have.get("indirect_data_1")
    cells: list[Row] = []
    if first and data:
        count = min(28, (data.address - first.address) // 2)
        cells = [Row(first.address + 2 * cell, 2, f"indirect_address_{cell + 1}") for cell in range(count)]
        cells += [Row(data.address + cell, 1, f"indirect_data_{cell + 1}") for cell in range(count)]
    taken = {place for row in rows for place in range(row.address, row.address + row.length)}
    newer = [
        Row(register.address, register.length, name)
        for name in ("startup_configuration", "backup_ready")
        if whole and (register := _COMMON[name]).address not in taken
    ]
    plain = [row for row in rows if not (row.name.startswith("indirect_") and (cells or row.name[-1] in "de"))]
    yield from sorted((*plain, *cells, *newer), key=lambda row: row.address)


def _register_like_xm430(row: Row, torque: int, rad_per_s: float) -> Register:
    """A register whose name the XM430 has too; its own words, at this model's place."""
    like = _COMMON.get(row.name)
    if like is None or like.length != row.length:
        return _plain_register(row, torque, rad_per_s)
    if row.name.startswith("indirect_address_"):
        cell = int(row.name.rpartition("_")[2]) - 1
        return replace(like, address=row.address, default=None if cell < 0 else like.default)
    scale = _rpm(rad_per_s) if like.unit == "rpm" and rad_per_s else like.scale
    return replace(like, address=row.address, scale=scale)


def _plain_register(row: Row, torque: int, rad_per_s: float) -> Register:
    like = _COMMON.get(row.name)
    signed = (
        (like.signed and like.length == row.length)
        if like is not None
        else row.name == "present_load" or row.name.endswith("_offset")
    )
    # The Y series counts positions from -half a turn to +half a turn.
    signed = signed or (row.name.endswith("position_limit") and row.length == 4)
    bits = 8 * row.length
    unit, scale = ("", 1.0) if like is None else (like.unit, like.scale)
    if unit == "rpm":
        scale = _rpm(rad_per_s) if rad_per_s else scale
    return Register(
        name=row.name,
        address=row.address,
        length=row.length,
        signed=signed,
        access="R" if row.name.startswith(_READ_ONLY) and row.name != "moving_threshold" else "RW",
        memory="EEPROM" if row.address < torque else "RAM",
        minimum=-(1 << bits - 1) if signed else 0,
        maximum=(1 << bits - (1 if signed else 0)) - 1,
        default=None,
        unit=unit,
        scale=scale,
    )


def _rpm(rad_per_s: float) -> float:
    """The unit of velocity in rev/min, which the maker's files give rounded in rad/s."""
    return round(rad_per_s / _RAD_PER_S, 3)
