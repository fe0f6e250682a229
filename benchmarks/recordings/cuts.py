"""Cuts of long recordings against labels of CMU 86 and mocap6, beside rivals.

Whole bodies are 86_01, 86_10 (its channels are in an array) and mocap6's 13_29 to 13_31 on subject 86's skeleton, as
13's is not to be had; the other trials of 86 are four angles, subject 14's of mocap6 twelve channels. How many motions
there are is not given to any method. An error is the distance from a label's best frame to the nearest border; F1 pairs
each border with one label at most. Labels are not sharp: transitions take half a second and more. Where two people
labelled the same trials, their borders are compared as ours are.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import scipy.io
import typer
from numpy.typing import NDArray

from benchmarks import command
from benchmarks.centralized.plane_segments import body_features, plane_segments
from benchmarks.recognition.border_score import score_borders
from benchmarks.recognition.change_points import KERNEL_RATE, kernel_change_points
from benchmarks.recognition.segment_labels import read_labels
from benchmarks.recognition.segmentation import channel_order, write_amc
from benchmarks.recordings.ppca_cuts import ppca_borders
from controller.learning.recognition.features import ANGLE_UNIT, FeatureRecipe, features, resampled, with_velocity
from controller.motion.clip import Clip
from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import read_asf
from controller.motion.rotations import Array, conjugate, multiply
from controller.motion.take.segmentation import find_segments, segments_of

RATE = 120.0
NEAR, FAR = 0.3, 1.0  # s
CHOSEN_ON = ("86_01", "13_29", "86_02 angles", "86_07 angles")
RISE_OF_BODIES, RISE_OF_ANGLES = 400.0, 15.0  # R of PPCA: of 1 to 800 the best ones on CHOSEN_ON
TRUNK = ["lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head"]
PPCA_JOINTS = [*TRUNK, *(side + joint for joint in ("humerus", "radius", "femur", "tibia") for side in "lr")]
Borders = NDArray[np.int64]


@dataclass(frozen=True)
class Trial:
    """A labelled recording: a clip, or angles (T, A), rad, at 120 Hz; best frames of its borders."""

    name: str
    best: Borders
    clip: Clip | None = None
    angles: Array | None = None


def ours(trial: Trial) -> Borders:
    """The borders of the product."""
    if trial.clip is not None:
        return _inner(segments_of(trial.clip))
    assert trial.angles is not None
    return 4 * _inner(find_segments(trial.angles[::4], RATE / 4.0))


def planes(trial: Trial) -> Borders:
    """The best planes of four dimensions, of two for angles."""
    if trial.clip is not None:
        return _inner(plane_segments(body_features(trial.clip), RATE))
    assert trial.angles is not None
    both = np.concatenate([trial.angles, 0.1 * RATE * np.gradient(trial.angles, axis=0)], axis=1)
    return _inner(plane_segments(both, RATE, None, 2))


def kernel(trial: Trial) -> Borders:
    """Kernel change points."""
    if trial.clip is not None:
        seen = features(trial.clip, FeatureRecipe(height=True, rate=KERNEL_RATE))
    else:
        assert trial.angles is not None
        seen = with_velocity(resampled(trial.angles / ANGLE_UNIT, RATE, KERNEL_RATE), KERNEL_RATE)
    return np.round(kernel_change_points(seen, KERNEL_RATE) * RATE / KERNEL_RATE).astype(np.int64)


def ppca(trial: Trial) -> Borders:
    """Probabilistic PCA, of the quaternions of joints, as in the paper, or of angles."""
    if trial.clip is None:
        assert trial.angles is not None
        return ppca_borders(trial.angles, RISE_OF_ANGLES)
    skeleton, rotation = trial.clip.skeleton, trial.clip.rotation
    bones = np.array([skeleton.bones.index(joint) for joint in PPCA_JOINTS])
    local = multiply(conjugate(rotation[:, 1 + skeleton.parent[bones]]), rotation[:, 1 + bones])
    return ppca_borders(local.reshape(len(local), -1), RISE_OF_BODIES)


METHODS: dict[str, Callable[[Trial], Borders]] = {"ours": ours, "PPCA": ppca, "planes": planes, "kernel": kernel}


def _inner(bounds: tuple[tuple[int, int], ...]) -> Borders:
    return np.array([end for _, end in bounds[:-1]], dtype=np.int64)


def errors(found: Borders, best: Borders) -> Array:
    """Distance of each label to the nearest border, s; infinite if there is none."""
    if len(found) == 0:
        return np.full(len(best), np.inf)
    return np.abs(found[None] - best[:, None]).min(axis=1) / RATE


def f1(found: Borders, best: Borders, within: float) -> float:
    """F1 of borders within some seconds of the labels' best frames."""
    reach = round(within * RATE)
    return score_borders(found, best[:, None] + np.array([-reach, 0, reach])).f1


