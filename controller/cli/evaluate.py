"""`motiondeck evaluate`: the papers' tables for any library or recipe, with the thesis's figures beside ours."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import typer

from controller.cli.common.progress import progress

if TYPE_CHECKING:
    from controller.evaluation.sweep import Subject
    from controller.evaluation.tables import Table, Value
    from controller.training.fit import TrainingSet
    from controller.training.recipe import LibraryRecipe

What = Literal["accuracy", "robustness", "stability", "transitions", "cost"]
Measure = Literal[
    "accuracy", "robustness", "stability", "transitions", "cost", "segments", "models", "coordinates", "reconstruction"
]


def evaluate(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="SUBJECT", help="A recipe (.toml), a library, or a recording; or centralized-table1 with --paper."
        ),
    ],
    what: Annotated[
        Measure | None,
        typer.Argument(help="What to measure; the last four are of recordings.", show_default=False),
    ] = None,
    data: Annotated[Path | None, typer.Option("--data", metavar="DIR", help="The folder with the recordings.")] = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, max=1000, help="How many networks of a recipe.")] = 3,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0, help="The first of these networks' seeds.")] = 0,
    runs: Annotated[int, typer.Option("--runs", min=1, max=100_000, help="Of each motion of each network.")] = 100,
    paper: Annotated[
        bool, typer.Option("--paper", help="The thesis's layout, and its two noise channels as targets.")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", help="Processes that share the work; -1 for one a core.")] = -1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
    table: Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the table as CSV.")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Measure how well networks learn, whether they survive disturbances, how they switch, and what they cost.

    A recipe is trained anew with the seeds 0, 1, 2, ... (or from --first-seed on, to try some that it was not made
    with); a library is taken as it is. Runs are judged by the
    self-test's criterion (docs/evaluation.md).

    Of a recording: how well centralized networks of 16, 49 and 100 satellites say its segments (segments), what
    Akaike's criterion makes of centers and satellites (models), feet and wrists over time as networks of 25, 50 and 100
    satellites say them (coordinates, drawn with --plot), and how well missing joints are filled in (reconstruction).

    [bold]Examples[/]

      motiondeck evaluate configs/libraries/paper/esn-4.1.toml robustness --data recordings --seeds 3 --runs 100

      motiondeck evaluate --paper centralized-table1 --data recordings

      motiondeck evaluate 86_01.amc coordinates --plot coordinates.png
    """
    from controller.cli.evaluate_recording import TABLE1, is_recording, measure_recording
    from motiondeck_base.errors import MotiondeckError

    of_recording = is_recording(subject) or subject == TABLE1
    if data is None and (subject == TABLE1 or not of_recording):
        raise MotiondeckError("--data is missing: the folder that holds the recordings")
    if data is not None and not data.is_dir():
        raise MotiondeckError(f"{data}: there is no such folder; --data is the folder that holds the recordings")
    for file in (table, plot):
        if file is not None and not file.absolute().parent.is_dir():
            raise MotiondeckError(f"{file.parent}: there is no such folder to write {file.name} to")
    from controller.cli.pictures.table_plots import drawing

    draw = drawing() if plot is not None else None
    if of_recording:
        result, drawn = measure_recording(subject, what, data)
        _deliver(result, table, plot, drawn, as_json=as_json)
        return
    if what is None or what not in get_args(What):
        raise MotiondeckError(f"of a library or a recipe is measured: {', '.join(get_args(What))}")
    assert data is not None
    task = _Task.of(subject, data, range(first_seed, first_seed + seeds), runs, paper, jobs)
    measures = {
        "accuracy": accuracy,
        "robustness": failures,
        "stability": failures,
        "transitions": transitions,
        "cost": cost,
    }
    _deliver(measures[what](task, what), table, plot, draw, as_json=as_json)


def _deliver(
    result: Table, table: Path | None, plot: Path | None, draw: Callable[[Table, Path], None] | None, *, as_json: bool
) -> None:
    """Writes, draws and prints a table."""
    if table is not None:
        _write_csv(result, table)
    if plot is not None and draw is not None:
        draw(result, plot)
    if as_json:
        print(json.dumps(asdict(result)))
    else:
        _print(result)


