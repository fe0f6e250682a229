"""Options that a command takes as one value, such as the fields of a dataclass."""

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from typing import Any

Group = tuple[Sequence[inspect.Parameter], Callable[..., Any]]
"""Parameters for typer, and what makes the one value of them."""


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer in which each parameter of a dataclass type is replaced by the fields of the dataclass."""
    kinds: dict[str, Any] = {one.name: one.annotation for one in _parameters(command) if is_dataclass(one.annotation)}
    return with_groups(command, {name: (_parameters(kind), kind) for name, kind in kinds.items()})


def with_groups(command: Callable[..., None], groups: Mapping[str, Group]) -> Callable[..., None]:
    """A command for typer in which the parameters of these names are replaced by those of their groups."""
    every = [one for own in _parameters(command) for one in (groups[own.name][0] if own.name in groups else [own])]
    parameters = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in every]

    @functools.wraps(command)
    def called(**values: Any) -> None:
        for name, (own, value_of) in groups.items():
            values[name] = value_of(**{one.name: values.pop(one.name) for one in own if one.name in values})
        command(**values)

    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


def _parameters(made: Callable[..., Any]) -> list[inspect.Parameter]:
    return list(inspect.signature(made, eval_str=True).parameters.values())
