"""Help texts: docstrings, wrapped at the width of the terminal."""

import inspect
import re
from collections.abc import Callable
from copy import copy
from typing import Any

import typer
from typer.core import TyperArgument, TyperCommand

WIDTH = 78  # columns of an 80-column terminal without its margins
FEWEST = 4  # options that have panels of their own
_ON = " \\"


class NamedCommand(TyperCommand):
    """A command whose help shows arguments by name, such as RIG, without a type, and few options in one panel."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        panels = [parameter for parameter in self.params if getattr(parameter, "rich_help_panel", None)]
        for parameter in panels if len(panels) < FEWEST else ():
            parameter.rich_help_panel = None  # type: ignore[attr-defined]
        for parameter in self.params:
            if isinstance(parameter, TyperArgument):
                parameter.type = copy(parameter.type)  # types are shared with options
                parameter.type.get_metavar = lambda param, ctx: ""


def set_help_texts(app: typer.Typer) -> None:
    """Sets the help text of each command of an app and of its groups from its docstring."""
    for command in app.registered_commands:
        if command.callback is not None:
            command.help = help_text(command.callback)
            command.cls = NamedCommand
    for group in app.registered_groups:
        if group.typer_instance is not None:
            set_help_texts(group.typer_instance)


def help_text(command: Callable[..., Any]) -> str:
    """A docstring with each paragraph on one line; long commands are continued, so that they can be pasted."""
    return "\n\n".join(map(_joined, inspect.cleandoc(command.__doc__ or "").split("\n\n")))


def _joined(paragraph: str) -> str:
    lines: list[str] = []
    for line in paragraph.splitlines():
        if lines and not line.startswith(" ") and not lines[-1].startswith(" "):
            lines[-1] += " " + line
        else:
            lines.extend(_continued(line) if line.startswith(" ") else [line])
    return "\n".join(lines)


def _continued(command: str) -> list[str]:
    """The lines of a command, split before options and NAME=VALUE; all but the last end in a backslash."""
    lines = [""]
    for part in re.split(r"(?= --)|(?= [^ ]+=)", command):
        if not lines[-1] or len(lines[-1] + part) <= WIDTH - len(_ON):
            lines[-1] += part
        else:
            lines[-1] += _ON
            lines.append(4 * " " + command[: len(command) - len(command.lstrip())] + part.lstrip())
    return lines