@dataclass(frozen=True)
class _Task:
    """What is to be measured.

    Attributes:
        name: of the recipe or library.
        recipe: of what is measured; a library holds its own.
        library: the file, or None for a recipe.
        syllabus: the frames to learn or to judge by.
        data, seeds, runs, paper, jobs: as the user gave them.
    """

    name: str
    recipe: LibraryRecipe
    library: Path | None
    syllabus: TrainingSet
    data: Path
    seeds: list[int]
    runs: int
    paper: bool
    jobs: int

    @classmethod
    def of(cls, subject: str, data: Path, seeds: range, runs: int, paper: bool, jobs: int) -> _Task:
        """Reads the recipe, from its own file or out of a library, and the recordings."""
        from controller.library.motion_library import load_library
        from controller.training.fit import prepare
        from controller.training.recipe import read_recipe, recipe_of
        from motiondeck_base.shipped import find

        if subject.endswith(".toml"):
            path, library = Path(subject), None
            recipe = read_recipe(path)
        else:
            path = library = find("library", subject, ".safetensors")
            recipe = recipe_of(load_library(path).info.recipe, path)
        return cls(path.stem, recipe, library, prepare(recipe, data), data, list(seeds), runs, paper, jobs)

    @property
    def centralized(self) -> bool:
        """Whether it is about a centralized network."""
        from controller.training.centralized.centralized_training import CentralizedRecipe

        return isinstance(self.recipe.network, CentralizedRecipe)

    def subjects(self) -> list[Subject]:
        """The networks: the library's own, or one a seed."""
        from controller.evaluation.sweep import Subject, train_subjects
        from controller.library.motion_library import load_library

        if self.library is not None:
            loaded = load_library(self.library)
            return [Subject(loaded.info.seed, loaded.info.seed, loaded.network)]
        with progress("training", len(self.seeds)) as tick:
            return train_subjects(self.recipe, self.syllabus, self.seeds, self.jobs, tick)


def accuracy(task: _Task, what: str) -> Table:
    """How well the networks of a recipe learn, in the measures of the thesis."""
    from benchmarks.papers.thesis import THESIS
    from controller.evaluation.tables import training_table
    from controller.evaluation.training_error import training_error
    from controller.measures.self_test import Judge, self_test
    from motiondeck_base.errors import MotiondeckError

    if task.library is not None:
        raise MotiondeckError(f"{task.library}: accuracy is measured in training; give the recipe (.toml) instead")
    with progress("training and testing", len(task.seeds)) as tick:
        plan, errors, verdicts = task.syllabus, [], []
        judge = Judge(plan.encoding, plan.frames, plan.loops, holds=not task.recipe.as_recorded)
        for seed in task.seeds:
            errors.append(training_error(task.recipe, plan, seed, task.data if task.paper else None))
            verdicts.append(self_test(errors[-1].network, judge))
            tick()
    notes = ["NRMSE is Jaeger's nrmse.m, not eq. 3.3 as printed, which is always about 1 (docs/evaluation.md)."]
    if task.paper:
        notes.append(
            "The readouts of conceptor networks are taught channels 5 and 17, which are noise, as in the thesis."
        )
    known = THESIS[task.name].accuracy if task.paper and task.name in THESIS else {}
    return training_table(f"{task.name}: training", errors, verdicts, known, notes)


def failures(task: _Task, what: Literal["robustness", "stability"]) -> Table:
    """How often motions fail after a disturbance, without and with a guard."""
    from benchmarks.papers.thesis import THESIS
    from controller.evaluation.sweep import sweep
    from controller.evaluation.tables import failure_table
    from controller.training.reservoirs.conceptor_training import ConceptorRecipe

    known: dict[str, float] = {}
    place = ""
    if task.name in THESIS:
        figures, second = THESIS[task.name], what == "stability"
        known = figures.stability if second else figures.robustness
        place = f"table {figures.tables[second]}, " if task.paper else ""
    names = list(task.syllabus.frames)
    motions = [name for name in known if name in names] if task.paper and known else names
    subjects = task.subjects()
    with progress(what, len(subjects) * len(motions)) as tick:
        counts = sweep(
            what,
            subjects,
            task.syllabus,
            task.runs,
            motions=motions,
            holds=not task.recipe.as_recorded,
            guarded=not task.paper,
            jobs=task.jobs,
            tick=tick,
        )
    notes = ["low, high: 95 % Wilson intervals. Motions that happen once fail where they do not go through once more."]
    if task.centralized:
        notes.append("What is disturbed are both coordinates of every center; satellites follow from them.")
    elif task.library is not None and isinstance(task.recipe.network, ConceptorRecipe):
        notes.append(
            "A library keeps only the directions its conceptors use: noise on a state counts as far as it lies in them."
        )
    return failure_table(f"{place}{task.name}: {what}, {len(subjects)} x {task.runs} runs", counts, known, notes)


