"""Found borders against the marked ones of CMU 86.

86_01 is a whole body; 86_10 here its 62 recorded angles; the others four angles, rx of the upper arms and thighs,
for which a simple motion is given a plane of two dimensions. Windows are the labels' own, and widened by 50 frames.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.centralized.plane_segments import Bounds, body_features, plane_segments
from benchmarks.recognition.border_score import BorderScore, score_borders
from benchmarks.recognition.segment_labels import read_labels
from controller.motion.formats.reading import read_clip

RATE = 120.0


def angles(values: np.ndarray) -> np.ndarray:
    """Angles in degrees and their rates over 0.1 s."""
    x = np.radians(values)
    return np.concatenate([x, 0.1 * RATE * np.gradient(x, axis=0)], axis=1)


def score(segments: Bounds, marked: np.ndarray, tolerance: int = 0) -> BorderScore:
    """Borders against the labels' windows, widened by a tolerance in frames."""
    found = np.array([end for _, end in segments[:-1]])
    return score_borders(found, marked + tolerance * np.array([-1, 0, 1]))


def main(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="CMU 86: 86_01.amc, 62ch/, 4ch/, labels/.")],
) -> None:
    trials = [("86_01 body", "01", body_features(read_clip(data / "86_01.amc")), 4)]
    trials.append(("86_10 62 angles", "10", angles(np.load(data / "62ch" / "86_10.npy")[:, 6:62]), 4))
    for file in sorted((data / "4ch").glob("86_*.csv")):
        trials.append((f"{file.stem} 4 angles", file.stem[3:], angles(np.loadtxt(file, delimiter=",")[:, :4]), 2))
    print("| recording | borders | count given: F1, F1 +-50 | not given: found | precision | recall | F1 | F1 +-50 |")
    print("|---|---|---|---|---|---|---|---|")
    for name, trial, features, plane in trials:
        marked = read_labels(data / "labels" / f"barbic_{trial}_ground_truth.txt").borders
        told = plane_segments(features, RATE, len(marked) + 1, plane)
        free = plane_segments(features, RATE, None, plane)
        strict = score(free, marked)
        print(
            f"| {name} | {len(marked)} | {score(told, marked).f1:.2f}, {score(told, marked, 50).f1:.2f} "
            f"| {strict.found} | {strict.precision:.2f} | {strict.recall:.2f} | {strict.f1:.2f} "
            f"| {score(free, marked, 50).f1:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    command.run("centralized_borders", main, __doc__)
