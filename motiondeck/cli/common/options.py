"""Options that several commands share, also as fields of a dataclass; and checks of the files to write."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import as_float, check_folder

if TYPE_CHECKING:
    from controller.motion.clip import ReadingOptions

PAGE_PORT = 8040
SHOW_PAGE_PORT = 8050

of_film = partial(Option, rich_help_panel="Film")
_of_simulation = partial(Option, rich_help_panel="Simulation")

SizeOption = Annotated[
    str | None, of_film(metavar="WIDTHxHEIGHT", help="Size of the film in pixels; default: 1920x1080, gif 400x300.")
]
FpsOption = Annotated[float | None, of_film(metavar="FPS", help="Frames per second of the film; default: 30, gif 20.")]
CameraOption = Annotated[Literal["follow", "front", "side", "three"], of_film(help="Camera; three: all side by side.")]
SolverOption = Annotated[
    Literal["angles", "ik"] | None, _of_simulation(help="How to carry motions onto the robot; without it, by its file.")
]
JobsOption = Annotated[
    str, Option(metavar="N|dask://HOST:PORT", help="Parallel processes, -1 for one per core; or a Dask scheduler.")
]
RootOption = Annotated[
    Literal["gantry", "fixed", "free"],
    _of_simulation(help="The simulated robot's root: carried by a gantry, fixed, or free to fall."),
]
JsonOption = Annotated[bool, Option("--json", help="Print one JSON object instead of a table.")]
PagePortOption = Annotated[int, Option(metavar="PORT", help="The page's port; 0 for any free one.")]

GroundOption = Annotated[str, Option(metavar="METRES", help="The floor's height; auto: by the feet; none: leave it.")]
SkeletonOption = Annotated[
    Path | None,
    Option(metavar="FILE", help="An .amc's .asf, an .npz's body model; or one of several people in a file."),
]


@dataclass(frozen=True)
class Reading:
    """Options of a command that reads a recording: what overrules the detected skeleton, unit, axis and names."""

    skeleton: SkeletonOption = None
    unit: Annotated[
        str | None, Option(metavar="METRES|deg|rad", help="Length of a unit, m, or deg or rad; default: detected.")
    ] = None
    up: Annotated[Literal["y", "z"] | None, Option(help="The axis of the file that is up; default: detected.")] = None
    rename: Annotated[
        list[str] | None, Option(metavar="OLD=NEW", help="Another name for a joint, as bone12=LeftUpLeg; repeatable.")
    ] = None

    def options(self) -> ReadingOptions:
        """The same for the readers; MotiondeckError if a new name is not OLD=NEW, or the unit is impossible."""
        from controller.motion.clip import ANGLE_UNITS, ReadingOptions

        try:
            unit = None if self.unit is None else ANGLE_UNITS.get(self.unit) or float(self.unit)
        except ValueError:
            raise MotiondeckError(f"--unit {self.unit}: give a unit's length in m (0.01 for cm), deg or rad") from None
        names = dict(pair.split("=", 1) for pair in self.rename or [] if "=" in pair)
        if len(names) < len(self.rename or []):
            raise MotiondeckError("--rename takes OLD=NEW, once for each joint")
        if self.skeleton is not None and (not self.skeleton.suffix or self.skeleton.suffix[1:].isdigit()):
            return ReadingOptions(None, unit, self.up, names, str(self.skeleton))
        return ReadingOptions(self.skeleton, unit, self.up, names)


def ground_of(given: str) -> float | Literal["auto", "none"]:
    """The value of --ground (MotiondeckError if it is no height)."""
    if given == "auto" or given == "none":
        return given
    if (height := as_float(given)) is None:
        raise MotiondeckError(f"--ground takes a height in m, auto or none, not '{given}'")
    return height


def check_new(*files: Path, force: bool, hint: str = "") -> None:
    """Checks that files do not exist or may be replaced (`force`), else MotiondeckError; a hint ends its message."""
    for file in files:
        if file.exists() and not force:
            raise MotiondeckError(f"{file} exists already; give another --out, or --force to replace it{hint}")


def check_ending(file: Path, what: str) -> None:
    """Checks that a file to write ends as it must, lest a recording is replaced, and has a folder; MotiondeckError."""
    if file.suffix.lower() != ".safetensors":
        raise MotiondeckError(f"{file}: {what} ends in .safetensors. Name the file so.")
    check_folder(file)


def check_plot(plot: Path | None) -> None:
    """Checks, before anything is computed, that a plot can be drawn if one is asked for; see `check_picture`."""
    if plot is not None:
        from motiondeck.pictures.figures import check_picture

        check_picture(plot)


def check_other(recording: Path, out: Path) -> None:
    """Checks that a command does not write over the recording it reads; MotiondeckError if both are one file."""
    linked = recording.exists() and out.exists() and recording.samefile(out)
    if linked or recording.resolve() == out.resolve():
        raise MotiondeckError(f"{out}: this is the recording itself. Give another name to write to.")


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

    @wraps(command)
    def called(**values: Any) -> None:
        for name, (own, value_of) in groups.items():
            values[name] = value_of(**{one.name: values.pop(one.name) for one in own if one.name in values})
        command(**values)

    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


def _parameters(made: Callable[..., Any]) -> list[inspect.Parameter]:
    return list(inspect.signature(made, eval_str=True).parameters.values())
