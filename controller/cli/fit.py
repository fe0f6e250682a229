"""`motiondeck fit`: trains a motion library from a recipe and recordings."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from controller.cli.common.options import JsonOption

if TYPE_CHECKING:
    from controller.library.motion_library import MotionLibrary
    from controller.training.recipe import LibraryRecipe
    from controller.training.training_set import LearnedPart, TrainingSet


def fit(
    what: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECIPE | CLIP...",
            help="A recipe (TOML), such as configs/libraries/thesis15.toml, or clips from `motiondeck rig teach`.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="The library to write (.safetensors); default: here, by the recipe's name."
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data", metavar="DIR", help="The folder with the recipe's recordings; default: the recipe's own."
        ),
    ] = None,
    centers: Annotated[
        str | None,
        typer.Option(
            "--centers", metavar="N|auto", help="Number of centers of a centralized network; default: the recipe's."
        ),
    ] = None,
    satellites: Annotated[
        str | None, typer.Option("--satellites", metavar="N|auto", help="Number of satellites; auto: chosen by AICc.")
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            metavar="MM",
            min=0.01,
            help="The smallest phase-driven network whose mean error of every motion is at most this.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="DIR", help="Plot feet and hands of each motion as recorded and as played."),
    ] = None,
    trim: Annotated[
        bool,
        typer.Option(
            "--trim/--no-trim", help="Learn the part of a taught loop that closes best; --no-trim: all of it."
        ),
    ] = True,
    allow_failing: Annotated[
        bool, typer.Option("--allow-failing", help="Write the library even if a motion fails its self-test.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Train a motion library: read the recordings, close their loops, train the network, and test every motion.

    In the self-test each motion runs free for three times its length and is compared with all recordings. If a
    motion fails, the library is only written with --allow-failing.

    Clips recorded by `motiondeck rig teach` need no recipe: each becomes a motion with the name of its file, a loop or
    a one-shot as it was taught. Clips named NAME.clip, NAME.2.clip and so on are takes of one motion and are averaged.
    Of a loop the part that returns best to its start is learned; what is left out is printed.

    [bold]Examples[/]

      motiondeck fit configs/libraries/thesis15.toml --data recordings --out my.safetensors
      motiondeck fit wave.clip nod.clip --out gestures.safetensors
      motiondeck fit configs/libraries/cmu86.toml --data cmu --centers auto --satellites auto --out small.safetensors
    """
    from controller.cli.common.options import check_ending, check_folder
    from controller.cli.common.progress import progress
    from controller.library.motion_library import save_library
    from controller.training import fit as training
    from controller.training.recipe import warnings
    from controller.training.training_set import prepare
    from motiondeck_base.errors import MotiondeckError

    if out is not None:
        check_ending(out, "a library")
    plan, folder, taught = _plan_of(what, data, out, trim=trim)
    out = _new_library(plan.name) if out is None else out
    check_folder(out)
    plan = sized(plan, centers, satellites, tolerance)
    if plot is not None:
        from controller.cli.pictures.figures import check_picture

        check_picture(plot / "motion.png")
    for warning in warnings(plan):
        print(f"motiondeck: warning: {what[0]}: {warning}", file=sys.stderr)
    with progress("", training.steps(plan)) as tick:
        training_set = prepare(plan, folder, tick)
        library = training.fit_prepared(plan, training_set, tick)
    closeness = compare(library, training_set, plan.network.anchor_every, plot)
    failing = [motion.name for motion in library.info.motions if not motion.passed]
    written = not failing or allow_failing
    if written:
        save_library(library, out)
    learned = learned_parts(plan, training_set) if taught else None
    if as_json:
        _print_json(library, training_set, closeness, learned, out if written else None)
    else:
        _print_words(library, training_set, closeness, learned)
    if not written:
        raise MotiondeckError(
            f"{', '.join(failing)} failed the self-test, so {out} was not written. "
            "Give the recipe more seeds, or write it all the same with --allow-failing."
        )
    if not as_json:
        print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB, seed {library.info.seed})")


def _plan_of(what: list[Path], data: Path | None, out: Path | None, *, trim: bool) -> tuple[LibraryRecipe, Path, bool]:
    """The recipe, the folder of its recordings, and whether it is one for clips that were taught by hand.

    Raises:
        MotiondeckError: if what is given is neither one recipe nor taught clips; it says what to do.
    """
    from controller.mocap.formats.reading import CONVERTIBLE, RECORDINGS, read_clip
    from controller.training.recipe import gesture_recipe, read_recipe
    from motiondeck_base.errors import MotiondeckError

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


def _print_json(
    library: MotionLibrary,
    training_set: TrainingSet,
    closeness: list[dict[str, Any]],
    learned: list[dict[str, Any]] | None,
    written: Path | None,
) -> None:
    """The report as one JSON object."""
    from controller.cli.common.library_report import join_fields, part_fields, report
    from controller.deck.worst_join import worst_join

    fields = report(library) | {"beside_the_recording": closeness, "written": str(written) if written else None}
    fields |= {"learned_from": {name: part_fields(part) for name, part in training_set.parts.items()}}
    fields |= {"learned": learned} if learned is not None else {}
    print(json.dumps(fields | {"worst_join": join_fields(worst_join(library))}))


