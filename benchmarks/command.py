"""Runs a benchmark's main function as a command with --help."""

from __future__ import annotations

from collections.abc import Callable

import typer


def run(name: str, main: Callable[..., object], about: str | None = None, *others: Callable[..., object]) -> None:
    """Reads the command line by the parameters of `main` and calls it; the help is `about` or else its docstring.

    With `others`, the first argument chooses a function by its name.
    """
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    for function in (main, *others):
        app.command(help=about)(function)
    app(prog_name=f"python -m benchmarks {name}")
