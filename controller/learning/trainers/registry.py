"""Finds the trainer of a kind of network: its file here, named as the kind's folder in `controller/networks`."""

from functools import cache
from importlib import import_module
from typing import Any

from controller.learning.trainers.trainer import NetworkRecipe, Trainer
from controller.networks.registry import network_kinds


@cache
def trainer_named(kind: str) -> Trainer[Any]:
    """The trainer of a kind of network."""
    trainer: Trainer[Any] = import_module(f"controller.learning.trainers.{kind.replace('-', '_')}").TRAINER
    return trainer


def trainer_of(recipe: NetworkRecipe) -> Trainer[Any]:
    """The trainer that a recipe is for."""
    return trainer_named(kind_of(recipe))


def kind_of(recipe: NetworkRecipe) -> str:
    """The kind of network that a recipe describes."""
    own: Any = recipe
    return str(own.__struct_config__.tag)


def network_recipes() -> tuple[type[NetworkRecipe], ...]:
    """The recipes of all kinds."""
    return tuple(trainer_named(kind).recipe for kind in network_kinds())
