"""Known clips that are called unknown, and unknown ones called known.

Recognizers are trained as `recognize train` does it, in the folds of a protocol, and asked about clips of actors whom
they did not see, at other durations than recorded. Then each class in turn is left out of the training.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from controller.learning.recognition.experts import STRETCHES, committee_recipe
from controller.learning.recognition.features import FeatureRecipe, features
from controller.learning.recognition.labelled_recordings import Dataset, Protocol, folds, read_dataset
from controller.learning.recognition.recognizer import Recognizer, train_recognizer
from controller.motion.rotations import Array, Indices

DURATIONS = (0.5, 0.6, 0.85, 1.0, 1.2, 1.7, 2.0)


def trained(dataset: Dataset, learn: Indices, seed: int) -> Recognizer:
    """A recognizer of some examples."""
    some = Dataset([dataset.examples[i] for i in learn], [])
    return train_recognizer(some, FeatureRecipe(), committee_recipe(STRETCHES, seed=seed), STRETCHES)


def answers(recognizer: Recognizer, dataset: Dataset, ask: Indices) -> Array:
    """Whether each example is named rightly, and whether it is called known, shape (examples, durations, 2)."""
    found = np.zeros((len(ask), len(DURATIONS), 2))
    for row, i in enumerate(ask):
        example = dataset.examples[i]
        for column, duration in enumerate(DURATIONS):
            verdict = recognizer.verdict_on(features(example.clip, recognizer.recipe, duration))
            found[row, column] = verdict.motion == example.label, verdict.known
    return found


def main(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="A folder with one folder of recordings a motion.")],
    protocol: Annotated[Protocol, typer.Option("--protocol", help="How the recordings are split.")] = "actor-out",
    seed: Annotated[int, typer.Option("--seed", metavar="SEED", min=0, help="Of the reservoir.")] = 5,
) -> None:
    dataset = read_dataset(data)
    known: list[Array] = []
    unknown: list[Array] = []
    for learn, ask in folds(protocol, dataset.labels, dataset.actors, seed):
        known.append(answers(trained(dataset, learn, seed), dataset, ask))
        for left_out in np.unique(dataset.labels[learn]):
            others = learn[dataset.labels[learn] != left_out]
            unknown.append(answers(trained(dataset, others, seed), dataset, ask[dataset.labels[ask] == left_out]))
    print(f"{protocol}, of clips that last so many times as long as recorded")
    print("                                  " + "".join(f"{duration:7.2f}" for duration in DURATIONS))
    for said, share in (
        ("named rightly", np.concatenate(known)[..., 0].mean(0)),
        ("known, called unknown", 1.0 - np.concatenate(known)[..., 1].mean(0)),
        ("never learned, taken for known", np.concatenate(unknown)[..., 1].mean(0)),
    ):
        print(f"{said:<34}" + "".join(f"{one:7.3f}" for one in share))


if __name__ == "__main__":
    command.run("rejections", main, __doc__)
