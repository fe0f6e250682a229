"""Borders found in the labelled CMU trials, ruptures beside ours.

DATA is a folder with 86.asf, 86_01.amc, 62ch/86_NN.npy (all AMC channels), 4ch/86_NN.csv (rx of upper arms and
thighs) and labels/barbic_NN_ground_truth.txt; what is missing is left out. Unsupervised on all, and the experts on
86_01 for eight reservoirs, scored where they have not learned. F1 counts borders inside the tolerance of whoever marked
them; the thresholds are those of the library, the same everywhere.

MOCAP6.mat holds six exercise sequences of subjects 13 and 14 (12 channels, 10 Hz). Nobody has marked a tolerance there,
so a border counts within 1 s; channels are scaled to a standard deviation of 1. With --bodies, the folder of their
recordings, those that are there are cut as whole bodies too, by planes as well (on subject 86's skeleton: subject 13's
is not to be had).
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import importlib.util
import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy.io
import typer

from benchmarks import command
from benchmarks.centralized.plane_segments import body_features, plane_segments
from benchmarks.recognition.border_score import score_borders
from benchmarks.recognition.change_points import (
    BORDER_PRICE,
    KERNEL_RATE,
    PREDICTION_RATE,
    SHORTEST,
    cross_prediction,
    kernel_change_points,
)
from benchmarks.recognition.first_occurrences import (
    EXPERTS,
    LOOK,
    bank_of_first_occurrences,
    first_occurrences,
    not_learned,
    smoothed,
)
from benchmarks.recognition.segment_labels import Labels, read_labels
from controller.learning.recognition.experts import ExpertRecipe
from controller.learning.recognition.features import ANGLE_UNIT, FeatureRecipe, features, resampled, with_velocity
from controller.learning.recognition.viterbi_segmentation import CHANGE_COST, borders_of, frame_costs, viterbi
from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import AcclaimSkeleton, read_asf

RATE = 120.0


def kernel_by_ruptures(signal, rate: float):
    """The same kernel, price and shortest segment, minimised by ruptures (PELT, in C)."""
    from ruptures import KernelCPD  # pyright: ignore[reportMissingImports]

    search = KernelCPD(kernel="rbf", min_size=max(1, round(SHORTEST * rate))).fit(signal)
    return np.array(search.predict(pen=BORDER_PRICE * rate)[:-1], dtype=np.int64)


WAYS = {
    "kernel change points": (kernel_change_points, KERNEL_RATE),
    "cross-prediction": (cross_prediction, PREDICTION_RATE),
}
if importlib.util.find_spec("ruptures") is not None:
    WAYS["ruptures, same kernel"] = (kernel_by_ruptures, KERNEL_RATE)


def main(
    folder: Annotated[Path, typer.Argument(metavar="DATA", help="The folder of CMU 86.")],
    mocap6: Annotated[Path | None, typer.Argument(metavar="MOCAP6.mat", help="Six exercise sequences.")] = None,
    bodies: Annotated[
        Path | None, typer.Option("--bodies", metavar="DIR", help="Their recordings, 13_29.amc and so on.")
    ] = None,
) -> None:
    skeleton = read_asf(folder / "86.asf")
    clips = {path.stem[-2:]: read_amc(path, skeleton) for path in sorted(folder.glob("86_*.amc"))}
    order = channel_order(folder / "86_01.amc")
    with tempfile.TemporaryDirectory() as there:
        for path in sorted(folder.glob("62ch/*.npy")):
            written = Path(there) / f"{path.stem}.amc"
            write_amc(written, np.load(path)[:, : sum(count for _, count in order)], order)
            clips[path.stem[-2:]] = read_amc(written, skeleton)
    looks = {}
    for trial, clip in clips.items():
        looks[trial, "whole body"] = lambda rate, clip=clip: features(clip, FeatureRecipe(height=True, rate=rate))
    for path in sorted(folder.glob("4ch/*.csv")):
        angles = np.unwrap(np.radians(np.genfromtxt(path, delimiter=",")[:, :4]), axis=0) / ANGLE_UNIT
        looks[path.stem[-2:], "4 angles"] = lambda rate, angles=angles: with_velocity(
            resampled(angles, RATE, rate), rate
        )
    for way, (cut, rate) in WAYS.items():
        print(way)
        for kind in ("whole body", "4 angles"):
            scores = []
            for trial in sorted(name for name, other in looks if other == kind):
                labels = read_labels(folder / "labels" / f"barbic_{trial}_ground_truth.txt")
                borders = np.round(cut(looks[trial, kind](rate), rate) * RATE / rate).astype(np.int64)
                score = score_borders(borders, labels.borders)
                scores.append(score.f1)
                print(
                    f"  {kind:<11} 86_{trial}: F1 {score.f1:.2f} ({score.hits} of {score.marked}, {score.found} given)"
                )
            print(f"  {kind:<11} mean F1 {np.mean(scores):.2f} over {len(scores)} trials")
    if mocap6 is not None:
        exercises(mocap6)
        if bodies is not None:
            exercising_bodies(mocap6, bodies, skeleton)
    print("experts on 86_01, first occurrences learned, the rest asked")
    labels = read_labels(folder / "labels" / "barbic_01_ground_truth.txt")
    rows = [experts(features(clips["01"], LOOK), labels, seed) for seed in range(1, 9)]
    for name, values in zip(("smoothed 0.5 s", "Viterbi", "border F1, not learned"), np.array(rows).T, strict=True):
        print(
            f"  {name:<22} {values.mean():.3f} +- {values.std():.3f}, worst {values.min():.3f} of {len(values)} seeds"
        )


def exercises(path: Path) -> None:
    """The six sequences of mocap6, cut without labels."""
    sequences = scipy.io.loadmat(path)["DataBySeq"].ravel()
    for way, (cut, _) in WAYS.items():
        scores = []
        for one in sequences:
            rate = float(one["framerate"].squeeze())
            frames, actions = one["X"] / one["X"].std(0), one["TrueZ"].ravel()
            best = np.flatnonzero(np.diff(actions.astype(int))) + 1
            accepted = np.column_stack([best - round(rate), best, best + round(rate)])
            score = score_borders(cut(with_velocity(frames, rate), rate), accepted)
            scores.append(score.f1)
            name = one["filename"].item().item()
            print(f"  {way:<21} {name}: F1 {score.f1:.2f} ({score.hits} of {score.marked}, {score.found} given)")
        print(f"  {way:<21} mean F1 {np.mean(scores):.2f} over {len(scores)} sequences")


def exercising_bodies(path: Path, folder: Path, skeleton: AcclaimSkeleton) -> None:
    """The same sequences as whole bodies at their full rate, by all ways; planes also when told how many there are."""
    for one in scipy.io.loadmat(path)["DataBySeq"].ravel():
        name = one["filename"].item().item()
        if not (folder / f"{name}.amc").is_file():
            continue
        clip = read_amc(folder / f"{name}.amc", skeleton)
        # The sequence lacks the recording's first step.
        best = (
            (np.flatnonzero(np.diff(one["TrueZ"].ravel().astype(int))) + 2) * RATE / float(one["framerate"].squeeze())
        )
        accepted = np.column_stack([best - RATE, best, best + RATE]).astype(np.int64)
        places = body_features(clip)
        found = {
            "planes": plane_segments(places, RATE),
            "planes, number told": plane_segments(places, RATE, len(best) + 1),
        }
        cuts = {way: np.array([end for _, end in bounds[:-1]]) for way, bounds in found.items()}
        for way, (cut, rate) in WAYS.items():
            borders = cut(features(clip, FeatureRecipe(height=True, rate=rate)), rate) * RATE / rate
            cuts[way] = np.round(borders).astype(np.int64)
        for way, borders in cuts.items():
            score = score_borders(borders, accepted)
            print(f"  {way:<21} {name}, body: F1 {score.f1:.2f} ({score.hits} of {score.marked}, {score.found} given)")


def experts(signal, labels: Labels, seed: int) -> tuple[float, float, float]:
    stride = RATE / LOOK.rate
    recipe = ExpertRecipe(leak=EXPERTS.leak, seed=seed)
    costs = frame_costs(bank_of_first_occurrences(signal, labels, stride, recipe), signal)
    truth = labels.of_frames(stride)[: len(signal)]
    ask = ~first_occurrences(labels, stride)[: len(signal)]
    path = viterbi(costs, CHANGE_COST * LOOK.rate)
    borders = np.round(borders_of(path) * stride).astype(np.int64)
    by_smoothing = smoothed(costs, LOOK.rate).argmin(1)
    f1 = score_borders(*not_learned(borders, labels)).f1
    return float((by_smoothing == truth)[ask].mean()), float((path == truth)[ask].mean()), f1


def channel_order(path: Path) -> list[tuple[str, int]]:
    """The bones of a recording in its order, each with its number of channels."""
    order: list[tuple[str, int]] = []
    for line in path.read_text(encoding="latin-1").splitlines():
        words = line.split()
        if len(words) > 1 and not words[0].startswith(("#", ":")):
            if order and words[0] == order[0][0]:
                break
            order.append((words[0], len(words) - 1))
    return order


def write_amc(path: Path, values, order: list[tuple[str, int]]) -> None:
    """Writes channels (T, n), degrees, as a recording."""
    ends = np.cumsum([count for _, count in order])[:-1]
    with path.open("w") as file:
        file.write(":FULLY-SPECIFIED\n:DEGREES\n")
        for number, row in enumerate(values, 1):
            parts = zip(order, np.split(row, ends), strict=True)
            file.write(f"{number}\n" + "".join(f"{bone} {' '.join(map(str, own))}\n" for (bone, _), own in parts))


if __name__ == "__main__":
    command.run("segmentation", main, __doc__)
