"""Where our control tables differ from the pages of the maker's manual.

FOLDER is a copy of https://github.com/ROBOTIS-GIT/emanual, or any folder with its pages in Markdown. Defaults and
ranges are compared register by register, by address; a page without a column of ranges by its defaults alone. The exit
code is 1 if anything differs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from benchmarks import command
from hardware.families.models import MODELS

# Ours include values that a page leaves out: no second ID, a tripped watchdog, bits of newer firmware.
_WIDER = {"secondary_id", "bus_watchdog", "startup_configuration", "operating_mode", "drive_mode"}
_NUMBER = re.compile(r"-?\d[\d,]*")


class PageRow(NamedTuple):
    """A register as a page lists it; None where the page has no number."""

    address: int
    default: int | None
    range: tuple[int, int] | None


class Difference(NamedTuple):
    """A figure of ours that a page has otherwise."""

    model: str
    register: str
    what: str
    ours: object
    pages: object

    def __str__(self) -> str:
        return f"{self.model:16} {self.register:22} {self.what:8} {self.ours!s:20} page: {self.pages}"


def model_of(page: Path) -> str | None:
    """The model that a page is about, by its file name; None for another page."""
    name = page.stem.upper()
    old = name in ("MX-28", "MX-64", "MX-106")
    names = (
        f"{name}(1.0)" if old else name,
        name.removesuffix("-2"),
        name.removesuffix("-R"),
        name.replace("XL", "XL-"),
    )
    return next((each for each in names if each in MODELS), None)


def read_page(text: str) -> Iterator[PageRow]:
    """The rows of a page's control tables; each table names its columns."""
    columns: list[str] = []
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if cells[0] == "Address":
            columns = [re.sub(r"<br ?/?>", " ", cell) for cell in cells]
        elif columns and cells[0].isdigit() and len(cells) == len(columns):
            row = dict(zip(columns, cells, strict=True))
            default = row.get("Initial Value", row.get("Default Value", "-"))
            ends = [int(end.replace(",", "")) for end in _NUMBER.findall(row.get("Range", ""))]
            plain = len(ends) == 2 and "(" not in row["Range"]
            value = int(default.replace(",", "")) if _NUMBER.fullmatch(default) else None
            yield PageRow(int(cells[0]), value, (ends[0], ends[1]) if plain else None)


def compare(model: str, text: str) -> Iterator[Difference]:
    """Where our table of a model differs from its page."""
    ours = {register.address: register for register in MODELS[model].registers.values()}
    for row in read_page(text):
        register = ours.get(row.address)
        if register is None:
            yield Difference(model, f"at {row.address}", "register", "none", row.default)
            continue
        if row.default is not None and register.default != row.default:
            yield Difference(model, register.name, "default", register.default, row.default)
        limits = (register.minimum, register.maximum)
        if row.range is not None and limits != row.range and register.name not in _WIDER:
            yield Difference(model, register.name, "range", limits, row.range)


def main(folder: Annotated[Path, typer.Argument(help="With the maker's pages; searched with its subfolders.")]) -> int:
    pages = [(page, model) for page in sorted(folder.rglob("*.md")) if (model := model_of(page)) is not None]
    found = [difference for page, model in pages for difference in compare(model, page.read_text(encoding="utf-8"))]
    print(*found, f"{len(pages)} pages, {len(found)} differences", sep="\n")
    raise typer.Exit(1 if found or not pages else 0)


if __name__ == "__main__":
    command.run("makers_tables", main, __doc__)
