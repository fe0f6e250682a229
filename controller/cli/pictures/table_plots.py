"""Tables as pictures; matplotlib is an extra and is only asked for when a plot is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.evaluation.tables import Table

_WORDS = {
    "mabs_readout": "MABS(W_out)",
    "nrmse_readout": "NRMSE(W_out)",
    "mabs_weights": "MABS(W)",
    "nrmse_weights": "NRMSE(W)",
    "training_s": "training, s",
    "training_mb": "training, MB",
    "neurons": "neurons N",
    "frames": "frames",
    "motions": "motions P",
    "velocity": "peak velocity",
    "acceleration": "peak acceleration",
    "jerk": "peak jerk",
}


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
    figure = {"bars": _bars, "spread": _spread, "costs": _costs}[table.picture](table)
    figure.suptitle(table.title)
    try:
        figure.savefig(path, dpi=120)
    except (OSError, ValueError) as error:
        raise MotiondeckError(f"{path}: cannot be drawn ({error})") from None


def _bars(table: Table) -> Any:
    """One group of bars a row; percentages share a panel, whiskers where the table has low and high of them."""
    import numpy as np
    from matplotlib.figure import Figure

    label = next(iter(table.rows[0]))
    rows = [row for row in table.rows if any(isinstance(row.get(name), int | float) for name in table.draws)]
    # A row of percentages below rows of something else is no bar among them.
    rows = [row for row in rows if not str(row[label]).endswith("%")]
    shares = all(name.endswith("%") for name in table.draws)
    panels = [table.draws] if shares else [(name,) for name in table.draws]
    width = max(6.0, 0.7 * len(rows) + 2.0) if shares else max(5.0, 0.5 * len(rows) + 1.5) * len(panels) * 0.6
    figure = Figure(figsize=(width, 4.8), layout="constrained")
    for axes, names in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        thick = 0.8 / len(names)
        for i, name in enumerate(names):
            heights = np.array([np.nan if row[name] is None else float(row[name] or 0.0) for row in rows])
            at = np.arange(len(rows)) + (i - (len(names) - 1) / 2.0) * thick
            low, high = (f"{name.removesuffix(' %')} {end}" for end in ("low", "high"))
            whiskers = None
            if low in rows[0]:
                ends = np.array([[float(row[end] or 0.0) for row in rows] for end in (low, high)])
                whiskers = np.abs(ends - heights)
            axes.bar(at, heights, thick, yerr=whiskers, capsize=2, label=name.removesuffix(" %"))
        axes.set_xticks(np.arange(len(rows)), [str(row[label]) for row in rows], rotation=45, ha="right")
        axes.set_ylim(bottom=0.0)
        if shares:
            axes.set_ylabel("failures, % (95 % intervals)" if any(key.endswith(" low") for key in rows[0]) else "%")
            axes.legend()
        else:
            axes.set_ylabel(_WORDS.get(names[0], names[0]))
    return figure


def _spread(table: Table) -> Any:
    """A panel for each measure: median, quarters and the range from 5 to 95 % of the details, by method."""
    import numpy as np
    from matplotlib.figure import Figure

    methods = list(dict.fromkeys(str(row["method"]) for row in table.details))
    figure = Figure(figsize=(3.2 * len(table.draws), 4.5), layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(1, len(table.draws))), table.draws, strict=True):
        seen = [[float(row[name] or 0.0) for row in table.details if row["method"] == method] for method in methods]
        axes.boxplot(seen, whis=(5, 95), showfliers=False)
        axes.set_xticks(np.arange(1, len(methods) + 1), methods, rotation=30, ha="right")
        if name == "frames":
            axes.set_title("frames on the way")
            axes.set_ylim(bottom=0.0)
        else:
            axes.set_title(f"{_WORDS.get(name, name)}\n(both motions' own = 1)")
            axes.axhline(1.0, color="grey", linewidth=0.8)
            axes.set_yscale("log")
    return figure


def _costs(table: Table) -> Any:
    """Costs against N, T and P on logarithmic axes: measured, fitted by a power, and the thesis's bound."""
    import numpy as np
    from matplotlib.figure import Figure

    from controller.evaluation.tables import THESIS_EXPONENTS

    sizes = {"N": "neurons", "T": "frames", "P": "motions"}
    bounds = {"training_s": 0, "training_mb": 1}
    figure = Figure(figsize=(11.0, 3.4 * len(table.draws)), layout="constrained")
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
            axes.set(xlabel=_WORDS[size] + (" T" if varied == "T" else ""), ylabel=_WORDS[what])
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
