"""Writes the table of formats into clips.md from the readers' rows and formats.toml: `python docs/formats_table.py`."""

from __future__ import annotations

import tomllib
from pathlib import Path

from controller.motion.formats.reading import FORMATS

PAGE = Path(__file__).with_name("clips.md")
HEAD = "| file | what it is | read | not read |\n|---|---|---|---|\n"


def formats_table() -> str:
    """The formats as Markdown, a line each."""
    table, words = HEAD, tomllib.loads(PAGE.with_name("formats.toml").read_text(encoding="utf-8"))
    for row in dict.fromkeys(row for suffix in sorted(FORMATS) for row in FORMATS[suffix]):
        suffixes = ", ".join(f"`{suffix}`" for suffix in row.suffixes)
        of = words[row.read.__module__.rpartition(".")[2]]
        table += f"| {suffixes} | {of['name']} | {of['supported']} | {of.get('unsupported', '')} |\n"
    return table


def with_table(page: str) -> str:
    """A page whose table of formats is up to date."""
    before, _, rest = page.partition(HEAD)
    lines = rest.splitlines(keepends=True)
    after = next(index for index, line in enumerate(lines) if not line.startswith("|"))
    return before + formats_table() + "".join(lines[after:])


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
