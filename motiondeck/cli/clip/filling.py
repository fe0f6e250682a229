"""`motiondeck clip convert --fill`: fills gaps of markers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from controller.learning.centralized.reconstruction import Gap
    from controller.motion.markers import Markers


def fill(file: Path, out: Path, as_json: bool) -> None:
    """Writes a recording of markers with its gaps filled, and reports each marker's gaps and expected error.

    Raises:
        MotiondeckError: if the recording holds no markers, or the file cannot be written.
    """
    from controller.learning.centralized.reconstruction import fill_missing, gaps_of
    from controller.motion.formats.markers.c3d import read_c3d, with_points
    from controller.motion.formats.writing import markers_csv
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.files import write_file
    from motiondeck_base.progress import progress

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
        write_file(out, markers_csv(markers, position).encode())
    rows = _by_marker(markers, gaps)
    if as_json:
        print(json.dumps({"file": str(file), "written": str(out), "markers": rows}))
        return
    _print(rows)
    print(f"wrote {out} ({sum(gap.filled for gap in gaps)} of {len(gaps)} gaps filled)")


def _by_marker(markers: Markers, gaps: list[Gap]) -> list[dict[str, Any]]:
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
    known = [(gap.expected, gap.frames) for gap in gaps if gap.expected is not None]
    if not known:
        return None
    return 1e3 * sum(expected * frames for expected, frames in known) / sum(frames for _, frames in known)


def _print(rows: list[dict[str, Any]]) -> None:
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
