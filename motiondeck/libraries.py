# pyright: strict
"""Motion libraries: learned from recordings, loaded by name or path, generating motion at any rate and tempo."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.deck.motion_generator import MotionGenerator, generate, generate_clip
from controller.learning.fit import fit
from controller.learning.learn import learn as learn_recordings
from controller.learning.recipe import NetworkRecipe, read_recipe, require_sizes
from controller.library.motion_library import MotionLibrary, save_library
from controller.library.motion_library import load_library as load_library_file
from controller.motion.clip import Clip
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library

__all__ = ["Library", "MotionGenerator", "learn", "learn_recipe", "load_library"]


@dataclass(frozen=True)
class Library:
    """Motions that a network has learned; made by `learn` or `load_library`.

    Attributes:
        model: all that is in the file: networks, skeleton, provenance, results of the self-test.
        left_out: the recordings that `learn` could not use, and why.
    """

    model: MotionLibrary
    left_out: dict[str, str] = field(default_factory=dict[str, str])

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
        """The names of the loops; the other motions are one-shots, which end in a pose and hold it."""
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
        self,
        motion: str,
        *,
        seconds: float,
        rate: float | None = None,
        tempo: float = 1.0,
        phase: float = 0.0,
        inputs: Mapping[str, float] | None = None,
    ) -> NDArray[np.float64]:
        """A motion as an array of the network's channels.

        Args:
            motion: its name.
            seconds: length, s.
            rate: frames per second, Hz; by default the library's own.
            tempo: 1 is as fast as recorded; negative plays backwards, where the network has a phase.
            phase: where in the motion to begin, in [0, 1].
            inputs: values of the motion's inputs besides the phase, such as {"speed": 1.4}.

        Returns:
            Shape (round(seconds * rate), C). For a human body: height of the root (m), turn rate (rad/s), forward and
            left velocity (m/s), then the unit vector of each bone (docs/library-format.md).

        Raises:
            MotiondeckError: if there is no such motion (it names the nearest), or a number is impossible.
        """
        return generate(
            self.model, motion, seconds, self.rate if rate is None else rate, tempo=tempo, phase=phase, inputs=inputs
        )

    def generate_clip(
        self,
        motion: str,
        *,
        seconds: float,
        rate: float | None = None,
        tempo: float = 1.0,
        phase: float = 0.0,
        inputs: Mapping[str, float] | None = None,
    ) -> Clip:
        """The same as a clip of the library's skeleton: to be retargeted, recognized, or saved as BVH."""
        return generate_clip(
            self.model, motion, seconds, self.rate if rate is None else rate, tempo=tempo, phase=phase, inputs=inputs
        )

    def generator(
        self, motion: str, *, tempo: float = 1.0, phase: float = 0.0, inputs: Mapping[str, float] | None = None
    ) -> MotionGenerator:
        """The same step by step: `step(dt)` advances by dt seconds and returns the channels, shape (C,)."""
        return MotionGenerator(self.model, motion, tempo=tempo, phase=phase, inputs=inputs)

    def save(self, path: str | Path) -> None:
        """Writes the library into one file (.safetensors), whole or not at all.

        Raises:
            MotiondeckError: if it has another ending, or the folder cannot be written.
        """
        if Path(path).suffix != ".safetensors":
            raise MotiondeckError(f"{path}: a library ends in .safetensors. Name the file so.")
        save_library(self.model, Path(path))


def load_library(name: str | Path) -> Library:
    """A shipped library by its name ("thesis15", "cmu86"), or one of your own by its path.

    Raises:
        MotiondeckError: if there is no such library (it names the nearest) or the file is damaged.
    """
    return Library(load_library_file(find_library(name)))


def learn(
    recordings: str | Path | Sequence[str | Path],
    *,
    name: str,
    network: NetworkRecipe | None = None,
    seeds: Sequence[int] = (0, 1, 2),
    progress: Callable[[str], None] = lambda _: None,
) -> Library:
    """Learns a library from recordings of any format, rate and skeleton, as `motiondeck learn` does.

    Still ends are trimmed, and each recording is detected as a loop or a one-shot. A recording that cannot be used is
    left out; see `Library.left_out`. To decide this yourself, use `learn_recipe`.

    Args:
        recordings: files, and folders of them; each motion has its file's name.
        name: of the library.
        network: its kind and sizes: a `PhaseRecipe`, `PhaseEchoStateRecipe`, `ConceptorRecipe`, `EchoStateRecipe`,
            `RandomFeatureRecipe` or `CentralizedRecipe` of `motiondeck.networks`; None for the default.
        seeds: tried in turn until every motion passes the self-test; see `Library.failed`.
        progress: called with a short description of each step.

    Raises:
        MotiondeckError: if there is no recording, none can be used, or no network can have these sizes.
    """
    if network is not None:
        require_sizes(network)
    paths = [recordings] if isinstance(recordings, str | Path) else recordings
    learned = learn_recordings([Path(path) for path in paths], name, network=network, seeds=seeds, progress=progress)
    left_out = {str(motion.file): motion.remedy for motion in learned.failed if not motion.plays}
    return Library(learned.library, left_out)


def learn_recipe(recipe: str | Path, data: str | Path, progress: Callable[[str], None] = lambda _: None) -> Library:
    """Learns the library of a recipe file (TOML, as in configs/libraries) from the recordings in a folder.

    Raises:
        MotiondeckError: if the recipe is wrong, or a recording is missing or damaged; it names file and place.
    """
    return Library(fit(read_recipe(Path(recipe)), Path(data), progress))
