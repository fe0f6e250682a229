"""Figures 3 to 16 of Vakulenko et al. 2017 for any recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

from benchmarks import command
from benchmarks.centralized.plane_segments import body_features, plane_segments
from benchmarks.papers.hidden_joints import fill_hidden
from benchmarks.papers.segment_network import play_segment
from benchmarks.papers.vakulenko_plots import draw_coordinates, draw_hidden, draw_lines, draw_segment_errors
from controller.learning.centralized.model_choice import mean_absolute, mean_distance, relative_accuracy
from controller.learning.centralized.motion_training import CENTERS as CENTER_CHOICES
from controller.learning.centralized.motion_training import RATE, SATELLITES, score_models
from controller.learning.evaluation.tables import Table, Value
from controller.motion.anatomy import anatomy
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.motion.skeleton import Skeleton
from motiondeck.cli.common.tables import deliver
from motiondeck.pictures.figures import check_picture
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress

Draw = Callable[[Table, Path], None]

SEGMENT_SATELLITES = (16, 49, 100)
SHOWN_SATELLITES = (25, 50, 100)
CENTERS = 2

# The paper cuts CMU 86 trial 1 into eleven segments; for other recordings their number is found.
PAPER_SEGMENTS = {"86_01": 11}
SHOWN_SECONDS = 12.0
GAPS_S = (0.25, 0.5, 1.0)


def hands_and_feet(skeleton: Skeleton) -> list[int]:
    """The bones of feet and wrists, or the first four bones of a body without them."""
    body = anatomy(skeleton)
    found = [body.first(part, side) for part in ("foot", "hand") for side in ("right", "left")]
    bones = [bone for bone in found if bone is not None]
    return bones or list(range(min(4, len(skeleton))))


def main(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="An .amc, .bvh, .mat or .c3d file.")],
    measure: Annotated[
        Literal["segments", "models", "coordinates", "reconstruction"], typer.Argument(help="What to measure.")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Measure what centralized networks make of one recording, as Vakulenko et al. 2017 did.

    segments: errors of all joints in each segment with 16, 49 and 100 satellites (figures 14 to 16). models: Akaike's
    criterion over centers and satellites (figure 13). coordinates: feet and wrists over time with 25, 50 and 100
    satellites (figures 3 to 12, drawn with --plot). reconstruction: errors of joints that are hidden for a while and
    filled in from the others.

    Example:  python -m benchmarks vakulenko 86_01.amc coordinates --plot coordinates.png
    """
    check_folder(table)
    if plot is not None:
        check_picture(plot)
    if not recording.is_file():
        raise MotiondeckError(f"{recording}: there is no such file")
    measures = {"segments": segments, "models": models, "coordinates": coordinates, "reconstruction": reconstruction}
    result, draw = measures[measure](read_clip(recording))
    deliver(result, csv_file=table, plot=plot, draw=draw, as_json=as_json)


def segments(clip: Clip) -> tuple[Table, Draw]:
    """Errors of all joints in each segment (figures 14 to 16)."""
    places = 1e3 * clip.joints()
    names = ("root", *clip.skeleton.bones)
    cuts = plane_segments(body_features(clip), clip.rate, PAPER_SEGMENTS.get(clip.name))
    rows: list[dict[str, Value]] = []
    details: list[dict[str, Value]] = []
    with progress("networks", len(cuts) * len(SEGMENT_SATELLITES)) as tick:
        for number, (first, end) in enumerate(cuts, 1):
            part = places[first:end]
            row: dict[str, Value] = {"segment": str(number), "seconds": (end - first) / clip.rate}
            for satellites in SEGMENT_SATELLITES:
                played = play_segment(part, clip.rate, satellites)
                row[f"{satellites} satellites"] = mean_absolute(played, part)
                row[f"{satellites}, joint"] = mean_distance(played, part)
                tick()
                if satellites == SEGMENT_SATELLITES[1]:
                    apart, shares = np.abs(played - part).mean((0, 2)), relative_accuracy(played, part)
                    details += [
                        {"segment": number, "joint": name, "mm": float(mm), "relative": float(share)}
                        for name, mm, share in zip(names, apart, shares, strict=True)
                    ]
            rows.append(row)
    mean: dict[str, Value] = {"segment": "mean"}
    mean |= {name: float(np.mean([row[name] for row in rows])) for name in rows[0] if name != "segment"}  # pyright: ignore
    rows.append(mean)
    notes = [
        "mm, by satellites: mean absolute error of a coordinate, and mean distance of a joint",
        "details: each joint with 49 satellites, mm a coordinate and relative (eq. 26)",
    ]
    table = Table(
        f"{clip.name}: {len(cuts)} segments, {len(names)} joints, {CENTERS} centers, errors in mm",
        rows,
        tuple(f"{m} satellites" for m in SEGMENT_SATELLITES),
        notes,
        details,
    )

    def draw(table: Table, path: Path) -> None:

        draw_segment_errors(table, path)

    return table, draw


