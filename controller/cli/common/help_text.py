"""Help texts: docstrings as a terminal shows them, wrapped where the terminal ends and not where our lines end."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import typer


def set_help_texts(app: typer.Typer) -> None:
    """Gives each command of an app, and of its groups, the help text of its docstring."""
    for command in app.registered_commands:
        if command.callback is not None:
            command.help = help_text(command.callback)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            set_help_texts(group.typer_instance)


def help_text(command: Callable[..., Any]) -> str:
    """A docstring with each paragraph on one line; indented lines, such as examples, stay as they are."""
    return "\n\n".join(map(_joined, inspect.cleandoc(command.__doc__ or "").split("\n\n")))


def _joined(paragraph: str) -> str:
    lines: list[str] = []
    for line in paragraph.splitlines():
        if lines and not line.startswith(" ") and not lines[-1].startswith(" "):
            lines[-1] += " " + line
        else:
            lines.append(line)
    return "\n".join(lines)
