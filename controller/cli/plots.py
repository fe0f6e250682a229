"""Tables as bar charts; matplotlib is an extra and is only asked for when a plot is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from controller.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.evaluation.tables import Table


def drawing() -> Callable[[Table, Path], None]:
    """The function that draws a table into a file.

    Raises:
        MotiondeckError: if matplotlib is not installed.
    """
    try:
        import matplotlib
    except ImportError:
        raise MotiondeckError("--plot needs matplotlib; install it with: pip install 'motiondeck[plot]'") from None
    matplotlib.use("Agg")
    return _draw


def _draw(table: Table, path: Path) -> None:
    """One group of bars a row, one bar a drawn column; whiskers where the table has low and high of it."""
    import numpy as np
    from matplotlib.figure import Figure

    rows = [row for row in table.rows if any(isinstance(row.get(name), int | float) for name in table.draws)]
    label = next(iter(table.rows[0]))
    figure = Figure(figsize=(max(6.0, 0.8 * len(rows) + 2.0), 4.5), layout="constrained")
    axes = figure.add_subplot()
    width = 0.8 / len(table.draws)
    for i, name in enumerate(table.draws):
        heights = np.array([float(row[name] or 0.0) for row in rows])
        at = np.arange(len(rows)) + (i - (len(table.draws) - 1) / 2.0) * width
        low, high = (f"{name.removesuffix(' %')} {end}" for end in ("low", "high"))
        whiskers = None
        if low in rows[0]:
            whiskers = np.abs(np.array([[float(row[end] or 0.0) for row in rows] for end in (low, high)]) - heights)
        axes.bar(at, heights, width, yerr=whiskers, capsize=2, label=name)
    axes.set_xticks(np.arange(len(rows)), [str(row[label]) for row in rows], rotation=45, ha="right")
    axes.set_title(table.title)
    axes.legend()
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise MotiondeckError(f"{path}: cannot be drawn ({error})") from None
