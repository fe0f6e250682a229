"""Tables: on a terminal, as CSV, as JSON."""

from __future__ import annotations

import csv
import io
import json
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from motiondeck_base.files import write_file
from motiondeck_base.words import printable

if TYPE_CHECKING:
    from controller.learning.evaluation.tables import Table, Value

PIPE_WIDTH = 160  # columns where standard output is no terminal


def show_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str = "",
    left: Collection[str] = (),
    notes: Iterable[str] = (),
) -> None:
    """Prints a table; the first column and those named in `left` are aligned left, others right.

    In a window too narrow for its words each row becomes a block of lines. Cells may hold rich markup such as
    [red]failed[/]; notes are printed verbatim below the table.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable

    table = RichTable(title=printable(title) or None, box=box.SIMPLE_HEAD)
    for column, heading in enumerate(headings):
        justify = "left" if not column or heading in left else "right"
        table.add_column(printable(heading), justify=justify, no_wrap=not column, overflow="fold")
    for row in (rows := list(rows)):
        table.add_row(*map(printable, row))
    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH)
    if console.measure(table, options=console.options.update(width=10_000)).minimum > console.width:
        table = RichTable(title=table.title, box=box.SIMPLE_HEAD, show_header=False)
        for row in rows:
            for name, value in zip(headings, row, strict=True):
                table.add_row(printable(name), printable(value), end_section=name == headings[-1])
    console.print(table)
    for note in notes:
        console.print(printable(note), style="dim", highlight=False, markup=False)


def show_facts(facts: Mapping[str, str]) -> None:
    """Prints names and values, one line each."""
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    grid = RichTable.grid(padding=(0, 2))
    for name, value in facts.items():
        grid.add_row(Text(printable(name), "bold"), Text(printable(value)))
    Console().print(grid)


def deliver(
    table: Table, *, csv_file: Path | None, plot: Path | None, draw: Callable[[Table, Path], None], as_json: bool
) -> None:
    """Prints measurements as a table or as JSON; writes them as CSV and draws them where a file is given.

    MotiondeckError if a file cannot be written.
    """
    if csv_file is not None:
        write_csv(table, csv_file)
    if plot is not None:
        draw(table, plot)
    if as_json:
        print(json.dumps(asdict(table)))
    else:
        print_measurements(table)


def write_csv(table: Table, path: Path) -> None:
    """Writes the details of a table, or its rows where it has none; MotiondeckError if the file cannot be written."""
    rows = table.details or table.rows
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    write_file(path, text.getvalue().encode())


def print_measurements(table: Table) -> None:
    """Prints measurements, transposed where that is narrower, with intervals behind their values."""
    from rich.markup import escape

    columns = [name for name in table.rows[0] if not name.endswith((" low", " high", " failed"))]
    lines = [columns, *([escape(_cell(row, name)) for name in columns] for row in table.rows)]
    if len(table.rows) < len(columns):
        lines = [list(line) for line in zip(*lines, strict=True)]
    show_table(lines[0], lines[1:], title=table.title, notes=table.notes)


def _cell(row: dict[str, Value], column: str) -> str:
    """A value as text: percentages (with their interval) and millimetres to one decimal, others to four digits."""
    value = row[column]
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    if column.endswith(("%", "mm")) or str(row[next(iter(row))]).endswith("%"):
        name = column.removesuffix(" %")
        low, high = row.get(f"{name} low"), row.get(f"{name} high")
        return f"{value:.1f}" + (f" ({low:.1f}-{high:.1f})" if low is not None else "")
    return f"{value:.4f}" if abs(value) < 1.0 else f"{value:.4g}"
