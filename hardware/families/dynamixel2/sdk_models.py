"""The maker's own `.model` files, read from the installed dynamixel-sdk: addresses and lengths, by register name."""

import re
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from hardware.errors import MotiondeckError

_PACKAGE = "dynamixel_easy_sdk"
_SAME_PLACES = {"XM335-T323": "XC330-T288"}  # a model that the maker's files lack, and one with the same registers


class Row(NamedTuple):
    """One register as the maker's file lists it."""

    address: int
    length: int
    name: str


class ModelFile(NamedTuple):
    """One `.model` file."""

    pulses_per_turn: int  # position counts in one turn
    rad_per_s: float  # one count of velocity; 0 where the file lacks it
    rows: tuple[Row, ...]  # in order of address, without the file's second names for a place


def model_numbers(folder: Path | None = None) -> dict[str, int]:
    """The number of every model that the installed SDK has a table for, by model name."""
    rows = (line.split() for line in _read("dynamixel.model", folder).splitlines())
    files = [(row[1].removesuffix(".model"), int(row[0])) for row in rows if len(row) == 2 and row[0].isdigit()]
    return {"XL-320" if stem == "xl320" else stem.upper().replace("_", "-"): number for stem, number in files}


def model_file(model: str, folder: Path | None = None) -> ModelFile:
    """The maker's table of a model; raises MotiondeckError if there is none of the known form."""
    model = _SAME_PLACES.get(model, model)
    name = f"{'xl320' if model == 'XL-320' else model.lower().replace('-', '_')}.model"
    try:
        sections = dict(_sections(_read(name, folder)))
        kind = {row[0]: float(row[1]) for row in sections["type info"]}
        units = {row[0]: float(row[1]) for row in sections.get("unit info", [])}
        rows = [Row(int(address), int(length), _snake(label)) for address, length, label in sections["control table"]]
        rows = {row.address: row for row in reversed(rows)}  # some tables name a place twice
        turn = kind["max_radian"] - kind["min_radian"]
        counts = kind["value_of_max_radian_position"] - kind["value_of_min_radian_position"]
    except (KeyError, ValueError) as error:
        raise MotiondeckError(f"{name} of dynamixel-sdk is not of the form that is known ({error}).") from error
    # The two ends of one turn are neighbours, so 0 to 4095 is a turn of 4096.
    pulses = round((counts + counts % 2) * 2.0 * 3.14159265 / turn)
    return ModelFile(pulses, units.get("present_velocity", 0.0), tuple(sorted(rows.values())))


def _sections(text: str) -> Iterator[tuple[str, list[list[str]]]]:
    """Each [section] of a file and its rows, the column names left out, the first names in snake case."""
    for part in re.split(r"^\[", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("]")
        rows = [line.strip().split("\t") for line in body.strip().splitlines()[1:] if line.strip()]
        yield title, [[_snake(row[0]), *row[1:]] for row in rows]


def _read(name: str, folder: Path | None) -> str:
    if folder is None:
        spec = find_spec(_PACKAGE)
        if spec is None or spec.origin is None:
            raise MotiondeckError("dynamixel-sdk without control tables: install dynamixel-sdk 4.1 or newer.")
        folder = Path(spec.origin).parent / "control_table"
    try:
        return (folder / name).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise MotiondeckError(f"{name} of dynamixel-sdk cannot be read: {error.strerror}.") from error


def _snake(label: str) -> str:
    """A register's name as we write it: Secondary(Shadow) ID is secondary_id."""
    return re.sub(r"[^a-z0-9]+", "_", re.sub(r"\(.*?\)", "", label).strip().lower())
