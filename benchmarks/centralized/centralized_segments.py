"""Whole-body errors on CMU 86_01 beside pydmps.

Mean over segments of the mean absolute error of a coordinate, mm, 31 joints (93 outputs); methods at equal numbers of
parameters are in `accuracy`. pydmps (rhythmic, 100 basis functions, GPL) is measured where it is installed: pip
install pydmps. The picture is figure 15 of the paper: the table by segments.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.centralized.plane_segments import body_features, plane_segments
from benchmarks.papers.segment_network import play_segment
from benchmarks.papers.vakulenko_plots import draw_lines
from controller.learning.centralized.model_choice import mean_absolute, mean_distance
from controller.motion.formats.reading import read_clip
from motiondeck.pictures.figures import check_picture

SEGMENTS = 11


def movement_primitives(part: np.ndarray) -> np.ndarray:
    from pydmps import DMPs_rhythmic

    flat = part.reshape(len(part), -1).T
    # It integrates by Euler's method: on short segments each frame gets several steps, as its own default would have.
    each = max(1, int(np.ceil(2 * np.pi / 0.01 / len(part))))
    primitives = DMPs_rhythmic(n_dmps=len(flat), n_bfs=100, dt=2 * np.pi / (each * len(part)))
    primitives.imitate_path(flat, plot=False)
    return primitives.rollout(timesteps=each * len(part))[0][::each].reshape(part.shape)


def main(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder that holds 86_01.amc.")],
    picture: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    if picture is not None:
        check_picture(picture)
    clip = read_clip(folder / "86_01.amc")
    places = 1e3 * clip.joints()
    segments = plane_segments(body_features(clip), clip.rate, SEGMENTS)
    print(f"{SEGMENTS} segments end at {[end for _, end in segments]}", flush=True)
    parts = [places[first:end] for first, end in segments]

    curves: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def row(name: str, method: Callable[[np.ndarray], np.ndarray], drawn: str) -> None:
        outputs = [method(part) for part in parts]
        errors = [mean_absolute(o, p) for o, p in zip(outputs, parts, strict=True)]
        far = [mean_distance(o, p) for o, p in zip(outputs, parts, strict=True)]
        curves[drawn] = np.arange(1, SEGMENTS + 1), np.array(errors)
        print(f"{name:44} {np.mean(errors):8.2f} mm a coordinate {np.mean(far):8.2f} mm a joint", flush=True)

    try:
        row("pydmps rhythmic, 100 basis functions", movement_primitives, "pydmps, 100 functions")
    except ImportError:
        print("pydmps is not installed")
    for satellites in (16, 49, 100):
        row(
            f"learned network, 2 centers, {satellites} satellites",
            lambda p, m=satellites: play_segment(p, clip.rate, m),
            f"{satellites} satellites",
        )
    if picture is not None:
        title = "86_01, 31 joints"
        draw_lines(curves, ("segment", "mean absolute error of a coordinate, mm"), title, picture, yscale="log")


if __name__ == "__main__":
    command.run("centralized_segments", main, __doc__)
