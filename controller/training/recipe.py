"""A training recipe: which clips become which motions, and the network that learns them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from controller.config import read_toml
from controller.errors import FileFormatError
from controller.training.conceptor_training import ConceptorRecipe
from controller.training.echo_state_training import EchoStateRecipe


class MotionRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """One motion.

    Attributes:
        name: what it is called when it plays.
        file: the recording, relative to the data folder.
        plays: "loop" is closed and goes on for ever, "once" ends in a pose and holds it.
        frames: first frame and the one after the last, or the whole recording.
    """

    name: str
    file: str
    plays: Literal["loop", "once"] = "loop"
    frames: tuple[int, int] | None = None


class LibraryRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A motion library to be trained.

    Attributes:
        name: of the library.
        network: its kind and parameters.
        motions: what it learns.
        body: the recording whose skeleton all motions are carried to.
        loop_keeps: the least share of a recording that its loop keeps.
        seeds: tried in turn until every motion passes the self-test.
        licence, acknowledgement: go into the library.
    """

    name: str
    network: ConceptorRecipe | EchoStateRecipe
    motions: list[MotionRecipe]
    body: str
    loop_keeps: float = 0.6
    seeds: list[int] = msgspec.field(default_factory=lambda: [0, 1, 2, 3, 4])
    licence: str
    acknowledgement: str = ""


def read_recipe(path: Path) -> LibraryRecipe:
    """The recipe in a TOML file.

    Raises:
        FileFormatError: one line that names the file, the key and what is allowed.
    """
    recipe = read_toml(path, LibraryRecipe)
    names = [motion.name for motion in recipe.motions]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise FileFormatError(f"{path}: two motions are called '{twice.pop()}'")
    if not names:
        raise FileFormatError(f"{path}: there are no [[motions]] in it")
    if not recipe.seeds:
        raise FileFormatError(f"{path}: seeds is empty; give at least one whole number")
    if not 0.1 <= recipe.loop_keeps < 1.0:
        raise FileFormatError(f"{path}: loop_keeps is {recipe.loop_keeps}; it lies between 0.1 and 1")
    _check_network(path, recipe.network)
    return recipe


def _check_network(path: Path, network: ConceptorRecipe | EchoStateRecipe) -> None:
    """Refuses sizes and scales that no network can have."""
    for field in network.__struct_fields__:
        value = getattr(network, field)
        least = 0 if field.endswith("noise") else 1 if isinstance(value, int) else 1e-9
        most = 20_000 if field == "neurons" else 1.0 if field == "leak" else 1e6
        if not least <= value <= most:
            raise FileFormatError(f"{path}: network.{field} is {value}; it lies between {least} and {most}")
