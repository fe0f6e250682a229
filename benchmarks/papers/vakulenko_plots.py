"""Figures of Vakulenko et al. 2017: table 1, errors by segment and joint, and errors of hidden joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from controller.learning.evaluation.tables import Table
from controller.motion.rotations import Array
from motiondeck.pictures.figures import new_figure, save

RECORDED, PLAYED = "#c0392b", "#1f5fa8"


def draw_segment_errors(table: Table, path: Path) -> None:
    """Errors by segment and size (figures 15 and 16), and by joint and segment, absolute and relative (figure 14)."""
    rows, details = table.rows, table.details
    joints = list(dict.fromkeys(str(one["joint"]) for one in details))
    figure = new_figure(13.0, 4.0 + 0.17 * len(joints))
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 0.06 * len(joints)))
    axes = figure.add_subplot(grid[0, :])
    width = 0.8 / len(table.draws)
    for i, name in enumerate(table.draws):
        heights = [float(row[name] or 0.0) for row in rows]
        axes.bar(
            np.arange(len(rows)) + (i - 0.5 * (len(table.draws) - 1)) * width,
            heights,
            width,
            label=name,
        )
    axes.set_xticks(np.arange(len(rows)), [str(row["segment"]) for row in rows])
    axes.set_xlabel("segment")
    axes.set_ylabel("mm a coordinate")
    axes.set_title(table.title)
    axes.legend(fontsize=8)
    for column, (key, title) in enumerate((("mm", "49 satellites: mm a coordinate"), ("relative", "relative, eq. 26"))):
        axes = figure.add_subplot(grid[1, column])
        values = np.array([float(one[key] or 0.0) for one in details]).reshape(-1, len(joints)).T
        picture = axes.imshow(values, aspect="auto", cmap="viridis")
        axes.set_yticks(np.arange(len(joints)), joints, fontsize=6)
        axes.set_xticks(np.arange(values.shape[1]), [str(k + 1) for k in range(values.shape[1])])
        axes.set_xlabel("segment")
        axes.set_title(title)
        figure.colorbar(picture, ax=axes)
    save(figure, path)


def draw_hidden(table: Table, path: Path) -> None:
    """Errors in gaps by joint and length, a mark a way of filling, on one logarithmic scale."""
    label = next(iter(table.rows[0]))
    figure = new_figure(0.6 * len(table.rows) + 2.5, 4.4)
    axes = figure.add_subplot(yscale="log")
    for name, mark in zip(table.draws, "os^v", strict=False):
        axes.plot([float(row[name] or np.nan) for row in table.rows], mark, label=name.removesuffix(" mm"))
    axes.set_xticks(range(len(table.rows)), [str(row[label]) for row in table.rows], rotation=45, ha="right")
    axes.set_ylabel("mean absolute error of a coordinate, mm")
    axes.set_title(table.title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)


def draw_table1(table: Table, path: Path) -> None:
    """Relative accuracies of table 1, a panel a segment, on a logarithmic scale."""
    label = next(iter(table.rows[0]))
    cells: dict[str, list[tuple[str, Any]]] = {}
    for row in table.rows:
        size, _, segment = str(row[label]).rpartition(", ")
        cells.setdefault(segment, []).append((size, row))
    figure = new_figure(3.3 * len(cells) + 0.8, 4.0)
    panels = figure.subplots(1, len(cells), sharey=True, squeeze=False)[0]
    shades = dict(zip(table.draws, (RECORDED, "#9e9e9e", PLAYED), strict=True))
    for axes, (segment, rows) in zip(panels, cells.items(), strict=True):
        for name, shade in shades.items():
            axes.plot([row[name] for _, row in rows], "o", color=shade, label=name)
        axes.set_xticks(range(len(rows)), [size for size, _ in rows], rotation=45, ha="right")
        axes.set_yscale("log")
        axes.set_title(f"segment {segment}")
        axes.set_xlabel("centers, satellites")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("integral relative accuracy, eq. 26")
    panels[0].legend(fontsize=8)
    figure.suptitle(table.title)
    save(figure, path)


def draw_coordinates(
    recorded: Array, played: dict[str, Array], names: list[str], rate: float, title: str, path: Path
) -> None:
    """Coordinates over time, recorded and as networks play them, and the last marker in space (figures 3 to 12).

    Args:
        recorded: shape (K, M, 3), mm.
        played: the same by each network.
        names: of the markers.
        rate: frames per second.
        title: above it.
        path: the file.
    """
    figure = new_figure(3.6 * len(names) + 3.6, 8.0)
    grid = figure.add_gridspec(3, len(names) + 1)
    time = np.arange(len(recorded)) / rate
    shades = dict(zip(played, ("#8fc1e3", "#3c8dbc", PLAYED)[-len(played) :], strict=True))
    for column, name in enumerate(names):
        for row, axis in enumerate("xyz"):
            axes = figure.add_subplot(grid[row, column])
            axes.plot(time, recorded[:, column, row], color=RECORDED, linewidth=2.6, alpha=0.6, label="recorded")
            for label, output in played.items():
                axes.plot(time, output[:, column, row], color=shades[label], linewidth=0.9, label=label)
            if not row:
                axes.set_title(name)
            if not column:
                axes.set_ylabel(f"{axis}, mm")
            if row == 2:
                axes.set_xlabel("s")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="lower right")
    space = figure.add_subplot(grid[:2, -1], projection="3d")
    space.plot(*recorded[:, -1].T, color=RECORDED, linewidth=1.4)
    for label, output in played.items():
        space.plot(*output[:, -1].T, color=shades[label], linewidth=0.7)
    space.set_title(f"{names[-1]} in space, mm")
    figure.suptitle(title)
    save(figure, path)


def draw_lines(
    curves: dict[str, tuple[Array, Array]], labels: tuple[str, str], title: str, path: Path, **scale: Any
) -> None:
    """Curves (x, y) by name; scale may be xscale="log", yscale="log", xlim or ylim."""
    figure = new_figure(7.0, 4.4)
    axes = figure.add_subplot(**scale)
    for name, (x, y) in curves.items():
        axes.plot(x, y, "o-", markersize=3.5, label=name)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.set_title(title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)
