"""Labelled recordings: a folder for each class, and a skeleton for each actor.

The class of a recording is the name of its folder. Its skeleton is the .asf file in its folder or one above (up to the
folder of the set) whose name begins the recording's name (HDM_bd.asf for HDM_bd_squat_001.amc), else the only one
there. Each skeleton is one actor.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import Clip
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.reading_options import ReadingOptions
from motiondeck_base.errors import FileFormatError, MotiondeckError

SHORTEST = 4


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
    def labels(self) -> NDArray[np.int64]:
        """The class of each example, an index into `classes`."""
        return np.array([self.classes.index(example.label) for example in self.examples])

    @cached_property
    def actors(self) -> NDArray[np.int64]:
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
