"""Pictures of the recognition benchmark: accuracies, confusion, and the curves over time warp and dimensions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from motiondeck.pictures.figures import new_figure, save
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(report: dict[str, Any], folder: Path) -> list[Path]:
    """Draws what a benchmark's report holds into a folder and returns the files.

    Raises:
        MotiondeckError: if the folder cannot be written.
    """
    figures: dict[str, Figure] = {"recognition-methods.png": _methods(report)}
    for result in report["results"]:
        if result["method"] == "experts (ours)" or result["method"].startswith("proposal, 50"):
            who = "ours" if result["method"] == "experts (ours)" else "proposal"
            figures[f"confusion-{who}-{result['protocol']}.png"] = _confusion(result, report["classes"])
    if report.get("time_warp"):
        figures["time-warp.png"] = _curves(
            report["time_warp"], "duration, times the learned one", "Time warp", logarithmic=True
        )
    for protocol, ways in report.get("dimensions", {}).items():
        figures[f"dimensions-{protocol}.png"] = _curves(
            ways, "dimensions of the joint positions", f"Fewer dimensions, {protocol}", logarithmic=True
        )
    paths: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in figures.items():
            save(figure, folder / name)
            paths.append(folder / name)
    except OSError as error:
        raise MotiondeckError.unwritable(folder, error) from None
    return paths


def _methods(report: dict[str, Any]) -> Figure:
    names = list(dict.fromkeys(result["method"] for result in report["results"]))
    protocols = list(dict.fromkeys(result["protocol"] for result in report["results"]))
    figure = new_figure(9, 0.42 * len(names) + 1.5)
    axes = figure.subplots()
    for row, protocol in enumerate(protocols):
        own = [r for r in report["results"] if r["protocol"] == protocol]
        axes.errorbar(
            [r["accuracy"] for r in own],
            [names.index(r["method"]) + 0.16 * (row - (len(protocols) - 1) / 2) for r in own],
            xerr=[r["spread"] for r in own],
            fmt="o",
            label=protocol,
        )
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("share recognized")
    axes.set_title(f"{report['clips']} clips, {len(report['classes'])} motions, {len(report['actors'])} actors")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _confusion(result: dict[str, Any], classes: list[str]) -> Figure:
    counts = result["confusion"]
    figure = new_figure(0.6 * len(classes) + 3, 0.5 * len(classes) + 2.5)
    axes = figure.subplots()
    shares = [[count / max(sum(row), 1) for count in row] for row in counts]
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for i, row in enumerate(counts):
        for j, count in enumerate(row):
            if count:
                axes.text(j, i, str(count), ha="center", va="center", color="white" if shares[i][j] > 0.5 else "black")
    axes.set_xticks(range(len(classes)), classes, rotation=60, ha="right")
    axes.set_yticks(range(len(classes)), classes)
    axes.set_xlabel("taken for")
    axes.set_ylabel("was")
    axes.set_title(f"{result['method']}, {result['protocol']}: {result['accuracy']:.3f}")
    return figure


def _curves(curves: dict[str, Any], label: str, title: str, *, logarithmic: bool) -> Figure:
    figure = new_figure(6.5, 4)
    axes = figure.subplots()
    ticks: set[float] = set()
    for name, points in curves.items():
        axes.plot([p["x"] for p in points], [p["accuracy"] for p in points], "o-", label=name)
        ticks |= {p["x"] for p in points}
    if logarithmic:
        axes.set_xscale("log")
        axes.set_xticks(sorted(ticks), [f"{tick:g}" for tick in sorted(ticks)])
        axes.minorticks_off()
    axes.set_xlabel(label)
    axes.set_ylabel("share recognized")
    axes.set_title(title)
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
