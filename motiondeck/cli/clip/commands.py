"""`motiondeck clip`: shows, converts, draws and plays recordings of bodies and of a rig's joints."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from motiondeck.cli.common import options as shared
from motiondeck.cli.common.options import JsonOption, Reading, SkeletonOption, grouped
from motiondeck.cli.common.tables import show_facts, show_table
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import check_folder, write_file
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.learning.centralized.reconstruction import Gap
    from controller.motion.clip import Clip, Markers

app = typer.Typer(help="Show, convert, draw and view recordings and joint motions.", no_args_is_help=True)

FileArgument = Annotated[Path, Argument(metavar="FILE", help='A recording (formats: the page "Recordings").')]


@app.command("show")
@grouped
def show(
    file: FileArgument, reading: Reading, ground: shared.GroundOption = "auto", as_json: JsonOption = False
) -> None:
    """Show the body, rate, length and path of a recording.

    For markers also the gaps and the fit. The table shows which bone was taken for which part of the body; doubts about
    it follow. If the unit, the vertical axis or a bone was detected wrongly, --unit, --up and --rename correct it, here
    and in `clip convert`. For joints of a rig the table has their range and speed.

    Example:  motiondeck clip show dance.c3d
    """
    from controller.learning.recording_analysis import with_steps
    from controller.motion.formats.reading import read_fitted
    from motiondeck.cli.clip.clip_facts import facts, joint_facts

    recording = read_fitted(file, with_steps(replace(reading.options(), ground=shared.ground_of(ground))))
    is_rig = recording.clip.skeleton.is_rig
    known = joint_facts(recording.clip) if is_rig else facts(recording)
    if as_json:
        print(json.dumps(known))
    elif is_rig:
        rows = {"motion": f"{known['name']} ({known['source']}), {known['plays'] or 'loop or once is not said'}"}
        rows["length"] = f"{known['frames']} frames at {known['rate']:g} Hz, {known['duration']:.2f} s"
        for joint, figures in known["joints"].items():
            lower, upper, speed = map(math.degrees, figures.values())
            rows[joint] = f"{lower:+.1f} to {upper:+.1f} deg, at most {speed:.0f} deg/s"
        show_facts(rows)
    else:
        _print(known)


@app.command("convert")
@grouped
def convert(
    file: FileArgument,
    out: Annotated[
        Path,
        Argument(metavar="OUT", help="OUT.bvh, .csv (positions), .c3d with --fill; joints OUT.clip, .csv or .npz."),
    ],
    reading: Reading,
    begin: Annotated[float, Option("--from", metavar="SECONDS", help="Where the piece to write begins.")] = 0.0,
    end: Annotated[float | None, Option("--to", metavar="SECONDS", help="Where it ends; default: at the end.")] = None,
    mirror: Annotated[bool, Option("--mirror", help="Exchange left and right; of joints by --skeleton RIG.")] = False,
    fill: Annotated[bool, Option("--fill", help="Fill gaps of markers; from .c3d to .c3d or .csv.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Convert a recording to another format; cut, mirror or fill it.

    BVH has bones and their rotations (y up, cm), CSV the time and x, y, z of every joint (m). Angles of a rig's joints,
    taught, written as keyframes or recorded by `play --record`, become .clip, .csv or .npz.

    --mirror writes what `mirrored = true` makes of a motion in a recipe. Joints exchange with their twins
    (left_lid, right_lid); how they turn is said by `mirror` in a rig file, or found in a model: --skeleton FILE.

    --fill reconstructs markers that were lost for a while: by a network of the visible markers around each gap, by
    their principal components, and by a line or a cubic along the marker's own path, each as far as it fills hidden
    stretches of the same length. The table shows the expected error of each marker. A gap stays open if fewer than
    three other markers were visible throughout it, or its own marker was hardly visible around it. A .c3d keeps
    everything else; filled points have the residual 0. A .csv has the time in s and x, y, z of every marker in m, in
    the file's own axes.

    [bold]Examples[/]

      motiondeck clip convert 02_03.amc run.bvh
      motiondeck clip convert session.bvh wave.bvh --from 12.5 --to 18
      motiondeck clip convert wave.bvh wave-left.bvh --mirror
      motiondeck clip convert wink.toml wink-left.clip --mirror --skeleton head.toml
      motiondeck clip convert dance.c3d filled.c3d --fill
    """
    shared.check_other(file, out)
    check_folder(out)
    if fill:
        if mirror or begin or end is not None or reading != Reading():
            raise MotiondeckError("--fill writes the whole file with its own markers: it takes no other option")
        _fill_markers(file, out, as_json)
        return
    from controller.learning.preparation.takes import with_kind
    from controller.motion.canonical.clip_edits import mirrored, mirrored_joints, seconds_of
    from controller.motion.formats.reading import read_fitted
    from controller.motion.formats.writing import write_clip

    clip = read_fitted(file, reading.options()).clip
    clip = seconds_of(clip, begin, end) if begin or end is not None else clip
    if mirror and clip.skeleton.is_rig:
        clip = mirrored_joints(clip, _mirror_signs(reading.skeleton))
    elif mirror:
        clip = mirrored(clip)
    clip = with_kind(clip) if clip.skeleton.is_rig else clip
    write_clip(clip, out)
    if as_json:
        written = {"file": str(file), "written": str(out), "frames": len(clip), "bones": list(clip.skeleton.bones)}
        print(json.dumps(written))
    else:
        exchanged = ", left and right exchanged" if mirror else ""
        bones = f"joints, {clip.plays}" if clip.skeleton.is_rig else "bones"
        print(f"wrote {out} ({len(clip)} frames of {len(clip.skeleton)} {bones}{exchanged})")


