"""Runs a benchmark's main function as a command with --help."""

from __future__ import annotations

from collections.abc import Callable

import typer


def run(name: str, main: Callable[..., object], about: str | None = None) -> None:
    """Reads the command line by the parameters of `main` and calls it; the help is `about` or else its docstring."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(help=about)(main)
    app(prog_name=f"python -m benchmarks {name}")
