"""`motiondeck clip fill`: fills in the markers that are missing from a recording for a while."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.clip.commands import app
from motiondeck.cli.common.options import JsonOption, check_other
from motiondeck_base.files import check_folder

if TYPE_CHECKING:
    from controller.learning.centralized.reconstruction import Gap
    from controller.motion.formats.markers.tracks import Markers


@app.command("fill")
def fill(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of markers: .c3d.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="OUT.c3d, the same file with its gaps filled, or OUT.csv."),
    ],
    as_json: JsonOption = False,
) -> None:
    """Fill in markers that were lost for a while, from those that were seen.

    A centralized network learns the other markers around each gap; the lost one follows their frequencies and joins
    its path on both sides. A line or a cubic along its own path counts too, by how well it does on hidden stretches of
    the same length; so is the expected error of each marker measured, which the table shows. A gap stays open, and is
    named, if fewer than three other markers were seen throughout it or its own marker was hardly seen around it.

    In a .c3d everything else stays as it is; filled points have the residual 0. A .csv holds time in s and x, y, z of
    every marker in m, in the file's own axes; what is still missing is left empty.

    Example:  motiondeck clip fill dance.c3d --out filled.c3d
    """
    from controller.learning.centralized.reconstruction import fill_missing, gaps_of
    from controller.motion.formats.markers.c3d import read_c3d
    from controller.motion.formats.markers.c3d_writing import with_points
    from controller.motion.formats.writing import markers_csv
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.files import write_file
    from motiondeck_base.progress import progress

    if file.suffix.lower() != ".c3d":
        raise MotiondeckError(f"{file}: only markers (.c3d) can be missing; other recordings hold whole skeletons")
    if out.suffix.lower() not in (".c3d", ".csv"):
        raise MotiondeckError(f"{out}: markers are written as .c3d or .csv. Name the file so.")
    check_other(file, out)
    check_folder(out)
    markers = read_c3d(file)
    with progress("gaps", len(gaps_of(markers.position))) as tick:
        position, gaps = fill_missing(markers.position, markers.rate, tick)
    if out.suffix.lower() == ".c3d":
        write_file(out, with_points(file, position))
    else:
        write_file(out, markers_csv(markers, position).encode())
    rows = _by_marker(markers, gaps)
    if as_json:
        print(json.dumps({"file": str(file), "written": str(out), "markers": rows}))
        return
    _print(rows)
    print(f"wrote {out} ({sum(gap.filled for gap in gaps)} of {len(gaps)} gaps filled)")


def _by_marker(markers: Markers, gaps: list[Gap]) -> list[dict[str, Any]]:
    """What was missing of each marker and what became of it."""
    rows = []
    for index in dict.fromkeys(gap.marker for gap in gaps):
        own = [gap for gap in gaps if gap.marker == index]
        rows.append(
            {
                "marker": markers.labels[index],
                "gaps": len(own),
                "frames": sum(gap.frames for gap in own),
                "longest_s": max(gap.frames for gap in own) / markers.rate,
                "expected_mm": _mean_mm(own),
                "by": sorted({gap.by for gap in own if gap.by is not None}),
                "open": [[gap.first, gap.end] for gap in own if not gap.filled],
            }
        )
    return rows


def _mean_mm(gaps: list[Gap]) -> float | None:
    """The error expected of gaps, each frame counting alike."""
    known = [(gap.expected, gap.frames) for gap in gaps if gap.expected is not None]
    if not known:
        return None
    return 1e3 * sum(expected * frames for expected, frames in known) / sum(frames for _, frames in known)


def _print(rows: list[dict[str, Any]]) -> None:
    """One line a marker with gaps."""
    from motiondeck.cli.common.tables import show_table

    cells = []
    for row in rows:
        expected = "-" if row["expected_mm"] is None else f"{row['expected_mm']:.1f}"
        still = ", ".join(f"{first} to {end - 1}" for first, end in row["open"])
        cells.append(
            (
                row["marker"],
                str(row["gaps"]),
                str(row["frames"]),
                f"{row['longest_s']:.2f}",
                expected,
                ", ".join(row["by"]) or "-",
                still or "-",
            )
        )
    show_table(("marker", "gaps", "frames", "longest, s", "expected, mm", "filled by", "still open, frames"), cells)
