"""Training errors and failure rates beside the thesis's (tables 4.1 to 4.9)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from benchmarks import command
from benchmarks.papers.thesis_figures import THESIS, noisy_targets
from controller.learning.evaluation.evaluation import Evaluation, read_evaluation
from controller.learning.evaluation.failure_rates import sweep
from controller.learning.evaluation.tables import Table, Value, failure_table, training_table
from controller.learning.measures.disturbance import Kind
from controller.learning.recipe import find_recording
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe, load_reservoir
from controller.learning.trainers.trainer import TrainingError, mabs, nrmse
from controller.networks.ridge import ridge
from motiondeck.cli.common.options import JobsOption
from motiondeck.cli.common.tables import deliver
from motiondeck.pictures.figures import check_picture
from motiondeck.pictures.table_plots import draw_bars
from motiondeck_base.files import check_folder
from motiondeck_base.jobs import Jobs
from motiondeck_base.progress import progress


def main(
    recipe: Annotated[str, typer.Argument(metavar="RECIPE", help="Such as configs/libraries/paper/esn-4.1.toml.")],
    measure: Annotated[Literal["accuracy", "robustness", "stability"], typer.Argument(help="What to measure.")],
    data: Annotated[Path, typer.Option("--data", metavar="DIR", help="The folder with Jaeger's recordings.")],
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=1000, help="Networks to train.")] = 3,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0, help="Seed of the first network.")] = 0,
    runs: Annotated[int, typer.Option("--runs", min=1, max=100_000, help="Runs per motion and network.")] = 100,
    jobs: JobsOption = "-1",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Measure a recipe as the thesis did, with its figures beside ours.

    The thesis's motions and layout, no guard; the readouts of conceptor networks are taught the two noise channels.

    Example:  python -m benchmarks thesis configs/libraries/paper/esn-4.1.toml robustness --data recordings
    """
    check_folder(table)
    if plot is not None:
        check_picture(plot)
    evaluation = read_evaluation(recipe, data)
    chosen = range(first_seed, first_seed + seeds)
    if measure == "accuracy":
        result = accuracy(evaluation, chosen, data)
    else:
        result = failures(evaluation, measure, chosen, runs, Jobs.parse(jobs))
    deliver(result, csv_file=table, plot=plot, draw=draw_bars, as_json=as_json)


def accuracy(evaluation: Evaluation, seeds: range, data: Path) -> Table:
    """Training errors (tables 4.1, 4.3, 4.5) and self-tests, with the thesis's errors and how far ours are off."""
    with progress("training and testing", len(seeds)) as tick:
        errors, verdicts = evaluation.training_errors(seeds, tick)
    errors = with_noisy_readouts(evaluation, errors, data)
    notes = [
        "NRMSE as Jaeger's nrmse.m computes it, not eq. 3.3 as printed (docs/evaluation.md)",
        "readouts of conceptor networks are taught channels 5 and 17, which are noise, as in the thesis",
    ]
    table = training_table(f"{evaluation.name}: training", errors, verdicts, notes)
    return with_training_figures(table, evaluation.name)


def with_noisy_readouts(evaluation: Evaluation, errors: list[TrainingError], data: Path) -> list[TrainingError]:
    """The errors of conceptor networks whose readout learns what it did in the thesis: two channels are noise."""
    recipe, motions = evaluation.recipe.network, evaluation.syllabus.lessons().motions
    if not isinstance(recipe, ConceptorRecipe):
        return errors
    files = [find_recording(data, motion.file) for motion in evaluation.recipe.motions]
    targets, found = np.concatenate(noisy_targets(motions, files)), []
    for one in errors:
        states = np.concatenate(load_reservoir(motions, recipe, one.seed).states)
        readout = ridge(states, targets, recipe.ridge)
        found.append(replace(one, mabs_readout=mabs(readout), nrmse_readout=nrmse(states @ readout.T, targets)))
    return found


def failures(evaluation: Evaluation, kind: Kind, seeds: range, runs: int, jobs: Jobs) -> Table:
    """Failure rates of the thesis's motions (tables 4.2, 4.4, 4.6 and 4.7 to 4.9), all motions where it has none."""
    names = list(evaluation.syllabus.frames)
    motions = [name for name in known_failures(evaluation.name, kind) if name in names] or names
    with progress("training", len(seeds)) as tick:
        networks = evaluation.networks(seeds, jobs, tick)
    with progress(kind, len(networks) * len(motions)) as tick:
        counts = sweep(
            kind,
            networks,
            evaluation.syllabus,
            runs,
            motions=motions,
            guarded=False,
            jobs=jobs,
            tick=tick,
        )
    notes = ["low, high: 95 % Wilson intervals. A one-shot fails where it is not gone through once more."]
    table = failure_table(f"{evaluation.name}: {kind}, {len(networks)} x {runs} runs", counts, notes)
    return with_failure_figures(table, evaluation.name, kind)


def known_failures(name: str, kind: Kind) -> dict[str, float]:
    """The thesis's failure rates by motion, as shares; empty where it has no such network."""
    if name not in THESIS:
        return {}
    return THESIS[name].stability if kind == "stability" else THESIS[name].robustness


def with_training_figures(table: Table, name: str) -> Table:
    """The table with two more rows: the thesis's errors, and how far ours are off, %."""
    thesis = THESIS[name].accuracy if name in THESIS else {}
    if not thesis:
        return table
    blank: dict[str, Value] = {"self-test": "", "free run mm": None, "failing": ""}
    mean = table.rows[-1]
    off = {one: 100.0 * (float(mean[one] or 0.0) / thesis[one] - 1.0) for one in table.draws if one in thesis}
    rows = [
        *table.rows,
        {"network": "thesis", **{one: thesis.get(one) for one in table.draws}, **blank},
        {"network": "off by %", **{one: off.get(one) for one in table.draws}, **blank},
    ]
    return Table(table.title, rows, table.draws, table.notes)


def with_failure_figures(table: Table, name: str, kind: Kind) -> Table:
    """The table in the thesis's layout: its rates beside ours, and one average in place of our sums."""
    known = known_failures(name, kind)
    if not known:
        return table
    average = float(np.mean([known[str(row["motion"])] for row in table.rows if row["motion"] in known]))
    rows: list[dict[str, Value]] = []
    for row in table.rows:
        if row["motion"] == "all loops":
            continue
        if row["motion"] == "everything":
            row = row | {"motion": "average"}
        share = known.get(str(row["motion"]), average)
        rows.append({"motion": row["motion"], "runs": row["runs"], "thesis %": 100.0 * share} | row)
    number = THESIS[name].tables[kind == "stability"]
    return Table(f"table {number}, {table.title}", rows, ("thesis %", *table.draws), table.notes)


if __name__ == "__main__":
    command.run("thesis", main)
