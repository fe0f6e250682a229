"""A command whose options are the fields of a dataclass, so that it can hand them on as one value."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any, TypeVar, get_type_hints

import typer

T = TypeVar("T")


def takes(options: type[T]) -> Callable[[Callable[[typer.Context, T], None]], Callable[..., None]]:
    """Gives a command a parameter for each field of a dataclass, annotated as typer annotates parameters."""

    def decorate(command: Callable[[typer.Context, T], None]) -> Callable[..., None]:
        @functools.wraps(command)
        def called(context: typer.Context, *given: Any, **named: Any) -> None:
            command(context, options(*given, **named))

        kinds = get_type_hints(options, include_extras=True)
        signature = [inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)]
        for field in fields(options):  # type: ignore[arg-type]
            default = inspect.Parameter.empty if field.default is MISSING else field.default
            signature.append(signature[0].replace(name=field.name, default=default, annotation=kinds[field.name]))
        called.__signature__ = inspect.Signature(signature)  # type: ignore[attr-defined]
        called.__annotations__ = {parameter.name: parameter.annotation for parameter in signature}
        return called

    return decorate
