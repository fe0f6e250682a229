"""Costs by network size, recording length and motions (tables 4.10 to 4.13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.papers.cost_measurement import TrainingCost, costs, exponent, variants
from controller.learning.evaluation.evaluation import read_evaluation
from controller.learning.evaluation.tables import Table, Value
from motiondeck.cli.common.tables import deliver
from motiondeck.pictures.figures import check_picture, new_figure, save
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Exponents of the thesis's big-O bounds, with the other factors fixed: time and memory of training.
THESIS_EXPONENTS = {"N": (3.0, 2.0), "T": (3.0, 1.0), "P": (3.0, 1.0)}

LABELS = {
    "training_s": "training, s",
    "training_mb": "training, MB",
    "neurons": "neurons N",
    "frames": "frames",
    "motions": "motions P",
}


def main(
    recipe: Annotated[str, typer.Argument(metavar="RECIPE", help="A recipe (.toml), or a library for its recipe.")],
    data: Annotated[Path, typer.Option("--data", metavar="DIR", help="The folder with the recordings.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the networks.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the measurements as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Train a recipe with other sizes, shorter recordings and fewer motions, and print what each network costs.

    Processor time on one core, memory of arrays. Powers are the slopes of lines through the logarithms; beside those
    of reservoirs stand the bounds of Deliallisi 2017, tables 4.10 to 4.13.
    """
    check_folder(table)
    if plot is not None:
        check_picture(plot)
    evaluation = read_evaluation(recipe, data)
    with progress("training", len(list(variants(evaluation.recipe, evaluation.syllabus)))) as tick:
        found = costs(evaluation.recipe, evaluation.syllabus, seed, tick)
    notes = ["processor time on one core; powers are slopes of lines through logarithms, the thesis's are upper bounds"]
    result = cost_table(f"{evaluation.name}: cost", found, notes, bounds=not evaluation.noise_note)
    deliver(result, csv_file=table, plot=plot, draw=draw_costs, as_json=as_json)


def cost_table(title: str, found: Sequence[TrainingCost], notes: list[str], *, bounds: bool = True) -> Table:
    """What each network cost, the power with which the costs grow, and, with `bounds`, the thesis's bounds."""
    rows: list[dict[str, Value]] = []
    for cost in found:
        row: dict[str, Value] = {"network": f"{cost.neurons} neurons, {cost.frames} frames, {cost.motions} motions"}
        row |= {"training s": cost.training_s, "training MB": cost.training_mb}
        rows.append(row | {"step us": cost.step_us, "stored MB": cost.stored_mb})
    for varied, against in (("N", "neurons"), ("T", "frames"), ("P", "motions")):
        powers = [
            exponent(list(found), varied, against, what)
            for what in ("training_s", "training_mb", "step_us", "stored_mb")
        ]
        row = dict(zip(("training s", "training MB", "step us", "stored MB"), powers, strict=True))
        rows.append({"network": f"power of {varied}", **row})
        if not bounds:
            continue
        time, memory = THESIS_EXPONENTS[varied]
        bound: dict[str, Value] = {"training s": time, "training MB": memory, "step us": None, "stored MB": None}
        rows.append({"network": f"thesis's bound for {varied}", **bound})
    details = [asdict(cost) for cost in found]
    return Table(title, rows, ("training_s", "training_mb"), notes, details)


def draw_costs(table: Table, path: Path) -> None:
    """Draws a cost table into a file."""
    figure = cost_figure(table)
    figure.suptitle(table.title)
    save(figure, path)


def cost_figure(table: Table) -> Figure:
    """Costs against N, T and P on logarithmic axes: measured, fitted by a power, and the thesis's bound."""
    sizes = {"N": "neurons", "T": "frames", "P": "motions"}
    bounds = {"training_s": 0, "training_mb": 1}
    figure = new_figure(11.0, 3.4 * len(table.draws))
    grid = figure.subplots(len(table.draws), len(sizes), squeeze=False)
    # The recipe in full is one of those in which N was varied; shorter and smaller ones have its neurons.
    own = {row["neurons"] for row in table.details if row["varied"] != "N"}
    whole = [row for row in table.details if row["varied"] == "N" and row["neurons"] in own]
    for line, what in zip(grid, table.draws, strict=True):
        for axes, (varied, size) in zip(line, sizes.items(), strict=True):
            part = [row for row in table.details if row["varied"] == varied]
            part += whole if varied != "N" else []
            at = np.array([float(row[size] or 0.0) for row in part])
            cost = np.array([float(row[what] or 0.0) for row in part])
            axes.set(xlabel=LABELS[size] + (" T" if varied == "T" else ""), ylabel=LABELS[what])
            if len(set(at)) < 2:
                axes.text(0.5, 0.5, "not varied", ha="center", transform=axes.transAxes)
                continue
            at, cost = at[np.argsort(at)], cost[np.argsort(at)]
            power, level = np.polyfit(np.log(at), np.log(np.maximum(cost, 1e-9)), 1)
            bound = THESIS_EXPONENTS[varied][bounds[what]]
            axes.loglog(at, cost, "o", label="measured")
            axes.loglog(at, np.exp(level) * at**power, "-", label=f"fitted, power {power:.1f}")
            axes.loglog(at, cost[0] * (at / at[0]) ** bound, ":", label=f"thesis's bound, power {bound:.0f}")
            axes.set_xticks(at, [f"{value:g}" for value in at])
            axes.minorticks_off()
            axes.legend(fontsize=8)
    return figure


if __name__ == "__main__":
    command.run("training_cost", main)