def trials_in(data: Path) -> list[Trial]:
    """The labelled recordings of a folder like CMU's."""
    folder = data / "cmu" / "86"
    skeleton = read_asf(folder / "86.asf")
    order = channel_order(folder / "86_01.amc")
    best = {path.name[7:9]: read_labels(path).borders[:, 1] for path in sorted(folder.glob("labels/barbic_*_g*.txt"))}
    found = [Trial("86_01", best["01"], read_amc(folder / "86_01.amc", skeleton))]
    with tempfile.TemporaryDirectory() as there:
        written = Path(there) / "86_10.amc"
        write_amc(written, np.load(folder / "62ch" / "86_10.npy")[:, :62], order)
        found.append(Trial("86_10", best["10"], read_amc(written, skeleton)))
    for one in scipy.io.loadmat(data / "cmu" / "mocap6" / "mocap6.mat")["DataBySeq"].ravel():
        path = data / "cmu" / "13" / f"{one['filename'].item().item()}.amc"
        if path.is_file():
            # The sequence is at 10 Hz and lacks the recording's first step.
            changes = np.flatnonzero(np.diff(one["TrueZ"].ravel().astype(int))) + 2
            found.append(Trial(path.stem, 12 * changes, read_amc(path, skeleton)))
        else:
            changes = np.flatnonzero(np.diff(one["TrueZ"].ravel().astype(int))) + 1
            steps = np.arange(len(one["X"]))
            angles = [np.interp(np.arange(12 * len(steps)) / 12.0, steps, column) for column in one["X"].T]
            found.append(Trial(f"{path.stem} angles", 12 * changes, angles=np.radians(angles).T))
    for path in sorted(folder.glob("4ch/*.csv")):
        if path.stem not in ("86_01", "86_10"):
            angles = np.unwrap(np.radians(np.loadtxt(path, delimiter=",")[:, :4]), axis=0)
            found.append(Trial(f"{path.stem} angles", best[path.stem[-2:]], angles=angles))
    return found


def agreement(data: Path) -> Array:
    """How far the borders of one source of labels are from the nearest of another, s, of the same trials of CMU 86."""
    apart: list[Array] = []
    for path in sorted((data / "cmu" / "86" / "4ch").glob("*.csv")):
        others = np.flatnonzero(np.diff(np.loadtxt(path, delimiter=",")[:, 4])) + 1
        labels = read_labels(data / "cmu" / "86" / "labels" / f"barbic_{path.stem[-2:]}_ground_truth.txt")
        apart.append(errors(others, labels.borders[:, 1]))
    return np.concatenate(apart)


def _summary(off: Array) -> str:
    near, far = np.mean(off <= NEAR), np.mean(off <= FAR)
    return f"median {np.median(off):.2f} s, within {NEAR:g} s {near:.0%}, {FAR:g} s {far:.0%}"


def main(
    data: Annotated[Path, typer.Argument(help="The folder of recordings, with cmu/86, cmu/13 and cmu/mocap6.")],
    method: Annotated[list[str] | None, typer.Option("--method", help=f"Of {', '.join(METHODS)}.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    rows = []
    trials = trials_in(data)
    for name in method or METHODS:
        for trial in trials:
            found = METHODS[name](trial)
            row = {"method": name, "trial": trial.name, "chosen_on": trial.name in CHOSEN_ON, "labels": len(trial.best)}
            row |= {"borders_s": (found / RATE).round(2).tolist(), "errors_s": errors(found, trial.best).tolist()}
            rows.append(row | {"f1_near": f1(found, trial.best, NEAR), "f1_far": f1(found, trial.best, FAR)})
    labels_apart = agreement(data)
    if as_json:
        print(json.dumps({"rows": rows, "labels_apart_s": labels_apart.tolist()}))
        return
    for row in rows:
        print(
            f"{row['method']:<8}{row['trial']:<14}{len(row['borders_s']):3d} of {row['labels']:2d} borders, F1 within "
            f"{NEAR:g} s {row['f1_near']:.2f}, {FAR:g} s {row['f1_far']:.2f}; {_summary(np.array(row['errors_s']))}"
        )
    for name in method or METHODS:
        for words, chosen in (("chosen on", True), ("reported on", False)):
            for kind in ("whole bodies", "angles"):
                some = [
                    row
                    for row in rows
                    if row["method"] == name
                    and row["chosen_on"] is chosen
                    and ("angles" in row["trial"]) is (kind == "angles")
                ]
                off = np.concatenate([row["errors_s"] for row in some])
                mean = [float(np.mean([row[key] for row in some])) for key in ("f1_near", "f1_far")]
                print(f"{name}, {kind} {words} ({len(off)} labels): {_summary(off)}; F1 {mean[0]:.2f}, {mean[1]:.2f}")
    print(f"two people's labels of CMU 86 ({len(labels_apart)}): {_summary(labels_apart)}")


if __name__ == "__main__":
    command.run("cuts", main, __doc__)
