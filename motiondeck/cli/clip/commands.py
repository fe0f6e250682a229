"""`motiondeck clip`: shows what a motion capture file holds, converts it, draws it, and plays it in the browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motiondeck.cli.common.options import (
    PAGE_PORT,
    CameraOption,
    FpsOption,
    JsonOption,
    PagePortOption,
    RenameOption,
    SizeOption,
    SkeletonOption,
    UnitOption,
    UpOption,
    check_other,
    reading_options,
)

if TYPE_CHECKING:
    from controller.motion.formats.clip_facts import Facts
    from controller.motion.formats.reading import FittedClip
    from controller.motion.reading_options import ReadingOptions

app = typer.Typer(
    help="Show, draw and convert motion capture files of any format.",
    no_args_is_help=True,
)

FileArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="A recording: .amc, .bvh, .c3d, .csv, .glb, .gltf, .mat, .mvnx, .npz (SMPL), .trc or .vrm."
    ),
]


@app.command("show")
def show(
    file: FileArgument,
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a recording holds: its body, rate, length and path, and for markers the gaps and the fit.

    It also shows which bone was taken for which part of the body, and what looks wrong about it.

    Example:  motiondeck clip show dance.c3d
    """
    from controller.motion.formats.clip_facts import facts

    known = facts(_read(file, reading_options(skeleton, unit, up, rename)))
    if as_json:
        print(json.dumps(known))
    else:
        _print(known)


@app.command("convert")
def convert(
    file: FileArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="OUT.bvh for other programs, OUT.csv for positions.")],
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
    begin: Annotated[float, typer.Option("--from", metavar="SECONDS", help="Where the piece to write begins.")] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", metavar="SECONDS", help="Where it ends; default: with the recording.")
    ] = None,
) -> None:
    """Convert a recording to BVH (bones and their rotations; y up, cm) or CSV (time, then x, y, z of every joint, m).

    With --from and --to it writes a piece of the recording.

    [bold]Examples[/]

      motiondeck clip convert 02_03.amc run.bvh
      motiondeck clip convert session.bvh wave.bvh --from 12.5 --to 18
    """
    from controller.motion.canonical.clip_edits import seconds_of
    from controller.motion.formats.writing import write_clip

    check_other(file, out)
    clip = seconds_of(_read(file, reading_options(skeleton, unit, up, rename)).clip, begin, end)
    write_clip(clip, out)
    print(f"wrote {out} ({len(clip)} frames of {len(clip.skeleton)} bones)")


@app.command("mirror")
def mirror(
    file: FileArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="OUT.bvh or OUT.csv.")],
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
) -> None:
    """Write a recording with left and right exchanged, on the canonical body (19 bones).

    In a recipe `mirrored = true` does the same to a motion.

    Example:  motiondeck clip mirror wave.bvh wave-left.bvh
    """
    from controller.motion.canonical.clip_edits import mirrored
    from controller.motion.formats.writing import write_clip

    check_other(file, out)
    clip = mirrored(_read(file, reading_options(skeleton, unit, up, rename)).clip)
    write_clip(clip, out)
    print(f"wrote {out} ({len(clip)} frames, left and right exchanged)")


@app.command("plot")
def plot(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="One recording, or several for a sheet.")],
    out: Annotated[Path, typer.Option("--out", metavar="PICTURE", help="The picture to write (.png).")],
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
    sheet: Annotated[
        bool, typer.Option("--sheet", help="Draw mannequins instead of curves, one row per recording.")
    ] = False,
) -> None:
    """Draw a recording: stick figures through the motion, heights and speeds, and for markers their gaps.

    Several recordings, or --sheet, make a contact sheet: eight moments of each, done by its mannequin.

    Example:  motiondeck clip plot walk.bvh --out walk.png
    """
    from motiondeck.pictures.clip_plot import plot_clip, plot_sheet

    options = reading_options(skeleton, unit, up, rename)
    if sheet or len(files) > 1:
        plot_sheet([_read(file, options).clip for file in files], out)
    else:
        plot_clip(_read(files[0], options), out)
    print(f"wrote {out}")


