"""`motiondeck library`: lists and shows motion libraries, adds and removes motions, and bakes them for robots."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption, Reading, check_ending, grouped
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.progress import progress
from motiondeck_base.shipped import find_library, shipped_configs

if TYPE_CHECKING:
    from controller.library.motion_library import MotionLibrary

app = typer.Typer(help="List, show, extend and bake motion libraries.", no_args_is_help=True)

LibraryArgument = Annotated[str, Argument(metavar="LIBRARY", help="A library file, or a shipped one's name.")]
AllowFailing = Annotated[bool, Option("--allow-failing", help="Write the library even if the motion fails.")]
OutOption = Annotated[Path | None, Option(metavar="FILE", help="The library to write; default: LIBRARY itself.")]


@app.command("list")
def list_libraries(as_json: JsonOption = False) -> None:
    """List the included libraries and those in this folder.

    Example:  motiondeck library list
    """
    from controller.library.motion_library import load_library
    from motiondeck.cli.common.tables import show_table

    rows: list[dict[str, Any]] = []
    shipped = sorted((shipped_configs() / "libraries").glob("*.safetensors"))
    for file in [*shipped, *sorted(Path().glob("*.safetensors"))]:
        row = {"library": file.stem if file in shipped else file.name, "network": "", "motions": [], "reason": ""}
        try:
            loaded = load_library(file)
            row |= {"network": loaded.info.network, "motions": loaded.network.motions}
        except FileFormatError as error:
            row["reason"] = str(error)
        rows.append(row)
    if as_json:
        print(json.dumps({"libraries": rows}))
        return
    table = [
        (r["library"], r["network"], str(len(r["motions"]) or ""), r["reason"] or ", ".join(r["motions"])) for r in rows
    ]
    show_table(("library", "network", "motions", "names"), table, left=("network", "names"))


@app.command("show")
def show(
    library: LibraryArgument,
    recording: Annotated[
        Path | None, Argument(metavar="[RECORDING]", help="Judge the motions of this recording anew by it.")
    ] = None,
    robot: Annotated[str | None, Option(metavar="ROBOT", help="Say what this robot plays, like `preflight`.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the motions, the network, and the origin of a library.

    With a recording only the motions that were learned from a file of this name: each runs free and is compared with
    the recording again. The exit code is 1 if one does not pass.

    [bold]Examples[/]

      motiondeck library show thesis15
      motiondeck library show mine.safetensors walk.bvh
      motiondeck library show thesis15 --robot servo20
    """
    from controller.library.motion_library import load_library
    from motiondeck.cli.common.library_report import print_errors, print_table, report
    from motiondeck.cli.common.verdict_report import print_verdicts, verdicts_on

    path = find_library(library)
    loaded = load_library(path)
    if recording is not None:
        from controller.learning.fit import judge_against

        motions = judge_against(loaded, path, recording)
        if as_json:
            print(json.dumps({"motions": msgspec.to_builtins(motions)}))
        else:
            print_errors(motions)
            for motion in motions:
                print(f"{motion.name}: {'passed' if motion.passed else motion.reason}")
        if not all(motion.passed for motion in motions):
            raise typer.Exit(1)
        return
    verdicts = verdicts_on(robot, path, list(loaded.network.motions))
    if as_json:
        print(json.dumps(report(loaded) | {"verdicts": [verdict.row() for verdict in verdicts]}))
        return
    print_table(loaded)
    if verdicts:
        print_verdicts(verdicts, f"on {robot}")
    print(f"body      that of {loaded.info.skeleton.name}, {len(loaded.skeleton)} bones")
    print(f"seed      {loaded.info.seed}")
    print(f"licence   {loaded.info.licence}")
    print(f"thanks    {loaded.info.acknowledgement}")


