"""Runs a benchmark's main function as a command with --help."""

from __future__ import annotations

from collections.abc import Callable

import typer


def run(name: str, main: Callable[..., object]) -> None:
    """Reads the command line by the parameters of `main`, whose docstring is the help, and calls it."""
    app = typer.Typer(add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
    app.command()(main)
    app(prog_name=f"python -m benchmarks {name}")