def _print_words(
    library: MotionLibrary,
    training_set: TrainingSet,
    closeness: list[dict[str, Any]],
    learned: list[dict[str, Any]] | None,
) -> None:
    """The report as tables and lines."""
    from controller.cli.common.library_report import join_line, print_table
    from controller.deck.worst_join import worst_join

    print_table(library)
    print_closeness(library, training_set.parts if learned is None else {}, closeness)
    for part in learned or ():
        print(described(part))
    if (worst := worst_join(library)) is not None:
        print(join_line(worst))


def _new_library(name: str) -> Path:
    """The file that a library is written to where none is given.

    Raises:
        MotiondeckError: if there is one of that name: it may be of another recipe.
    """
    from motiondeck_base.errors import MotiondeckError

    path = Path(f"{name}.safetensors")
    if path.exists():
        raise MotiondeckError(f"{path} exists already: write over it with --out {path}, or name another file")
    return path


def learned_parts(plan: LibraryRecipe, training_set: TrainingSet) -> list[dict[str, Any]]:
    """Which part of each taught clip was learned, s: of a loop what comes back best, of a one-shot all of it."""
    rows: list[dict[str, Any]] = []
    for motion in plan.motions:
        part = training_set.parts[motion.name]
        row = {"motion": motion.name, "plays": motion.plays, "takes": 1 + len(motion.takes)}
        rows.append(row | {"from": part.first, "to": part.end, "recorded": part.recorded})
    return rows


def described(row: dict[str, Any]) -> str:
    """One of `learned_parts` in words."""
    if row["takes"] > 1:
        of = f"{row['takes']} takes, averaged"
    else:
        of = f"{row['from']:.1f} to {row['to']:.1f} s of {row['recorded']:.1f} s"
    if row["plays"] == "once":
        return f"{row['motion']}: once, {of}; it comes to rest in its last pose"
    left_out = row["takes"] == 1 and row["to"] - row["from"] < row["recorded"] - 0.1
    return f"{row['motion']}: a loop of {row['to'] - row['from']:.1f} s, {of}" + (
        "; --no-trim learns all of it" if left_out else ""
    )


def sized(
    plan: LibraryRecipe, centers: str | None, satellites: str | None, tolerance: float | None = None
) -> LibraryRecipe:
    """The recipe with other sizes of its centralized network, or a tolerance for its phase-driven one, mm.

    Raises:
        MotiondeckError: if it has no such network, or a size is neither a number nor "auto".
    """
    import msgspec

    from controller.training.centralized.centralized_training import CentralizedRecipe
    from controller.training.reservoirs.phase_training import PhaseDrivenRecipe
    from motiondeck_base.errors import MotiondeckError

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


def compare(library: MotionLibrary, training_set: TrainingSet, every: int, plot: Path | None) -> list[dict[str, Any]]:
    """How far each motion is from its recording at its anchors, mm (eqs 20 to 27), and a centralized network's size."""
    from controller.cli.pictures.curve_plots import draw_coordinates
    from controller.measures.motion_matching import joint_features
    from controller.networks.centralized.centralized_frames import CentralizedNetwork
    from controller.training.centralized.model_choice import (
        hands_and_feet,
        mean_absolute,
        mean_distance,
        relative_accuracy,
    )

    network, rows = library.network, []
    for name, frames in training_set.frames.items():
        read = network.recall(name)
        places = [
            joint_features(library.encoding, channels)[:, :-1].reshape(len(channels), -1, 3)
            for channels in (frames[::every], read)
        ]
        recorded, played = (p[: min(map(len, places))] for p in places)
        row: dict[str, Any] = {"motion": name, "mean_mm": mean_absolute(played, recorded)}
        row |= {"joint_mm": mean_distance(played, recorded)}
        row |= {"relative_accuracy": float(relative_accuracy(played, recorded).mean())}
        if isinstance(network, CentralizedNetwork):
            part = network[name]
            row |= {"centers": len(part.frequency), "satellites": len(part.satellites)}
            row |= {"largest_weight": part.largest_weight}
        rows.append(row)
        if plot is not None:
            which = hands_and_feet(library.skeleton)
            names = [library.skeleton.bones[bone] for bone in which]
            draw_coordinates(
                recorded[:, which],
                {"network": played[:, which]},
                names,
                library.info.rate / every,
                f"{library.info.name}: {name}",
                plot / f"{name}.png",
            )
    return rows


def print_closeness(library: MotionLibrary, parts: dict[str, LearnedPart], rows: list[dict[str, Any]]) -> None:
    """One row a motion: what was learned of its recording, where its loop is closed, its network and its errors."""
    from controller.cli.common.library_report import part_of, seam_of
    from controller.cli.common.tables import show_table

    unit = "mrad" if library.info.encoding == "joint angles" else "mm"
    headings = [name.replace("_mm", f", {unit}").replace("_", " ") for name in rows[0]]
    cells = [[f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()] for row in rows]
    if parts:
        headings[1:1] = ["of the recording", "seam"]
        for row in cells:
            row[1:1] = [part_of(parts[row[0]]), seam_of(parts[row[0]])]
    show_table(headings, cells, title="joints beside the recording, seen from the root")
