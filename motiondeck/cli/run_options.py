"""Gives a command the options of a run: `play` all of them, `replay` some."""

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Annotated, Any

import typer

from motiondeck.cli.common.options import with_groups
from motiondeck.run.spec.run_spec import Option, RunSpec, kinds, options


def with_run_options(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replaces a command's parameter `spec` by these options of a run, or by all of them."""
    rows, types = options(), kinds()
    chosen = {field.name: field.default for field in fields(RunSpec) if field.name in names or not names}

    def spec_of(**spec: Any) -> RunSpec:
        spec |= {name: not value for name, value in spec.items() if rows[name].off}
        spec |= {name: tuple(value) for name, value in spec.items() if isinstance(value, list)}
        return RunSpec(**spec)

    parameters = [_parameter(name, rows[name], types[name], default) for name, default in chosen.items()]
    return partial(with_groups, groups={"spec": (parameters, spec_of)})


def _parameter(name: str, option: Option, kind: Any, default: Any) -> inspect.Parameter:
    if option.typed is not None:
        kind, default = type(option.typed), option.typed
    elif option.off:
        default = not default
    elif kind == str | int | None:
        kind = str | None
    elif kind == tuple[str, ...]:
        kind, default = list[str], []
    panel = option.panel or None
    flag = f"--{name.replace('_', '-')}" if option.flag is None else option.flag
    if flag:
        info = typer.Option(flag, metavar=option.metavar, help=option.help, rich_help_panel=panel)
    else:
        info = typer.Argument(metavar=option.metavar, help=option.help)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info])