@app.command("complete")
def complete(
    file: FileArgument,
    out: Annotated[Path, Argument(metavar="OUT", help="OUT.bvh or OUT.csv; of joints OUT.clip, .csv or .npz.")],
    like: Annotated[
        list[Path], Option(metavar="PATH", help="Whole recordings to learn from, or a folder; repeatable.")
    ],
    names: Annotated[str, Option("--from", metavar="NAMES", help="Use these alone, such as head,lhan,rhan.")] = "",
    height: Annotated[float | None, Option(metavar="METRES", help="Of the person; default: as in --like.")] = None,
) -> None:
    """Complete a body from some points, or a rig from some joints.

    The rest follows by ridge regression from 0.8 s around each moment, learned from whole recordings of such motions.
    Points have the names of the page "On a stage" (root, head, lhan, rhan, lank ...), among them a left and a right
    one; gaps are bridged. Of a whole recording, --from names those to use. Joints that are given stay as they are.

    Example:  motiondeck clip complete trackers.csv body.bvh --like walks/ --height 1.78
    """
    shared.check_other(file, out)
    check_folder(out)
    from controller.learning.completion import complete_recording
    from controller.motion.formats.reading import recordings_in
    from controller.motion.formats.writing import write_clip

    files = recordings_in(like)
    clip = complete_recording(file, files, names.split(",") if names else (), height)
    write_clip(clip, out)
    kind = "joints" if clip.skeleton.is_rig else "bones"
    print(f"wrote {out} ({len(clip)} frames of {len(clip.skeleton)} {kind}, learned from {len(files)} recordings)")


@app.command("plot")
def plot(
    files: Annotated[list[Path], Argument(metavar="FILE...", help="One recording, or several for a sheet.")],
    out: Annotated[Path, Option(metavar="PICTURE", help="The picture to write (.png).")],
    skeleton: SkeletonOption = None,
) -> None:
    """Draw a recording as stick figures and curves.

    The curves are heights, speeds, and for markers their gaps; for joints angles and speeds. Several recordings make a
    contact sheet: eight moments of each, played by a mannequin of its body.

    Example:  motiondeck clip plot walk.bvh --out walk.png
    """
    from controller.motion.clip import ReadingOptions
    from controller.motion.formats.reading import read_fitted
    from motiondeck.pictures.clip_plot import plot_clip, plot_sheet

    recordings = [read_fitted(file, ReadingOptions(skeleton)) for file in files]
    if len(recordings) > 1:
        for recording in recordings:
            _refuse_joints(recording.clip, "draw it alone")
        plot_sheet([recording.clip for recording in recordings], out)
    else:
        plot_clip(recordings[0], out)
    print(f"wrote {out}")


