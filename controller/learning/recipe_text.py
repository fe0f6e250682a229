"""A recipe as TOML, so that it can be edited and trained again; `recipe.read_recipe` reads it."""

from __future__ import annotations

import json
from typing import Any

import msgspec

from controller.learning.recipe import LibraryRecipe


def recipe_text(recipe: LibraryRecipe) -> str:
    """The TOML text of a recipe, without fields at their defaults except for the network."""
    tree = msgspec.to_builtins(recipe)
    network, motions = tree.pop("network"), tree.pop("motions")
    defaults = {field.name: field.default for field in msgspec.structs.fields(LibraryRecipe) if not field.required}
    set_fields = {key: value for key, value in tree.items() if value is not None and value != defaults.get(key)}
    lines = [_line(key, value) for key, value in set_fields.items()]
    if "licence" not in set_fields:
        lines.append(f"{_line('licence', recipe.licence)}  # on what terms may the recordings be passed on?")
    lines += ["", "[network]", *(_line(key, value) for key, value in network.items() if value is not None)]
    for motion in motions:
        lines += [
            "",
            "[[motions]]",
            *(_line(key, value) for key, value in motion.items() if value not in (None, False, {}, (), [])),
        ]
    return "\n".join(lines) + "\n"


def _line(key: str, value: Any) -> str:
    return f"{key} = {_value(value)}"


def _value(value: Any) -> str:
    """A string, number, list or table as TOML writes it; JSON's strings, numbers and lists are the same."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_value(part)}" for key, part in value.items()) + " }"
    return json.dumps(value)