def models(clip: Clip) -> tuple[Table, Draw]:
    """Akaike's criterion over centers and satellites (figure 13), summed over the segments that are long enough."""
    bones = [0, *(bone + 1 for bone in hands_and_feet(clip.skeleton))]
    places = clip.joints()[:, bones].reshape(len(clip), -1)
    cuts = [cut for cut in plane_segments(body_features(clip), clip.rate) if _frames(cut, clip) > 1.2 * SATELLITES[-1]]
    if not cuts:
        raise MotiondeckError(
            f"{clip.source or clip.name}: no segment lasts longer than {1.2 * SATELLITES[-1] / RATE} s"
        )
    found: dict[tuple[int, int], list[float]] = {}
    with progress("segments", len(cuts)) as tick:
        for first, end in cuts:
            for one in score_models(places[first:end], clip.rate, loop=False, centers=(*CENTER_CHOICES, 4)):
                found.setdefault((one.centers, one.satellites), []).append(one.aicc)
            tick()
    # A choice that failed in one segment cannot be compared with those that learned them all.
    sums = {key: sum(values) for key, values in found.items() if len(values) == len(cuts)}
    if not sums:
        raise MotiondeckError(f"{clip.source or clip.name}: no choice of sizes suits all of its segments")
    best = min(sums, key=lambda key: sums[key])
    rows: list[dict[str, Value]] = [
        {"satellites": str(m)} | {f"{n} centers": sums.get((n, m)) for n in (*CENTER_CHOICES, 4)} for m in SATELLITES
    ]
    title = f"{clip.name}: AICc at {RATE:g} Hz, {len(cuts)} segments, {places.shape[1]} coordinates"
    notes = [f"lowest: {best[0]} centers, {best[1]} satellites. A higher rate favours more satellites."]
    table = Table(title, rows, tuple(name for name in rows[0] if name != "satellites"), notes)

    def draw(table: Table, path: Path) -> None:

        curves: dict[str, Any] = {}
        for name in table.draws:
            points = [(float(str(row["satellites"])), row[name]) for row in table.rows if row[name] is not None]
            if points:
                curves[name] = tuple(np.array(points, dtype=np.float64).T)
        # Far too many satellites score so high that the minimum would not be seen.
        least = min(float(y.min()) for _, y in curves.values())
        first = max(float(y[0]) for _, y in curves.values())
        room = 0.05 * (first - least)
        draw_lines(curves, ("satellites", "AICc"), table.title, path, ylim=(least - room, first + room))

    return table, draw


def coordinates(clip: Clip) -> tuple[Table, Draw]:
    """Feet and wrists over time as networks play them (figures 3 to 12): the first segments, a network each."""
    bones = hands_and_feet(clip.skeleton)
    names = [clip.skeleton.bones[bone] for bone in bones]
    places = 1e3 * clip.joints()[:, [bone + 1 for bone in bones]]
    cuts = plane_segments(body_features(clip), clip.rate)
    shown = [cut for cut in cuts if cut[1] <= max(SHOWN_SECONDS * clip.rate, cuts[0][1])]
    end = shown[-1][1]
    played = {}
    with progress("networks", len(SHOWN_SATELLITES)) as tick:
        for satellites in SHOWN_SATELLITES:
            parts = [play_segment(places[a:b], clip.rate, satellites) for a, b in shown]
            played[f"{satellites} satellites"] = np.concatenate(parts)
            tick()
    rows: list[dict[str, Value]] = [
        dict[str, Value](joint=name)
        | {f"{label} mm": mean_absolute(path[:, i : i + 1], places[:end, i : i + 1]) for label, path in played.items()}
        for i, name in enumerate(names)
    ]
    title = f"{clip.name}: the first {end / clip.rate:.1f} s, {len(shown)} segments, {CENTERS} centers"
    table = Table(title, rows, tuple(f"{label} mm" for label in played), ["mean absolute error of a coordinate"])

    def draw(table: Table, path: Path) -> None:

        draw_coordinates(places[:end], played, names, clip.rate, table.title, path)

    return table, draw


def reconstruction(clip: Clip) -> tuple[Table, Draw]:
    """How far off joints are that were hidden for a while and filled in from the others."""
    bones = hands_and_feet(clip.skeleton)
    places = 1e3 * clip.joints()
    cuts = plane_segments(body_features(clip), clip.rate)
    rows: list[dict[str, Value]] = []
    with progress("gaps", len(bones) * len(GAPS_S)) as tick:
        for bone in bones:
            for gap_s in GAPS_S:
                gap = round(gap_s * clip.rate)
                starts = [(a + b - gap) // 2 for a, b in cuts if b - a >= gap + clip.rate]
                if starts:
                    found = fill_hidden(places, bone + 1, starts, gap, clip.rate)
                    label = f"{clip.skeleton.bones[bone]}, {gap_s:g} s"
                    rows.append({"hidden": label} | {f"{name} mm": missed for name, missed in asdict(found).items()})
                tick()
    if not rows:
        raise MotiondeckError(f"{clip.source or clip.name}: too short to hide anything in it")
    notes = [
        "mean absolute error of a coordinate, one gap in the middle of each segment that is long enough",
        "cubic, line: over the gap from the joint's own path; mean: its mean place, seen from the middle of the others",
    ]
    columns = tuple(name for name in rows[0] if name != "hidden")
    return Table(f"{clip.name}: hidden joints", rows, columns, notes), draw_hidden


def _frames(cut: tuple[int, int], clip: Clip) -> float:
    """How many frames a segment has at the rate that models are compared at."""
    return (cut[1] - cut[0]) * RATE / clip.rate


if __name__ == "__main__":
    command.run("vakulenko", main)
