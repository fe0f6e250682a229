"""Table 1 of Vakulenko et al. 2017, the paper's column beside ours."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from benchmarks import command
from benchmarks.papers.table1_networks import PAPER, Entry, centralized_table1
from benchmarks.papers.vakulenko_plots import draw_table1
from controller.learning.evaluation.tables import Table, Value
from controller.learning.recipe import find_recording
from controller.motion.formats.reading import read_clip
from motiondeck.cli.common.tables import deliver
from motiondeck.pictures.figures import check_picture
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress


def main(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="The folder that holds 86/86_01.amc.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Compute all cells of table 1 on CMU 86 trial 1; takes some minutes."""
    check_folder(table)
    if plot is not None:
        check_picture(plot)
    clip = read_clip(find_recording(data, "86/86_01.amc"))
    entries = []
    with progress("networks", 4 * len(PAPER)) as tick:
        for entry in centralized_table1(clip):
            entries.append(entry)
            tick()
    deliver(table1(entries), csv_file=table, plot=plot, draw=draw_table1, as_json=as_json)


def table1(entries: list[Entry]) -> Table:
    """Table 1 of the paper: its figures, ours with its method, ours with learned satellites."""
    rows: list[dict[str, Value]] = [
        {
            "centers, satellites, segment": f"{e.centers}, {e.satellites}, {e.segment}",
            "paper": e.paper,
            "its method": e.fixed,
            "learned": e.learned,
            "its method mm": e.fixed_mm,
            "learned mm": e.learned_mm,
        }
        for e in entries
    ]
    won = sum(e.learned < e.paper for e in entries)
    notes = [
        "integral relative accuracy (eq. 26) of feet and wrists, and mean absolute error of a coordinate in mm",
        f"learned satellites are more accurate than the paper's figure in {won} of {len(entries)} cells",
    ]
    return Table("table 1, CMU 86 trial 1", rows, ("paper", "its method", "learned"), notes)


if __name__ == "__main__":
    command.run("vakulenko_table1", main)