@app.command("view")
@grouped
def view(
    file: FileArgument,
    reading: Reading,
    robot: Annotated[str | None, Option(metavar="ROBOT", help="A robot beside the human that follows it.")] = None,
    video: Annotated[Path | None, Option(metavar="FILM", help="Film it off screen instead: .mp4 or .gif.")] = None,
    port: shared.PagePortOption = shared.PAGE_PORT,
) -> None:
    """View a recording in the browser, alone or beside a robot.

    The robot follows the human. The page has a time bar, single steps, a tempo, footprints and contacts, a camera that
    follows, and what `motiondeck learn` decides about the recording. It is served on 127.0.0.1 only; Ctrl-C ends it.

    Example:  motiondeck clip view dance.c3d --robot servo20
    """
    import numpy as np

    from controller.learning.recording_analysis import with_steps
    from controller.motion.formats.reading import read_fitted
    from motiondeck.cli.clip.clip_facts import decided_of
    from motiondeck.pictures.clip_scene import act_of
    from motiondeck.pictures.library_pictures import film_frames, film_look
    from motiondeck.run.page.page import show_act
    from sim.robots.catalogue import find_robot

    recording = read_fitted(file, with_steps(reading.options()))
    _refuse_joints(recording.clip, "`motiondeck clip plot` draws it")
    body = None if robot is None else find_robot(robot)
    act = act_of(recording.clip, body, ghost=video is None or body is not None)
    if video is not None:
        look = film_look(video, None, None, "follow")
        shown = np.arange(0.0, len(act.qpos), act.rate / look.fps).astype(int)
        film_frames(act.model, act.qpos[shown], len(shown), video, look)
        print(f"wrote {video} ({len(shown)} frames)")
        return
    decisions, doubtful = decided_of(recording)
    show_act(replace(act, decisions=decisions, doubts=doubtful), port)


def _refuse_joints(clip: Clip, remedy: str) -> None:
    if clip.skeleton.is_rig:
        raise MotiondeckError(f"{clip.source}: holds angles of a rig's joints, no body: {remedy}.")


def _mirror_signs(file: Path | None) -> dict[str, int]:
    """How joints turn when left and right are exchanged, by a rig file or a robot's model."""
    if file is None:
        raise MotiondeckError(
            "--mirror of joints needs --skeleton FILE: a rig file whose joints have mirror = 1 or -1, or a model (.xml)"
        )
    if file.suffix == ".toml":
        from hardware.rig.rig_file import load_rig

        return {joint.name: joint.mirror for joint in load_rig(file).joints if joint.mirror is not None}
    from sim.models.kinematic_tree import mirror_signs

    return mirror_signs(file)


def _print(known: dict[str, Any]) -> None:
    from controller.motion.clip import Decision

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
    for decision in known["decisions"]:
        print(Decision(**decision))
    for doubt in known["doubts"]:
        print(f"doubt: {doubt}")


def _fill_markers(file: Path, out: Path, as_json: bool) -> None:
    from controller.learning.centralized.reconstruction import fill_missing, gaps_of
    from controller.motion.formats.markers.c3d import read_c3d, with_points
    from controller.motion.formats.writing import csv_text

    if file.suffix.lower() != ".c3d":
        raise MotiondeckError(f"{file}: only markers (.c3d) have gaps; other recordings hold whole skeletons")
    if out.suffix.lower() not in (".c3d", ".csv"):
        raise MotiondeckError(f"{out}: markers are written as .c3d or .csv. Name the file so.")
    markers = read_c3d(file)
    with progress("gaps", len(gaps_of(markers.position))) as tick:
        position, gaps = fill_missing(markers.position, markers.rate, tick)
    if out.suffix.lower() == ".c3d":
        write_file(out, with_points(file, position))
    else:
        write_file(out, csv_text(markers.labels, position, markers.rate).encode())
    rows = _by_marker(markers, gaps)
    if as_json:
        print(json.dumps({"file": str(file), "written": str(out), "markers": rows}))
        return
    cells = []
    for row in rows:
        expected = "-" if row["expected_mm"] is None else f"{row['expected_mm']:.1f}"
        still = ", ".join(f"{first} to {end - 1}" for first, end in row["open"])
        counts = (str(row["gaps"]), str(row["frames"]), f"{row['longest_s']:.2f}")
        cells.append((row["marker"], *counts, expected, ", ".join(row["by"]) or "-", still or "-"))
    show_table(("marker", "gaps", "frames", "longest, s", "expected, mm", "filled by", "still open, frames"), cells)
    print(f"wrote {out} ({sum(gap.filled for gap in gaps)} of {len(gaps)} gaps filled)")


def _by_marker(markers: Markers, gaps: list[Gap]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for index in dict.fromkeys(gap.marker for gap in gaps):
        own = [gap for gap in gaps if gap.marker == index]
        known = [(gap.expected, gap.frames) for gap in own if gap.expected is not None]
        mean = sum(error * frames for error, frames in known) / max(1, sum(frames for _, frames in known))
        row: dict[str, Any] = {"marker": markers.labels[index], "gaps": len(own)}
        row |= {"frames": sum(gap.frames for gap in own)}
        row |= {"longest_s": max(gap.frames for gap in own) / markers.rate}
        row |= {"expected_mm": 1e3 * mean if known else None}
        row |= {"by": sorted({gap.by for gap in own if gap.by is not None})}
        rows.append(row | {"open": [[gap.first, gap.end] for gap in own if not gap.filled]})
    return rows
