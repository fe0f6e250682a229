"""Labelled recordings: a folder for each class, and a skeleton for each actor; and splits of them into sets.

The class of a recording is the name of its folder. Its skeleton is the .asf file in its folder or one above (up to the
folder of the set) whose name begins the recording's name (HDM_bd.asf for HDM_bd_squat_001.amc), else the only one
there. Each skeleton is one actor.

Protocols split them into training and test sets:

actor-out   each actor is tested once, after training on the others: generalisation to a new person
one-actor   training on one actor, testing on all others: the hardest, which still separates good methods
half        training on a random half of each class, three times; the same people are in both sets
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from controller.motion.clip import Clip, ReadingOptions
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.rotations import Indices
from motiondeck_base.errors import FileFormatError, MotiondeckError

SHORTEST = 4
HALVES = 3

Protocol: TypeAlias = Literal["actor-out", "one-actor", "half"]
PROTOCOLS: tuple[Protocol, ...] = ("actor-out", "one-actor", "half")
Fold: TypeAlias = tuple[Indices, Indices]  # training and test examples


@dataclass(frozen=True, eq=False)
class Example:
    """One labelled recording."""

    clip: Clip
    label: str  # class
    actor: str  # name of the skeleton
    path: Path


@dataclass(frozen=True, eq=False)
class Dataset:
    """Labelled recordings, in the order of their paths."""

    examples: list[Example]
    skipped: list[str]  # a line for each unusable file, with the reason

    @cached_property
    def classes(self) -> list[str]:
        """The class names in alphabetical order."""
        return sorted({example.label for example in self.examples})

    @cached_property
    def labels(self) -> Indices:
        """The class of each example, an index into `classes`."""
        return np.array([self.classes.index(example.label) for example in self.examples])

    @cached_property
    def actors(self) -> Indices:
        """The actor of each example, an index into the sorted names of the actors."""
        names = sorted({example.actor for example in self.examples})
        return np.array([names.index(example.actor) for example in self.examples])


def read_dataset(folder: Path, progress: Callable[[int, int], None] = lambda done, total: None) -> Dataset:
    """Reads a folder of recordings, one folder a class; `progress` gets the number of files done and of all.

    Files that cannot be read, or are shorter than SHORTEST frames, are listed in `skipped`. MotiondeckError if there is
    no such folder, or no usable recording in it.
    """
    if not folder.is_dir():
        raise MotiondeckError(f"{folder}: there is no such folder. Check the name.")
    paths = recordings_below(folder)
    examples: list[Example] = []
    skipped: list[str] = []
    for done, path in enumerate(paths):
        progress(done, len(paths))
        try:
            if path.parent == folder:
                raise FileFormatError(f"{path}: lies beside the class folders; move it into the folder of its class.")
            skeleton = skeleton_of(path, folder)
            clip = read_clip(path, ReadingOptions(skeleton))
            if len(clip) < SHORTEST:
                raise FileFormatError(f"{path}: {len(clip)} frames are too few to learn from (at least {SHORTEST}).")
        except MotiondeckError as error:
            skipped.append(str(error))
            continue
        actor = skeleton.stem if skeleton else clip.skeleton.name
        examples.append(Example(clip, path.parent.name, actor, path))
    progress(len(paths), len(paths))
    if not examples:
        reason = f" The first problem: {skipped[0]}" if skipped else ""
        raise MotiondeckError(
            f"{folder}: no usable recording. Expected are folders named after motions with recordings in them, and for "
            f".amc files the .asf skeletons beside or above them.{reason}"
        )
    return Dataset(examples, skipped)


def folds(protocol: Protocol, labels: Indices, actors: Indices, seed: int = 0) -> list[Fold]:
    """The splits of examples with labels and actors (n,); classes that are not in the training set are not tested.

    MotiondeckError if there is only one actor and two are needed, or no test example is left.
    """
    names = np.unique(actors)
    if protocol != "half" and len(names) < 2:
        raise MotiondeckError(f"protocol '{protocol}' needs recordings of two actors or more; use 'half'.")
    if protocol == "half":
        rng = np.random.default_rng(seed)
        learned = [_half(labels, rng) for _ in range(HALVES)]
    else:
        learned = [np.flatnonzero((actors == name) == (protocol == "one-actor")) for name in names]
    out = []
    for learn in learned:
        rest = np.setdiff1d(np.arange(len(labels)), learn)
        ask = rest[np.isin(labels[rest], labels[learn])]
        if len(ask) and len(np.unique(labels[learn])) > 1:
            out.append((learn, ask))
    if not out:
        raise MotiondeckError(f"protocol '{protocol}': no split has two classes and an example to ask. Add recordings.")
    return out


def inner_folds(labels: Indices, actors: Indices, seed: int = 0) -> list[Fold]:
    """Splits of the training set for choosing parameters: by actors if there are several, else random halves."""
    return folds("actor-out" if len(np.unique(actors)) > 1 else "half", labels, actors, seed)


def _half(labels: Indices, rng: np.random.Generator) -> Indices:
    chosen = []
    for label in np.unique(labels):
        own = rng.permutation(np.flatnonzero(labels == label))
        chosen.append(own[: (len(own) + 1) // 2])
    return np.sort(np.concatenate(chosen))
