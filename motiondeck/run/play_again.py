"""Starting `motiondeck play` again with another library: the same command line, in place of the process that ended."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, NoReturn

import typer

from controller.library.motion_library import load_library
from motiondeck_base.errors import MotiondeckError

_LEFT_OUT = ("motion", "library", "script", "page", "command_port")


def play_again(
    context: typer.Context, library: str, motion: str, *, page_port: int | None, command_port: int
) -> NoReturn:
    """Replaces this process by one that plays another library on the same ports; if it cannot, this one goes on."""
    chosen: list[str] = ["--library", library, motion]
    try:
        if motion not in load_library(Path(library)).network.motions:
            raise MotiondeckError(f"{library} has no motion '{motion}'")
    except MotiondeckError as error:
        print(f"motiondeck: {error} The library before is played.", file=sys.stderr)
        chosen = ["--library", str(context.params["library"])]
    ports = ["--command-port", str(command_port)]
    if page_port is not None:
        ports += ["--port", str(page_port)]
    sys.stdout.flush()
    words = [*chosen, *_typed_options(context), *ports]
    os.execv(sys.executable, [sys.executable, "-P", "-m", "motiondeck", "play", *words])


def _typed_options(context: typer.Context) -> list[str]:
    words: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in _LEFT_OUT or source is None or source.name != "COMMANDLINE":
            continue
        value: Any = context.params[name]
        for one in value if isinstance(value, list | tuple) else [value]:
            words.append(parameter.opts[0])
            if one is not True:
                words.append(str(getattr(one, "value", one)))
    return words
