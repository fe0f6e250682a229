"""Clips of an unseen actor in one stream, named frame by frame while it runs.

A committee learns the other actors, as `recognize train` does it. The clips of one actor, in random order, fade into
each other over 0.3 s, and the whole is played at three tempos. A verdict counts once it has been the same for 0.06 s. A
frame belongs to the clip with the larger share in it, and a clip is named if the verdict is right in one of its frames.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.recognition.rejections import trained
from controller.learning.recognition.features import resampled, still_features, with_velocity
from controller.learning.recognition.labelled_recordings import Dataset, read_dataset
from controller.learning.recognition.online_recognizer import OnlineRecognizer
from controller.learning.recognition.recognizer import STEADY, Recognizer
from controller.motion.rotations import Array, Indices

FADE = 0.3  # s


def stream(recognizer: Recognizer, dataset: Dataset, order: Indices, tempo: float) -> tuple[Array, Indices]:
    """Frames of one clip after the other (T, C), played at a tempo, and the example that each belongs to (T,)."""
    recipe = recognizer.recipe
    fade = round(FADE * recipe.rate)
    rising = (np.arange(fade) + 0.5)[:, None] / fade
    frames, belongs = np.zeros((0, 0)), np.zeros(0, dtype=np.int64)
    for i in order:
        clip = dataset.examples[i].clip
        own = resampled(still_features(clip, recipe), clip.rate, recipe.rate)
        if len(frames):
            both = min(fade, len(own) // 2)
            own[:both] = rising[-both:] * own[:both] + (1.0 - rising[-both:]) * frames[-both:]
            frames, belongs = frames[:-both], belongs[: len(belongs) - both // 2]
        frames = np.concatenate([frames, own]) if len(frames) else own
        belongs = np.concatenate([belongs, np.full(len(frames) - len(belongs), i)])
    played = resampled(frames, recipe.rate * tempo, recipe.rate)
    nearest = np.minimum(np.rint(np.arange(len(played)) * tempo).astype(np.int64), len(belongs) - 1)
    return with_velocity(played, recipe.rate), belongs[nearest]


def verdicts(recognizer: Recognizer, frames: Array) -> Iterator[str | None]:
    """The motion that counts at each frame, None where nothing is sure."""
    online = OnlineRecognizer(recognizer.bank, recognizer.threshold, recognizer.recipe.rate)
    counts, seen, same = None, None, 0
    for frame in frames:
        online.update(frame)
        now = online.motion if online.known else None
        same = same + 1 if now == seen else 1
        seen = now
        counts = seen if same >= STEADY * recognizer.recipe.rate else counts
        yield counts


def main(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings a motion.")],
    actor: Annotated[
        list[str] | None, typer.Option("--actor", metavar="NAME", help="Repeatable; default: all.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", metavar="SEED", min=0, help="Of reservoir and order.")] = 5,
) -> None:
    dataset = read_dataset(data)
    actors = np.array([example.actor for example in dataset.examples])
    found: dict[float, list[list[float]]] = {0.5: [], 1.0: [], 2.0: []}
    for one in actor or sorted(set(actors)):
        recognizer = trained(dataset, np.flatnonzero(actors != one), seed)
        order = np.random.default_rng(seed).permutation(np.flatnonzero(actors == one))
        for tempo, rows in found.items():
            frames, belongs = stream(recognizer, dataset, order, tempo)
            said = list(verdicts(recognizer, frames))
            right = np.array([word == dataset.examples[i].label for word, i in zip(said, belongs, strict=True)])
            unsure = np.array([word is None for word in said])
            named = np.mean([right[belongs == i].any() for i in order])
            rows.append(
                [float(one) for one in (right.mean(), unsure.mean(), 1.0 - right.mean() - unsure.mean(), named)]
            )
            print(f"{one}, tempo {tempo:g}: " + ", ".join(f"{value:.2f}" for value in rows[-1]))
    for tempo, rows in found.items():
        print(
            f"mean, tempo {tempo:g}: right, unsure, wrong, clips named "
            + ", ".join(f"{v:.2f}" for v in np.mean(rows, 0))
        )


if __name__ == "__main__":
    command.run("streams", main, __doc__)
