"""The body from measured hands and head: with memory, without, by clips.

Three times a third of the recordings of a motion is held back, one or two of each person, and the others are learned;
with --people all recordings of each person in turn are held back.
Hands and head are measured relative to the hips, in their heading, without noise and with 20 mm of it (the learned ones
too). The error is the mean distance of the joints that are not measured, mm. `mean` is that over recordings, with the
least and the most of the seeds; `network nearest` counts the recordings in which the network with memory is nearer than
all others (its mean over seeds).

- *no memory*: the same network without recurrence and time constant, a function of the present measurement.
- *window*: random features of the measurements of the last 0.4 s, a function of a table of the past.
- *clips*: the moments of the recordings that are nearest in the measurements of the last 0.4 s, mixed.
- *frames*: the same by the present measurement.

Settings were chosen on jogs, sneaks and walks (--chosen-on measures those); the other motions are reported.

    python -m benchmarks measured_joints --data DIR [--seeds 51 --seeds 52 --seeds 53] [--people] [--chosen-on]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks import command
from controller.learning.reservoirs.completion_training import CompletionRecipe, learn_completion
from controller.motion.canonical.canonical_body import carried, to_canonical
from controller.motion.canonical.clip_edits import resampled
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array

RATE = 60.0
SEEDS = (51, 52, 53)
MEASURED = ("head", "rhan", "lhan")
NOISES_MM = (0.0, 20.0)
SKIPPED = 0.25  # s at the beginning, when no past is known

WITH_MEMORY = CompletionRecipe()
NO_MEMORY = CompletionRecipe(spectral_radius=0.0, memory_seconds=0.0)
WINDOW = CompletionRecipe(spectral_radius=0.0, memory_seconds=0.0, ridge=0.01)
WINDOW_SECONDS, LAGS, VOICES = 0.4, 6, 8

REPORTED = ("squat1Reps", "kickLFront1Reps", "hopBothLegs1hops", "elbowToKnee1RepsLelbowStart")
REPORTED += ("rotateArmsBothBackward1Reps",)
CHOSEN_ON = ("jogLeftCircle4StepsRstart", "sneak2StepsLStart", "walks")
WALKS = ("02_01", "02_02", "02_03", "07_01", "07_02", "08_01", "08_02", "08_03", "35_01", "35_02", "35_05")


@dataclass(frozen=True)
class Recorded:
    """A recording: who made it, what is measured (T, C) and the joints that are not (T, D), mm."""

    person: str
    measured: Array
    rest: Array


def recorded(data: Path, motion: str, noise_mm: float) -> list[Recorded]:
    """All recordings of a motion on one body."""
    if motion == "walks":
        paths = [data / "cmu" / name[:2] / f"{name}.amc" for name in WALKS]
    else:
        paths = sorted((data / "hdm05" / motion).iterdir())
    clips = [resampled(read_clip(path), RATE) for path in paths]
    encoding = encoding_of(to_canonical(clips[0]).skeleton)
    bones = encoding.skeleton.bones
    seen = [3 * bones.index(name) + axis for name in MEASURED for axis in range(3)]
    rng = np.random.default_rng(1)
    found: list[Recorded] = []
    for path, clip in zip(paths, clips, strict=True):
        joints = joint_features(encoding, encoding.encode(carried(clip, encoding.skeleton)))[:, :-1]
        measured = joints[:, seen] + noise_mm * rng.standard_normal((len(joints), len(seen)))
        person = path.name[4:6] if motion != "walks" else path.name[:2]
        found.append(Recorded(person, measured, np.delete(joints, seen, axis=1)))
    return found


def with_past(measured: Array, seconds: float) -> Array:
    """What was measured at moments up to so long ago, shape (T, LAGS C); (T, C) for 0 s."""
    back = np.round(np.linspace(0.0, seconds * RATE, LAGS if seconds else 1)).astype(int)
    return np.concatenate([measured[np.maximum(np.arange(len(measured)) - k, 0)] for k in back], axis=1)


def by_network(
    learned: Sequence[Recorded], held: Sequence[Recorded], recipe: CompletionRecipe, seed: int, past: float = 0.0
) -> list[Array]:
    """The joints by a network; one that has the past in its input, if that is so long."""

    def given(one: Recorded) -> Array:
        return with_past(one.measured, past)

    network = learn_completion([(given(one), one.rest) for one in learned], RATE, recipe=recipe, seed=seed)
    return [network.complete(given(one)) for one in held]


def by_clips(learned: Sequence[Recorded], held: Sequence[Recorded], past: float) -> list[Array]:
    """The joints of the moments whose past of that length is nearest, weighted by their nearness."""
    seen = np.concatenate([with_past(one.measured, past) for one in learned])
    rest = np.concatenate([one.rest for one in learned])
    found: list[Array] = []
    for one in held:
        asked = with_past(one.measured, past)
        apart = np.square(asked).sum(1)[:, None] + np.square(seen).sum(1) - 2.0 * asked @ seen.T
        best = np.argpartition(apart, VOICES, axis=1)[:, :VOICES]
        share = 1.0 / np.maximum(np.take_along_axis(apart, best, axis=1), 1e-6)
        found.append(((share / share.sum(1, keepdims=True))[..., None] * rest[best]).sum(1))
    return found


Way = Callable[[Sequence[Recorded], Sequence[Recorded], int], list[Array]]
WAYS: dict[str, Way] = {
    "network": lambda learned, held, seed: by_network(learned, held, WITH_MEMORY, seed),
    "no memory": lambda learned, held, seed: by_network(learned, held, NO_MEMORY, seed),
    "window": lambda learned, held, seed: by_network(learned, held, WINDOW, seed, WINDOW_SECONDS),
    "clips": lambda learned, held, _: by_clips(learned, held, WINDOW_SECONDS),
    "frames": lambda learned, held, _: by_clips(learned, held, 0.0),
}


def errors(recordings: Sequence[Recorded], way: Way, seed: int, *, people: bool) -> Array:
    """Of each recording while it is held back, mean distance of its joints, mm."""
    found = np.zeros(len(recordings))
    persons = [one.person for one in recordings]
    folds = persons if people else [f"{persons[:k].count(person) % 3}" for k, person in enumerate(persons)]
    for fold in sorted({*folds}):
        group = [k for k, own in enumerate(folds) if own == fold]
        learned = [one for k, one in enumerate(recordings) if k not in group]
        for k, told in zip(group, way(learned, [recordings[k] for k in group], seed), strict=True):
            off = (told - recordings[k].rest)[round(SKIPPED * RATE) :].reshape(-1, recordings[k].rest.shape[1] // 3, 3)
            found[k] = np.linalg.norm(off, axis=-1).mean()
    return found


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    seeds: Annotated[list[int] | None, typer.Option(help="Of the networks.")] = None,
    people: Annotated[bool, typer.Option("--people", help="Learn from other people alone.")] = False,
    chosen_on: Annotated[bool, typer.Option("--chosen-on", help="The motions that settings were chosen on.")] = False,
) -> None:
    print(
        f"| motion (recordings) | noise, mm | {' | '.join(WAYS)} | network nearest |\n" + "|---" * (3 + len(WAYS)) + "|"
    )
    found: dict[float, list[Array]] = {noise: [] for noise in NOISES_MM}
    with threadpool_limits(1):
        for motion in CHOSEN_ON if chosen_on else REPORTED:
            for noise in NOISES_MM:
                recordings = recorded(data, motion, noise)
                means = report(motion, recordings, noise, seeds or SEEDS, people=people)
                for person in sorted({one.person for one in recordings}):
                    own = [k for k, one in enumerate(recordings) if one.person == person]
                    found[noise].append(means[:, own].mean(1))
    for noise, rows in found.items():
        compare(np.array(rows), noise)


def compare(errors_mm: Array, noise: float) -> None:
    """By how much the network with memory is nearer than each other way; rows are a person's recordings of a motion."""
    for name, other in zip(list(WAYS)[1:], errors_mm.T[1:], strict=True):
        nearer = other - errors_mm[:, 0]
        about = 1.96 * nearer.std(ddof=1) / np.sqrt(len(nearer))
        low, high = nearer.mean() - about, nearer.mean() + about
        print(
            f"noise {noise:.0f} mm: {errors_mm[:, 0].mean():.1f} mm, {name} {other.mean():.1f}; "
            f"nearer by {nearer.mean():.1f} mm (95 %: {low:.1f} to {high:.1f}, over {len(nearer)} people's motions)"
        )


def report(motion: str, recordings: Sequence[Recorded], noise: float, seeds: Sequence[int], *, people: bool) -> Array:
    """A row; the mean errors of every way in every recording, shape (ways, recordings)."""
    cells: list[str] = []
    means: list[Array] = []
    for name, way in WAYS.items():
        drawn = seeds if name in ("network", "no memory", "window") else seeds[:1]
        each = np.array([errors(recordings, way, seed, people=people) for seed in drawn])
        spread = f" ({each.mean(1).min():.1f}-{each.mean(1).max():.1f})" if len(drawn) > 1 else ""
        cells.append(f"{each.mean():.1f}{spread}")
        means.append(each.mean(0))
    nearest = int((means[0] < np.min(means[1:], axis=0)).sum())
    row = [f"{motion} ({len(recordings)})", f"{noise:.0f}", *cells, f"{nearest} of {len(recordings)}"]
    print("| " + " | ".join(row) + " |", flush=True)
    return np.array(means)


if __name__ == "__main__":
    command.run("measured_joints", main, __doc__)
