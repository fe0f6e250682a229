# pyright: strict
"""Motion libraries: learned from recordings, loaded by name or path, generating motion at any rate and tempo."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.deck.motion_generator import MotionGenerator, generate, generate_clip
from controller.library.motion_library import MotionLibrary, save_library
from controller.library.motion_library import load_library as load_library_file
from controller.mocap.clip import Clip
from controller.mocap.skeleton import Skeleton
from controller.training.fit import fit
from controller.training.recipe import LibraryRecipe, MotionRecipe, NetworkRecipe, check_recipe, read_recipe
from controller.training.reservoirs.conceptor_training import ConceptorRecipe
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library

__all__ = ["Library", "MotionGenerator", "learn", "learn_recipe", "load_library"]

Recordings = Mapping[str, str | Path] | Sequence[str | Path]


@dataclass(frozen=True)
class Library:
    """Motions that a network has learned; made by `learn` or `load_library`.

    Attributes:
        model: all that is in the file: networks, skeleton, provenance, results of the self-test.
    """

    model: MotionLibrary

    def __repr__(self) -> str:
        return f"Library({self.name!r}, motions={list(self.motions)})"

    @property
    def name(self) -> str:
        """What the library is called."""
        return self.model.info.name

    @property
    def motions(self) -> tuple[str, ...]:
        """The names of the motions."""
        return self.model.network.motions

    @property
    def loops(self) -> tuple[str, ...]:
        """The names of the motions that go on for ever; the others are one-shots, which end in a pose and hold it."""
        return tuple(motion.name for motion in self.model.info.motions if motion.plays == "loop")

    @property
    def failed(self) -> dict[str, str]:
        """The motions that did not pass the self-test after training, and why."""
        return {motion.name: motion.reason for motion in self.model.info.motions if not motion.passed}

    @property
    def rate(self) -> float:
        """Frames per second at which the motions were learned, Hz."""
        return self.model.info.rate

    @property
    def skeleton(self) -> Skeleton:
        """Whose motions these are."""
        return self.model.skeleton

    def generate(
        self, motion: str, *, seconds: float, rate: float | None = None, tempo: float = 1.0, phase: float = 0.0
    ) -> NDArray[np.float64]:
        """A motion as an array of the network's channels.

        Args:
            motion: its name.
            seconds: how long.
            rate: frames per second, Hz; the library's own where none is given.
            tempo: 1 is as fast as recorded.
            phase: where in the motion to begin, in [0, 1).

        Returns:
            Shape (round(seconds * rate), C). For a human body: height of the root (m), turn rate (rad/s), forward and
            left velocity (m/s), then the unit vector of each bone (docs/library-format.md).

        Raises:
            MotiondeckError: if there is no such motion (it names the nearest), or a number is impossible.
        """
        return generate(self.model, motion, seconds, rate or self.rate, tempo=tempo, phase=phase)

    def generate_clip(
        self, motion: str, *, seconds: float, rate: float | None = None, tempo: float = 1.0, phase: float = 0.0
    ) -> Clip:
        """The same as a clip of the library's skeleton: to be retargeted, recognized, or saved as BVH."""
        return generate_clip(self.model, motion, seconds, rate or self.rate, tempo=tempo, phase=phase)

    def generator(self, motion: str, *, tempo: float = 1.0, phase: float = 0.0) -> MotionGenerator:
        """The same step by step: `step(dt)` goes dt seconds on and gives the channels there, shape (C,)."""
        return MotionGenerator(self.model, motion, tempo=tempo, phase=phase)

    def save(self, path: str | Path) -> None:
        """Writes the library into one file (.safetensors), whole or not at all.

        Raises:
            MotiondeckError: if the folder cannot be written.
        """
        save_library(self.model, Path(path))


def load_library(name: str | Path) -> Library:
    """A shipped library by its name ("thesis15", "cmu86"), or one of your own by its path.

    Raises:
        MotiondeckError: if there is no such library (it names the nearest) or the file is damaged.
    """
    return Library(load_library_file(find_library(name)))


def learn(
    recordings: Recordings,
    *,
    name: str,
    network: NetworkRecipe | None = None,
    one_shots: Collection[str] = (),
    seeds: Sequence[int] = (0, 1, 2, 3, 4),
    licence: str = "",
    progress: Callable[[str], None] = lambda _: None,
) -> Library:
    """Learns a library from recordings, all of one frame rate and one kind of skeleton.

    Args:
        recordings: the file of each motion by the motion's name, or files that are named like their motions. The
            skeleton of the first is the body that all are carried to.
        name: of the library.
        network: its kind and sizes: a `ConceptorRecipe` (also the default), `EchoStateRecipe`, `RandomFeatureRecipe`,
            `PhaseRecipe` or `CentralizedRecipe` of `motiondeck.networks`.
        one_shots: the motions that end in a pose and hold it; all others become loops.
        seeds: tried in turn until every motion passes the self-test; see `Library.failed`.
        licence: terms of the recordings, kept in the file.
        progress: called with each step in a few words.

    Raises:
        MotiondeckError: if there is no recording, one cannot be read, or they do not fit each other.
    """
    if isinstance(recordings, str | Path):
        raise MotiondeckError(f"learn takes several recordings, as in learn(['{recordings}'], name='...')")
    files = (
        {Path(file).stem: Path(file) for file in recordings}
        if isinstance(recordings, Sequence)
        else {motion: Path(file) for motion, file in recordings.items()}
    )
    for motion in one_shots:
        if motion not in files:
            raise MotiondeckError(f"one_shots names '{motion}', which is not among the motions {', '.join(files)}")
    if not files:
        raise MotiondeckError("there are no recordings to learn from")
    motions = [
        MotionRecipe(name=motion, file=str(file.absolute()), plays="once" if motion in one_shots else "loop")
        for motion, file in files.items()
    ]
    recipe = LibraryRecipe(
        name=name,
        network=network or ConceptorRecipe(),
        motions=motions,
        body=motions[0].file,
        seeds=list(seeds),
        licence=licence,
    )
    return Library(fit(check_recipe(recipe, Path(name)), Path(), progress))


def learn_recipe(recipe: str | Path, data: str | Path, progress: Callable[[str], None] = lambda _: None) -> Library:
    """Learns the library of a recipe file (TOML, as in configs/libraries) from the recordings in a folder.

    Raises:
        MotiondeckError: if the recipe is wrong, or a recording is missing or damaged; it names file and place.
    """
    return Library(fit(read_recipe(Path(recipe)), Path(data), progress))
