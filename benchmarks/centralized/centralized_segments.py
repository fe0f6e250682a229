"""Whole-body errors on CMU 86_01 beside pydmps, splines and Fourier.

Mean over segments of the mean absolute error of a coordinate, mm, 31 joints (93 outputs). In the second table every
method has the same number of parameters for each output; satellites and frequencies are shared by all outputs and
counted once. pydmps (rhythmic, 100 basis functions, GPL) is measured where it is installed: pip install pydmps. The
picture is figure 15 of the paper: the first table by segments.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy.interpolate import BSpline

from benchmarks import command
from benchmarks.papers.segment_network import play_segment
from controller.cli.pictures.curve_plots import draw_lines
from controller.cli.pictures.figures import check_picture
from controller.mocap.formats.reading import read_clip
from controller.mocap.segmentation import body_features, find_segments
from controller.training.centralized.model_choice import mean_absolute, mean_distance

SEGMENTS = 11


def least_squares(basis: np.ndarray, part: np.ndarray) -> np.ndarray:
    flat = part.reshape(len(part), -1)
    return (basis @ np.linalg.lstsq(basis, flat, rcond=1e-10)[0]).reshape(part.shape)


def spline(part: np.ndarray, count: int) -> np.ndarray:
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, count - 2), np.ones(3)])
    return least_squares(BSpline.design_matrix(np.linspace(0, 1, len(part)), knots, 3).toarray(), part)


def cosines(part: np.ndarray, count: int) -> np.ndarray:
    x = (np.arange(len(part)) + 0.5) / len(part)
    return least_squares(np.cos(np.pi * np.multiply.outer(x, np.arange(count))), part)


def fourier(part: np.ndarray, count: int) -> np.ndarray:
    """Constant, trend, sines and cosines of the best of some base periods."""
    x = np.linspace(0, 1, len(part))
    tries = []
    for stretch in np.linspace(1.0, 2.0, 11):
        angle = 2 * np.pi * np.multiply.outer(x / stretch, np.arange(1, count // 2 + 1))
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(x), -1)
        basis = np.column_stack([np.ones(len(x)), x, waves])[:, :count]
        tries.append(least_squares(basis, part))
    return min(tries, key=lambda output: float(np.square(output - part).sum()))


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
    segments = find_segments(body_features(clip), clip.rate, SEGMENTS)
    print(f"{SEGMENTS} segments end at {[end for _, end in segments]}", flush=True)
    parts = [places[first:end] for first, end in segments]

    curves: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def row(name: str, method, drawn: str | None = None) -> float:
        outputs = [method(part) for part in parts]
        errors = [mean_absolute(o, p) for o, p in zip(outputs, parts, strict=True)]
        far = [mean_distance(o, p) for o, p in zip(outputs, parts, strict=True)]
        if drawn:
            curves[drawn] = np.arange(1, SEGMENTS + 1), np.array(errors)
        print(f"{name:44} {np.mean(errors):8.2f} mm a coordinate {np.mean(far):8.2f} mm a joint", flush=True)
        return float(np.mean(errors))

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
    outputs = places[0].size
    for satellites in (8, 16, 32):
        shared = satellites * 5 + 4
        count = int(np.ceil(satellites + 1 + shared / outputs))
        print(f"at {satellites + 1 + shared / outputs:.1f} parameters for each output (others: {count})")
        ours = row(
            f"  learned network, 2 centers, {satellites} satellites",
            lambda p, m=satellites: play_segment(p, clip.rate, m),
        )
        best = min(
            row("  cubic spline", lambda p, c=count: spline(p, c)),
            row("  Fourier with trend, best of 11 periods", lambda p, c=count: fourier(p, c)),
            row("  cosines (DCT)", lambda p, c=count: cosines(p, c)),
        )
        print(f"  the best other has {best / ours:.2f} times our error", flush=True)


if __name__ == "__main__":
    command.run("centralized_segments", main, __doc__)