@app.command("view")
def view(
    file: FileArgument,
    skeleton: SkeletonOption = None,
    unit: UnitOption = None,
    up: UpOption = None,
    rename: RenameOption = None,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="A robot beside the human that follows it.")
    ] = None,
    video: Annotated[
        Path | None, typer.Option("--video", metavar="FILM", help="Film it off screen instead: .mp4 or .gif.")
    ] = None,
    size: SizeOption = None,
    fps: FpsOption = None,
    camera: CameraOption = "follow",
    port: PagePortOption = PAGE_PORT,
) -> None:
    """View a recording in the browser: the human with its bones, and with --robot a robot beside it that follows it.

    The page has a time bar, single steps, a tempo, footprints and contacts, and a camera that follows. It is served
    on 127.0.0.1 only; Ctrl-C ends it.

    Example:  motiondeck clip view dance.c3d --robot servo20
    """
    import numpy as np

    from motiondeck.pictures.clip_scene import act_of
    from motiondeck.pictures.library_pictures import film_frames, film_look
    from motiondeck.run.page.page import show_act
    from motiondeck_base.shipped import find_robot

    clip = _read(file, reading_options(skeleton, unit, up, rename)).clip
    body = None if robot is None else find_robot(robot)
    act = act_of(clip, body, ghost=video is None or body is not None)
    if video is not None:
        look = film_look(video, size, fps, camera)
        shown = np.arange(0.0, len(act.qpos), act.rate / look.fps).astype(int)
        film_frames(act.model, act.qpos[shown], len(shown), video, look)
        print(f"wrote {video} ({len(shown)} frames)")
        return
    show_act(act, port)


def _read(file: Path, options: ReadingOptions) -> FittedClip:
    """A recording of a body.

    Raises:
        MotiondeckError: if it cannot be read, or holds the angles of a rig's joints.
    """
    from controller.motion.encodings.joint_angles import JointBody
    from controller.motion.formats.reading import read_fitted
    from motiondeck_base.errors import MotiondeckError

    recording = read_fitted(file, options)
    if isinstance(recording.clip.skeleton, JointBody):
        raise MotiondeckError(
            f"{file}: holds angles of a rig's joints, no body. `motiondeck play` plays it on the rig."
        )
    return recording


def _print(known: Facts) -> None:
    from motiondeck.cli.common.tables import show_facts

    rows = {
        "motion": f"{known['name']} ({known['source']})",
        "body": f"{known['skeleton']}, {known['bones']} bones"
        + (f", legs {known['leg']:.2f} m" if known["taken_for"] else "")
        + (f"; no {', no '.join(known['lacks'])}" if known["lacks"] else ""),
        "length": f"{known['frames']} frames at {known['rate']:g} Hz, {known['duration']:.2f} s",
        "taken for": ", ".join(f"{part}: {bone}" for part, bone in known["taken_for"].items()),
        "extent": "   ".join(f"{a} {lo:.2f} to {hi:.2f} m" for a in "xyz" for lo, hi in [known[a]]),
        "root height": "{:.2f} to {:.2f} m".format(*known["root_height"]),
        "path": f"{known['path']:.2f} m along the ground, {known['median_speed']:.2f} m/s in the median",
        "fastest joint": f"{known['fastest_joint']}, {known['fastest_speed']:.1f} m/s",
    }
    gaps = known["gaps"]
    if gaps is not None:
        rows["markers"] = f"{gaps['markers']} used, seen {100.0 * gaps['seen']:.1f} % of the time" + (
            f", longest gap {gaps['longest_gap']} frames ({gaps['longest_gap_marker']})" if gaps["longest_gap"] else ""
        )
        rows["fit"] = (
            f"markers off by {gaps['residual_rms_mm']:.1f} mm rms, 95 % under {gaps['residual_p95_mm']:.1f} mm, "
            f"at most {gaps['residual_max_mm']:.0f} mm"
        )
    show_facts({name: value for name, value in rows.items() if value})
    for doubt in known["doubts"]:
        print(f"doubt: {doubt}")
