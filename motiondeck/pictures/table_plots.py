"""Draws measurements: bars with intervals, and the spread of single measurements by method."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motiondeck.pictures.figures import new_figure, save

if TYPE_CHECKING:
    from controller.learning.evaluation.tables import Table

_LABELS = {
    "mabs_readout": "MABS(W_out)",
    "nrmse_readout": "NRMSE(W_out)",
    "mabs_weights": "MABS(W)",
    "nrmse_weights": "NRMSE(W)",
    "velocity": "peak velocity",
    "acceleration": "peak acceleration",
    "jerk": "peak jerk",
}


def draw_bars(table: Table, path: Path) -> None:
    """One group of bars a row; percentages share a panel, whiskers where the table has low and high of them.

    MotiondeckError if the file cannot be written, as for the pictures below.
    """
    label = next(iter(table.rows[0]))
    rows = [row for row in table.rows if any(isinstance(row.get(name), int | float) for name in table.draws)]
    # Percentages below rows in another unit are not drawn among them.
    rows = [row for row in rows if not str(row[label]).endswith("%")]
    shares = all(name.endswith("%") for name in table.draws)
    panels = [table.draws] if shares else [(name,) for name in table.draws]
    width = max(6.0, 0.7 * len(rows) + 2.0) if shares else max(5.0, 0.5 * len(rows) + 1.5) * len(panels) * 0.6
    figure = new_figure(width, 4.8)
    figure.suptitle(table.title)
    for axes, names in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        thick = 0.8 / len(names)
        for i, name in enumerate(names):
            heights = np.array([np.nan if row[name] is None else float(row[name] or 0.0) for row in rows])
            at = np.arange(len(rows)) + (i - (len(names) - 1) / 2.0) * thick
            low, high = (f"{name.removesuffix(' %')} {end}" for end in ("low", "high"))
            ends = np.array([[float(row.get(end) or 0.0) for row in rows] for end in (low, high)])
            whiskers = np.abs(ends - heights) if low in rows[0] else None
            axes.bar(at, heights, thick, yerr=whiskers, capsize=2, label=name.removesuffix(" %"))
        axes.set_xticks(np.arange(len(rows)), [str(row[label]) for row in rows], rotation=45, ha="right")
        axes.set_ylim(bottom=0.0)
        if shares:
            axes.set_ylabel("failures, % (95 % intervals)" if any(key.endswith(" low") for key in rows[0]) else "%")
            axes.legend()
        else:
            axes.set_ylabel(_LABELS.get(names[0], names[0]))
    save(figure, path)


def draw_spread(table: Table, path: Path) -> None:
    """A panel for each measure: median, quarters and the range from 5 to 95 % of the details, by method."""
    methods = list(dict.fromkeys(str(row["method"]) for row in table.details))
    figure = new_figure(3.2 * len(table.draws), 4.5)
    figure.suptitle(table.title)
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(table.draws))), table.draws, strict=True):
        seen = [[float(row[name] or 0.0) for row in table.details if row["method"] == method] for method in methods]
        axes.boxplot(seen, whis=(5, 95), showfliers=False)
        axes.set_xticks(np.arange(1, len(methods) + 1), methods, rotation=30, ha="right")
        if name == "frames":
            axes.set_title("frames on the way")
            axes.set_ylim(bottom=0.0)
        else:
            axes.set_title(f"{_LABELS.get(name, name)}\n(both motions' own = 1)")
            axes.axhline(1.0, color="grey", linewidth=0.8)
            axes.set_yscale("log")
    save(figure, path)
