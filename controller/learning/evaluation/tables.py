"""Measurements as tables: rows of named values that are printed, written as CSV or JSON, and drawn."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from controller.learning.evaluation.failure_rates import Count, grouped, wilson
from controller.learning.evaluation.transitions import MeasuredTransition
from controller.learning.measures.self_test import MotionVerdict
from controller.learning.trainers.trainer import TrainingError

Value = str | int | float | None


@dataclass(frozen=True)
class Table:
    """A table."""

    title: str
    rows: list[dict[str, Value]]  # each a value by column; all have the same columns
    draws: tuple[str, ...]  # the columns that a plot shows
    notes: list[str] = field(default_factory=list)  # below it, one line each
    details: list[dict[str, Value]] = field(default_factory=list)  # measurements that the rows summarise


def failure_table(title: str, counts: Sequence[Count], notes: list[str]) -> Table:
    """Failure rates by motion, then over all loops and over everything; percentages with 95 % intervals."""
    # The runs of one motion of one network are a group: they are not independent of each other.
    motions = list(dict.fromkeys(count.motion for count in counts))
    groups = {motion: [count for count in counts if count.motion == motion] for motion in motions}
    sums = {"all loops": [count for count in counts if count.loop], "everything": list(counts)}
    kinds = ("intrinsic",) if any(count.guarded is None for count in counts) else ("intrinsic", "guarded")
    again = any(count.drawn != count.seed for count in counts)
    rows: list[dict[str, Value]] = []
    for name, group in (groups | sums).items():
        runs = sum(count.runs for count in group)
        row: dict[str, Value] = {"motion": name, "runs": runs}
        for kind in kinds:
            by_group = [getattr(count, kind) for count in group]
            failed = sum(by_group)
            low, high = grouped(by_group, [count.runs for count in group])
            row[f"{kind} %"] = 100.0 * failed / max(1, runs)
            row[f"{kind} low"], row[f"{kind} high"] = 100.0 * low, 100.0 * high
        by_seed: dict[int, list[Count]] = {}
        for count in group:
            by_seed.setdefault(count.seed, []).append(count)
        row["intrinsic by seed"] = " ".join(str(sum(c.intrinsic for c in part)) for part in by_seed.values())
        if again:
            row["drawn with seed"] = " ".join(str(part[0].drawn) for part in by_seed.values())
        reasons = (count.reason for count in group if count.reason and name in groups)
        row["why the first failed"] = next(reasons, "")
        rows.append(row)
    return Table(title, rows, tuple(f"{kind} %" for kind in kinds), notes)


def with_undisturbed_clips(table: Table) -> Table:
    """A failure table with a row for the clip player, which has no state that noise could reach."""
    row: dict[str, Value] = dict.fromkeys(table.rows[0], None)
    none = dict.fromkeys(table.draws, 0.0)
    blank = {name: "" for name, value in table.rows[0].items() if isinstance(value, str)}
    return replace(table, rows=[*table.rows, row | blank | none | {"motion": "clip player"}])


def crossing_table(
    title: str, crossings: Sequence[MeasuredTransition], loops: dict[str, bool], notes: list[str]
) -> Table:
    """Median, 95th percentile and maximum of each measure by method and kind of target; names the failed ones."""
    rows: list[dict[str, Value]] = []
    for method in dict.fromkeys(crossing.method for crossing in crossings):
        for kind, loop in (("loops", True), ("once", False)):
            group = [c for c in crossings if c.method == method and loops[c.target] == loop]
            if not group:
                continue
            failed = sum(c.failed for c in group)
            low, high = wilson(failed, len(group))
            row: dict[str, Value] = {"to": f"{kind}, {method}", "pairs": len(group)}
            row["failed %"] = 100.0 * failed / len(group)
            row["failed low"], row["failed high"] = 100.0 * low, 100.0 * high
            for name in ("frames", "velocity", "acceleration", "jerk", "bone_error"):
                values = np.percentile([getattr(c, name) for c in group], [50, 95, 100])
                row[name] = " / ".join(f"{value:.0f}" if name == "frames" else f"{value:.2f}" for value in values)
            rows.append(row)
    details = [asdict(crossing) for crossing in crossings]
    failed = [f"{c.method}, {c.source} to {c.target}: {c.reason}" for c in crossings if c.failed]
    return Table(title, rows, ("frames", "velocity", "acceleration", "jerk"), notes + failed, details)


def training_table(
    title: str, errors: Sequence[TrainingError], verdicts: Sequence[dict[str, MotionVerdict]], notes: list[str]
) -> Table:
    """Training errors and self-tests by seed, and the mean of the errors."""
    names = ["mabs_readout", "nrmse_readout", "mabs_weights", "nrmse_weights"]
    shown = [name for name in names if getattr(errors[0], name) is not None]
    rows: list[dict[str, Value]] = []
    for error, tested in zip(errors, verdicts, strict=True):
        measured = {name: getattr(error, name) for name in shown}
        rows.append({"network": f"seed {error.seed}", **measured, **_tested(tested)})
    blank: dict[str, Value] = {"self-test": "", "free run mm": None, "failing": ""}
    mean: dict[str, Value] = {name: float(np.mean([getattr(error, name) for error in errors])) for name in shown}
    rows.append({"network": "mean", **mean, **blank})
    return Table(title, rows, tuple(shown), notes)


def with_clips(
    table: Table, stored_kb: Sequence[float], clips: Sequence[tuple[str, float, dict[str, MotionVerdict]]]
) -> Table:
    """A training table with the size of each network, kB, and a row for each clip: name, kB and self-test."""
    sizes = [*stored_kb, *[None] * len(table.rows)]
    rows = [row | {"kB": size} for row, size in zip(table.rows, sizes, strict=False)]
    blank: dict[str, Value] = dict.fromkeys(rows[0], None)
    more = [blank | {"network": name, "kB": size, **_tested(verdicts)} for name, size, verdicts in clips]
    return replace(table, rows=rows + more)


def _tested(verdicts: dict[str, MotionVerdict]) -> dict[str, Value]:
    failing = [name for name, verdict in verdicts.items() if not verdict.passed]
    apart = [verdict.error_mm for verdict in verdicts.values()]
    return {
        "self-test": f"{len(verdicts) - len(failing)} of {len(verdicts)}",
        "free run mm": float(np.median(apart)) if np.isfinite(apart).all() and apart else None,
        "failing": ", ".join(failing),
    }