@app.command("bake")
def bake(
    library: LibraryArgument,
    robot: Annotated[str, Option(metavar="ROBOT", help="The robot to carry it to.")],
    out: Annotated[Path | None, Option(metavar="FILE", help="The library; default: where `play` looks for it.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Carry a library to a robot's joints beforehand.

    Each motion is retargeted as a whole, with its footing and within the limits of the joints, and learned as joint
    angles with the path of the root. `play` with this library and robot then computes neither human nor retargeting, as
    long as neither has changed; what needs the human (a free root, another solver, recognition) is still carried live.
    The verdicts are those of `preflight`.

    Example:  motiondeck library bake thesis15 --robot servo20
    """
    from controller.library.motion_library import save_library
    from motiondeck.cli.common.library_report import print_table, report
    from motiondeck.cli.common.verdict_report import print_verdicts, verdicts_on
    from motiondeck.run.baked_libraries import baked_file
    from motiondeck.run.baking import bake as baked_for
    from sim.robots.catalogue import find_robot

    path, file = find_library(library), find_robot(robot)
    target = out or baked_file(path, file)
    if out is None:
        target.parent.mkdir(parents=True, exist_ok=True)
    check_ending(target, "a library")
    with progress("baking", None) as tick:
        baked = baked_for(path, file, tick)
    save_library(baked, target)
    verdicts = verdicts_on(str(file), path, baked.network.motions)
    if as_json:
        rows = [verdict.row() for verdict in verdicts]
        print(json.dumps(report(baked) | {"written": str(target), "verdicts": rows}))
        return
    print_table(baked)
    print_verdicts(verdicts, f"on {file.stem}")
    print(f"wrote {target} ({target.stat().st_size / 1e6:.1f} MB)")


@app.command("add")
@grouped
def add(
    library: LibraryArgument,
    clip: Annotated[Path, Argument(metavar="RECORDING", help="The recording, of any format, skeleton and rate.")],
    reading: Reading,
    name: Annotated[str, Option(metavar="NAME", help="Name of the motion; default: the recording's.")] = "",
    once: Annotated[bool, Option("--once", help="A one-shot, which holds its last pose; default: a loop.")] = False,
    frames: Annotated[tuple[int, int] | None, Option(metavar="FIRST END", help="Only these frames of it.")] = None,
    out: OutOption = None,
    allow_failing: AllowFailing = False,
    as_json: JsonOption = False,
) -> None:
    """Add a motion to a library; the weights of others do not change.

    An autonomous conceptor network loads the motion into the free part of its reservoir and prints what is left; other
    networks get one more readout or one more motion. The new motion has to pass the self-test.

    Example:  motiondeck library add my.safetensors skip.bvh --name skip
    """
    from controller.learning.adding import add_motion
    from controller.learning.recipe import MotionRecipe, typeable
    from controller.library.motion_library import load_library
    from controller.motion.formats.reading import read_clip
    from motiondeck.cli.common.library_report import part_fields, part_of, print_table, seam_of

    path, target = _to_change(library, out)
    options = reading.options()
    name = name or typeable(clip.stem)
    plan = MotionRecipe(
        name=name,
        file=str(clip),
        plays="once" if once else "loop",
        frames=frames,
        skeleton=None if options.skeleton is None else str(options.skeleton),
        unit=options.unit,
        up=reading.up,
        rename=dict(options.rename),
        person=options.person,
    )
    found = add_motion(load_library(path), path, read_clip(clip, options), plan)
    if not as_json:
        print_table(found.library)
        seam = f", seam {seam_of(found.part)}" if found.part.seam_mm is not None else ""
        print(f"{name}: {part_of(found.part)}{seam}")
    fields = {"learned_from": part_fields(found.part)}
    _write(found.library, target, fields, allow_failing, as_json, "Train all motions together with learn")


def _write(
    library: MotionLibrary, target: Path, fields: dict[str, Any], allow_failing: bool, as_json: bool, else_: str = ""
) -> None:
    """Writes a changed library, unless its last motion, a new one, failed; MotiondeckError if it did."""
    from controller.library.motion_library import save_library
    from motiondeck.cli.common.library_report import report

    motion = library.info.motions[-1]
    writes = motion.passed or allow_failing
    if writes:
        save_library(library, target)
    if as_json:
        print(json.dumps(report(library) | {"written": str(target) if writes else None} | fields))
    if not writes:
        raise MotiondeckError(
            f"'{motion.name}' failed ({motion.reason}), so {target} was not written. "
            f"{else_}, or write it anyway with --allow-failing."
        )
    if not as_json:
        print(f"wrote {target} ({target.stat().st_size / 1e6:.1f} MB)")


@app.command("morph")
def morph(
    library: LibraryArgument,
    expression: Annotated[str, Argument(metavar="EXPRESSION", help="Loops with &, |, ~, or shares that sum to 1.")],
    name: Annotated[str, Option(metavar="NAME", help="Name of the motion.")],
    out: OutOption = None,
    allow_failing: AllowFailing = False,
    as_json: JsonOption = False,
) -> None:
    """Add a loop that is computed from others by their conceptors.

    For libraries whose motions share their readout, as thesis15. "0.5 walk + 0.5 waltz" is between both, "1.2 walk -
    0.2 jog" beyond walk, away from jog; "walk & waltz" does what both do, "walk | waltz" what either does, "~jog" is
    joined by & and takes away what jog does; ( ) as usual. Played, it has to move and must not jerk.

    [bold]Examples[/]

      motiondeck library morph thesis15 "0.5 walk + 0.5 waltz" --name sway --out mine.safetensors
      motiondeck library morph mine.safetensors "walk & waltz & ~jog" --name stroll
    """
    from controller.learning.motion_algebra import compute_motion
    from controller.library.motion_library import load_library
    from motiondeck.cli.common.library_report import print_table

    path, target = _to_change(library, out)
    found = compute_motion(load_library(path), expression, name)
    if not as_json:
        print_table(found.library)
        alike = sorted(found.similarity.items(), key=lambda one: -one[1])
        print(f"{name}: {found.activity:.2f} times as fast as its motions, {found.jerk:.2f} times their largest jerk")
        print("similar to " + ", ".join(f"{other} {value:.2f}" for other, value in alike))
    names = "activity", "jerk", "aperture", "similarity"
    fields = {one: getattr(found, one) for one in names}
    _write(found.library, target, fields, allow_failing, as_json, "Try other shares or motions")


@app.command("remove")
def remove(
    library: LibraryArgument,
    motion: Annotated[str, Argument(metavar="MOTION", help="The motion to leave out.")],
    out: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Remove a motion from a library; all others stay as they are.

    What is stored of the others is the same bit for bit. The last motion is not removed.

    Example:  motiondeck library remove my.safetensors skip
    """
    from controller.library.motion_library import load_library, without_motion
    from motiondeck.cli.common.library_report import print_table

    path, target = _to_change(library, out)
    kept = without_motion(load_library(path), motion)
    if not as_json:
        print_table(kept)
    _write(kept, target, {}, True, as_json)


def _to_change(library: str, out: Path | None) -> tuple[Path, Path]:
    """The file of a library and the one to write, LIBRARY itself by default; MotiondeckError if it is a shipped one."""
    path = find_library(library)
    if out is None and not Path(library).is_file():
        raise MotiondeckError(f"'{library}' is a shipped library, which is never changed; give --out FILE")
    target = out or path
    check_ending(target, "a library")
    return path, target
