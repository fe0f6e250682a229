"""Curves over time: cuts through a recording, coordinates beside what networks play, and any other named curves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.motion.rotations import Array
from motiondeck.pictures.figures import new_figure, save

if TYPE_CHECKING:
    from controller.motion.clip import Clip

RECORDED, PLAYED = "#c0392b", "#1f5fa8"


def draw_segments(clip: Clip, report: dict[str, Any], path: Path) -> None:
    """Heights of hands, feet and head of a recording over time, and the cuts through them."""
    figure = new_figure(11, 3.6)
    axes = figure.add_subplot()
    time = np.arange(len(clip)) / clip.rate
    for bone, height in zip(("root", *clip.skeleton.bones), clip.joints()[:, :, 2].T, strict=True):
        if bone.endswith(("hand", "wrist", "foot", "head", "root")):
            axes.plot(time, height, linewidth=0.8, label=bone)
    for index, one in enumerate(report["segments"]):
        if index:
            axes.axvline(one["from_s"], color="black", linewidth=1.4, label="cut" if index == 1 else None)
        name = one["motion"] or str(index + 1)
        axes.annotate(
            name, (0.5 * (one["from_s"] + one["to_s"]), 1.01), xycoords=("data", "axes fraction"), ha="center"
        )
    axes.set_xlabel("s")
    axes.set_ylabel("height, m")
    axes.set_xlim(0.0, time[-1])
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
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
