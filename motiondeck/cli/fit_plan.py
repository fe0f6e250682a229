"""What `motiondeck fit` trains: a recipe, of a file or for clips taught by hand, and the options that change it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from controller.learning.centralized.centralized_training import CentralizedRecipe
from controller.learning.recipe import LibraryRecipe, gesture_recipe, read_recipe
from controller.learning.reservoirs.phase_training import PhaseDrivenRecipe
from controller.motion.formats.reading import CONVERTIBLE, RECORDINGS, read_clip
from motiondeck_base.errors import MotiondeckError


def plan_of(what: list[Path], data: Path | None, out: Path | None, *, trim: bool) -> tuple[LibraryRecipe, Path, bool]:
    """The recipe, the folder of its recordings, and whether it is one for clips that were taught by hand.

    Raises:
        MotiondeckError: if what is given is neither one recipe nor taught clips; it says what to do.
    """
    for path in what:
        if path.suffix.lower() in CONVERTIBLE:
            read_clip(path)  # refuses it, and says how to convert it
    if all(path.suffix.lower() == ".clip" for path in what):
        if data is not None:
            raise MotiondeckError(
                f"--data {data} is for the recordings of a recipe: clips are read from where they are"
            )
        return gesture_recipe("gestures" if out is None else out.stem, what, trim), Path(), True
    if not trim:
        raise MotiondeckError("--no-trim is for clips taught by hand: in a recipe, frames and loop_keeps say it")
    if recorded := [path for path in what if path.suffix.lower() in RECORDINGS or path.is_dir()]:
        raise MotiondeckError(
            f"{recorded[0]}: a recording, not a recipe. "
            f"Type: motiondeck learn {' '.join(map(str, recorded))} --out {out or 'mine.safetensors'}"
        )
    if len(what) > 1:
        raise MotiondeckError(f"give one recipe, or clips taught by hand (.clip) only, not {', '.join(map(str, what))}")
    recipe = what[0]
    if recipe.suffix != ".toml":
        raise MotiondeckError(
            f"{recipe}: not a recipe, which is a TOML file (.toml; docs/library-format.md has one). To learn "
            "recordings without a recipe: motiondeck learn RECORDING... --out FILE.safetensors"
        )
    folder = recipe.parent if data is None else data
    if not folder.is_dir():
        raise MotiondeckError(f"{folder}: there is no such folder; --data is the folder that holds the recordings")
    return read_recipe(recipe, folder), folder, False


def sized(
    plan: LibraryRecipe, centers: str | None, satellites: str | None, tolerance: float | None = None
) -> LibraryRecipe:
    """The recipe with other sizes of its centralized network, or a tolerance for its phase-driven one, mm.

    Raises:
        MotiondeckError: if it has no such network, or a size is neither a number nor "auto".
    """
    if tolerance is not None:
        if not isinstance(plan.network, PhaseDrivenRecipe):
            raise MotiondeckError(f"recipe '{plan.name}' is not for a phase-driven network, which takes --tolerance")
        plan = msgspec.structs.replace(plan, network=msgspec.structs.replace(plan.network, tolerance_mm=tolerance))

    given = {name: value for name, value in (("centers", centers), ("satellites", satellites)) if value is not None}
    if not given:
        return plan
    if not isinstance(plan.network, CentralizedRecipe):
        raise MotiondeckError(f"recipe '{plan.name}' is for a reservoir, which has no {' and no '.join(given)}")
    for name, value in given.items():
        if value != "auto" and not (value.isdecimal() and 1 <= int(value) <= 1000):
            raise MotiondeckError(f"--{name} {value}: give a number from 1 to 1000, or auto")
    sizes: Any = {name: value if value == "auto" else int(value) for name, value in given.items()}
    return msgspec.structs.replace(plan, network=msgspec.structs.replace(plan.network, **sizes))


def new_library(name: str) -> Path:
    """The file that a library is written to where none is given.

    Raises:
        MotiondeckError: if there is one of that name: it may be of another recipe.
    """
    path = Path(f"{name}.safetensors")
    if path.exists():
        raise MotiondeckError(f"{path} exists already: write over it with --out {path}, or name another file")
    return path
