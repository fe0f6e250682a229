"""`motiondeck evaluate`: measures the networks of a library or a recipe."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from motiondeck.cli.common.options import JobsOption, JsonOption, check_plot
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.learning.evaluation.evaluation import Evaluation
    from controller.learning.evaluation.tables import Table
    from controller.learning.measures.disturbance import Kind
    from motiondeck_base.jobs import Jobs

MEASURES = ("accuracy", "robustness", "stability", "transitions")


def evaluate(
    subject: Annotated[str, Argument(metavar="LIBRARY|RECIPE", help="A library, or a recipe (.toml).")],
    measure: Annotated[str, Argument(metavar="MEASURE", help="accuracy, robustness, stability or transitions.")],
    data: Annotated[Path, Option(metavar="DIR", help="The folder with the recordings.")],
    seeds: Annotated[str, Option(metavar="N|FIRST-LAST", help="Networks to train: how many, or which seeds.")] = "3",
    runs: Annotated[int, Option(metavar="N", min=1, max=100_000, help="Runs per motion and network.")] = 100,
    jobs: JobsOption = "-1",
    as_json: JsonOption = False,
    table: Annotated[Path | None, Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    plot: Annotated[Path | None, Option(metavar="FILE", help="Draw a plot (.png, .svg, .pdf).")] = None,
) -> None:
    """Measure accuracy, robustness and switches of networks.

    accuracy: training errors and self-tests of a recipe's networks. robustness: failures after a start from a
    disturbed state. stability: failures under noise in every step. transitions: switches between all pairs of
    motions, joined in four ways. For comparison a clip player is measured too.

    A recipe is trained with consecutive seeds; a library is measured as it is. The criterion is that of the
    self-test (the page "Measuring networks"). `motiondeck examples DIR` copies recipes.

    [bold]Example[/]

      motiondeck evaluate configs/libraries/thesis15.toml robustness --data recordings --seeds 3 --runs 100
    """
    from controller.learning.evaluation.evaluation import read_evaluation
    from motiondeck_base.jobs import Jobs

    UnknownNameError.check("measure", measure, MEASURES)
    where, chosen = Jobs.parse(jobs), _seeds(seeds)
    check_folder(table)
    check_plot(plot)
    from motiondeck.cli.common.tables import deliver
    from motiondeck.pictures.table_plots import draw_bars, draw_spread

    evaluation = read_evaluation(subject, data)
    draw = draw_bars
    if measure == "accuracy":
        result = accuracy(evaluation, chosen)
    elif measure == "transitions":
        result, draw = transitions(evaluation, chosen[0], where), draw_spread
    else:
        result = failures(evaluation, "stability" if measure == "stability" else "robustness", chosen, runs, where)
    deliver(result, csv_file=table, plot=plot, draw=draw, as_json=as_json)


def _seeds(text: str) -> range:
    """Consecutive seeds: a number of them from 0 on, or the first and the last."""
    first, dash, last = text.rpartition("-")
    numbers = [first, last] if dash else [last]
    if all(number.isdecimal() and int(number) < 2**31 for number in numbers):
        seeds = range(int(first or 0), int(last) + bool(dash))
        if 1 <= len(seeds) <= 1000:
            return seeds
    raise MotiondeckError(f"--seeds {text}: give a number from 1 to 1000, or the first and the last seed, as 400-404")


def accuracy(evaluation: Evaluation, seeds: range) -> Table:
    """Training errors and self-tests of a recipe's networks."""
    import numpy as np

    from controller.learning.evaluation.tables import training_table, with_clips
    from controller.learning.measures.self_test import self_test
    from controller.learning.trainers.clip import TRAINER, ClipRecipe

    with progress("training and testing", len(seeds)) as tick:
        errors, verdicts = evaluation.training_errors(seeds, tick)
    notes = ["NRMSE as Jaeger's nrmse.m computes it, not eq. 3.3 as printed"]
    table = training_table(f"{evaluation.name}: training", errors, verdicts, notes)
    player, judge, clips = evaluation.clips, evaluation.syllabus.judge, []
    clips.append(("clip player", sum(1e-3 * player[name].nbytes for name in player.motions), self_test(player, judge)))
    near = float(np.median([verdict.error_mm for tested in verdicts for verdict in tested.values()]))
    if np.isfinite(near):
        keyed = TRAINER.settle(ClipRecipe(tolerance_mm=near), evaluation.syllabus.lessons(), 0, judge).network
        clips.append(("clip of keys", 1e-3 * keyed.stored_bytes, self_test(keyed, judge)))
    return with_clips(table, [1e-3 * error.network.stored_bytes for error in errors], clips)


def failures(evaluation: Evaluation, kind: Kind, seeds: range, runs: int, jobs: Jobs) -> Table:
    """How often motions fail after a disturbance, without and with a guard."""
    from controller.learning.evaluation.failure_rates import sweep
    from controller.learning.evaluation.tables import failure_table, with_undisturbed_clips

    with progress("training", len(seeds)) as tick:
        networks = evaluation.networks(seeds, jobs, tick)
    with progress(kind, len(networks) * len(evaluation.syllabus.frames)) as tick:
        counts = sweep(kind, networks, evaluation.syllabus, runs, jobs=jobs, tick=tick)
    notes = [
        "low, high: 95 % intervals over motions and networks, whose runs are not independent. A one-shot fails where "
        "it is not played through once more.",
        "clip player: has no state to disturb, so nothing was measured.",
    ]
    if evaluation.noise_note:
        notes.append(evaluation.noise_note)
    if failing := evaluation.failing(networks):
        notes.append(
            f"{', '.join(failing)}: not right undisturbed either. The library was learned from other frames than are "
            "found in its recordings now, or badly: measure its recipe, or learn it anew."
        )
    table = failure_table(f"{evaluation.name}: {kind}, {len(networks)} x {runs} runs", counts, notes)
    return with_undisturbed_clips(table)


def transitions(evaluation: Evaluation, seed: int, jobs: Jobs) -> Table:
    """Switches between all ordered pairs of motions: the thesis's morphing beside the deck's switching."""
    from controller.learning.evaluation.tables import crossing_table
    from controller.learning.evaluation.transitions import all_crossings
    from controller.learning.fit import assemble
    from controller.learning.measures.self_test import self_test
    from controller.library.motion_library import load_library
    from motiondeck_base.jobs import ALONE

    syllabus = evaluation.syllabus
    if evaluation.library is not None:
        library = load_library(evaluation.library)
    else:
        with progress("training", 1) as tick:
            (subject,) = evaluation.networks([seed], ALONE, tick)
        verdicts = self_test(subject.network, syllabus.judge)
        library = assemble(evaluation.recipe, syllabus, subject.network, subject.seed, verdicts)
    with progress("transitions", len(syllabus.frames)) as tick:
        crossings = all_crossings(library, syllabus, jobs=jobs, tick=tick)
    notes = [
        "median / 95th percentile / maximum; velocity, acceleration, jerk: peaks over the larger of both motions' own",
        "clip player: the recordings themselves, joined as the deck joins motions",
        "bone_error: the largest change of a bone's length during the transition, as a share",
    ]
    if evaluation.library is None and library.info.seed != seed:
        notes.append(f"Networks with earlier seeds, from {seed} on, failed the self-test.")
    return crossing_table(f"{evaluation.name}: transitions, seed {library.info.seed}", crossings, syllabus.loops, notes)
