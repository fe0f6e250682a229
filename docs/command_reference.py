"""The reference of commands, a page a noun, as Markdown made from the command line itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from motiondeck.cli.main import _PANELS, command_line


def command_reference(noun: str) -> str:
    """A section for each command of a noun, with its help text and a table of its arguments and options."""
    return "\n\n".join(_section(words, command) for words, command in nouns()[noun])


def nouns() -> dict[str, list[tuple[str, Any]]]:
    """The commands and their full names by the page of reference/ that describes them: of a group, or of a panel."""
    panels = {name: panel.lower() for panel, names in _PANELS.items() for name in names}
    pages: dict[str, list[tuple[str, Any]]] = {}
    for words, command in commands(typer.main.get_command(command_line())):
        first = words.split()[1]
        page = first if first in ("clip", "library", "rig", "robot") else panels[first].replace("export", "show")
        pages.setdefault(page, []).append((words, command))
    return pages


def commands(command: Any, words: str = "motiondeck") -> Iterator[tuple[str, Any]]:
    """Each command under a command of Click, with its full name."""
    for name, below in getattr(command, "commands", {}).items():
        if hasattr(below, "commands"):
            yield from commands(below, f"{words} {name}")
        else:
            yield f"{words} {name}", below


def _section(words: str, command: Any) -> str:
    records = [parameter.get_help_record(typer.Context(command, info_name=words)) for parameter in command.params]
    rows = [f"| `{_escaped(names)}` | {_escaped(text)} |" for names, text in records]
    table = ["| | |", "|---|---|", *rows] if rows else []
    return "\n".join([f"## `{words}`", "", _paragraphs(command.help or ""), "", *table])


def _paragraphs(text: str) -> str:
    """A help text as Markdown: indented lines are commands."""
    shown: list[str] = []
    for paragraph in text.split("\n\n"):
        lines = paragraph.splitlines()
        if lines and all(line.startswith(" ") for line in lines):
            shown.append("\n".join(["```sh", *(line.strip() for line in lines), "```"]))
        else:
            shown.append(_escaped(paragraph).replace("[bold]", "**").replace("[/]", "**"))
    return "\n\n".join(shown)


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\\[", "[")