def transitions(task: _Task, what: str) -> Table:
    """All ordered pairs of motions: the thesis's morphing and the deck's switching side by side."""
    from controller.evaluation.sweep import train_subjects
    from controller.evaluation.tables import crossing_table
    from controller.evaluation.transitions import all_crossings
    from controller.library.motion_library import load_library
    from controller.measures.self_test import Judge, self_test
    from controller.training.fit import assemble

    holds = not task.recipe.as_recorded
    if task.library is not None:
        library = load_library(task.library)
    else:
        plan = task.syllabus
        (subject,) = train_subjects(task.recipe, plan, task.seeds[:1])
        judge = Judge(plan.encoding, plan.frames, plan.loops, holds=holds)
        verdicts = self_test(subject.network, judge)
        library = assemble(task.recipe, plan, subject.network, subject.drawn, verdicts)
    with progress("transitions", len(task.syllabus.frames)) as tick:
        crossings = all_crossings(library, task.syllabus, holds=holds, jobs=task.jobs, tick=tick)
    notes = [
        "median / 95th percentile / maximum; velocity, acceleration, jerk: peaks over the larger of both motions' own",
        "bone_error: the largest change of a bone's length on the way, as a share",
    ]
    if task.library is None and library.info.seed != task.seeds[0]:
        notes.append(f"Networks with earlier seeds, from {task.seeds[0]} on, failed the self-test.")
    return crossing_table(f"{task.name}: transitions, seed {library.info.seed}", crossings, task.syllabus.loops, notes)


def cost(task: _Task, what: str) -> Table:
    """What training and playing cost against reservoir size, recording length and number of motions."""
    from benchmarks.papers.training_cost import costs, variants
    from controller.evaluation.tables import cost_table

    with progress("training", len(list(variants(task.recipe, task.syllabus)))) as tick:
        found = costs(task.recipe, task.syllabus, task.seeds[0], tick)
    notes = [
        "processor time on one core; powers are slopes of a line through logarithms, the thesis's are upper bounds"
    ]
    return cost_table(f"{task.name}: cost", found, notes, bounds=not task.centralized)


def _write_csv(result: Table, path: Path) -> None:
    from motiondeck_base.errors import MotiondeckError

    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            rows = result.details or result.rows
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise MotiondeckError(f"{path}: cannot be written ({error.strerror or error})") from None


def _print(result: Table) -> None:
    """The table, on its side where that is narrower; an interval stands behind the value it belongs to."""
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable

    columns = [name for name in result.rows[0] if not name.endswith((" low", " high", " failed"))]
    lines = [columns, *([_words(row, name) for name in columns] for row in result.rows)]
    if len(result.rows) < len(columns):
        lines = [list(line) for line in zip(*lines, strict=True)]
    shown = RichTable(title=result.title, box=box.SIMPLE_HEAD)
    for i, heading in enumerate(lines[0]):
        shown.add_column(heading, justify="right" if i else "left")
    for line in lines[1:]:
        shown.add_row(*line)
    console = Console()
    console.print(shown)
    for note in result.notes:
        console.print(note, style="dim", highlight=False)


def _words(row: dict[str, Value], column: str) -> str:
    """A value as it is read: percentages with a digit and their interval, other numbers with four."""
    value = row[column]
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    if column.endswith(("%", "mm")) or str(row[next(iter(row))]).endswith("%"):
        name = column.removesuffix(" %")
        low, high = row.get(f"{name} low"), row.get(f"{name} high")
        return f"{value:.1f}" + (f" ({low:.1f}-{high:.1f})" if low is not None else "")
    return f"{value:.4f}" if abs(value) < 1.0 else f"{value:.4g}"
