"""Gives a command the options of a run: `play` all of them, `replay` some."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any

import typer

from motiondeck.run.spec.run_spec import Option, RunSpec, kinds, options


def with_run_options(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replaces a command's parameter `spec` by these options of a run, or by all of them."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True).parameters
        rows, types = options(), kinds()
        chosen = {field.name: field.default for field in fields(RunSpec) if field.name in names or not names}
        parameters: list[inspect.Parameter] = []
        for parameter in own.values():
            if parameter.name != "spec":
                parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
                continue
            parameters += [_parameter(name, rows[name], types[name], default) for name, default in chosen.items()]

        @functools.wraps(command)
        def called(**values: Any) -> None:
            spec = {name: values.pop(name) for name in chosen if name in values}
            spec |= {name: not value for name, value in spec.items() if rows[name].off}
            spec |= {name: tuple(value) for name, value in spec.items() if isinstance(value, list)}
            command(**values, spec=RunSpec(**spec))

        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return called

    return decorate


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
