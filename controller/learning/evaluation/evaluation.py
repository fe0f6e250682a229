"""The subject of an evaluation: a recipe, whose networks are trained, or a library, with their recordings."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from joblib import delayed

from controller.learning.evaluation.failure_rates import Tick, gathered, train_network
from controller.learning.fit import TrainedNetwork
from controller.learning.measures.self_test import MotionVerdict, self_test
from controller.learning.recipe import LibraryRecipe, read_recipe, recipe_of
from controller.learning.trainers.trainer import TrainingError, trainer_of
from controller.learning.training_set import TrainingSet, prepare
from controller.library.motion_library import load_library
from controller.networks.clip.network import ClipPlayer
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import Jobs
from motiondeck_base.shipped import find_library


@dataclass(frozen=True)
class Evaluation:
    """A recipe (`library` is None) or a library, with the recordings that it was learned from."""

    name: str
    recipe: LibraryRecipe
    library: Path | None
    syllabus: TrainingSet

    @property
    def clips(self) -> ClipPlayer:
        """Plays the recordings; the baseline of every measure."""
        return ClipPlayer(self.syllabus.frames, self.syllabus.loops)

    @property
    def noise_note(self) -> str:
        """A note on what a disturbance of its networks reaches, or an empty string."""
        trainer = trainer_of(self.recipe.network)
        return trainer.noise_note if self.library is None else trainer.stored_noise_note

    def networks(self, seeds: Iterable[int], jobs: Jobs, tick: Tick) -> list[TrainedNetwork]:
        """The library's own network, or one trained for each seed; `tick` is called after each training."""
        if self.library is None:
            tasks = (delayed(train_network)(self.recipe, self.syllabus, seed) for seed in seeds)
            return gathered(tasks, jobs, tick)
        loaded = load_library(self.library)
        return [TrainedNetwork(loaded.info.seed, loaded.network, {}, asked=loaded.info.seed)]

    def failing(self, networks: Sequence[TrainedNetwork]) -> list[str]:
        """The motions of a library's network that are not right even when nothing disturbs them."""
        if self.library is None:
            return []
        verdicts = self_test(networks[0].network, self.syllabus.judge)
        return [name for name, verdict in verdicts.items() if not verdict.passed]

    def training_errors(
        self, seeds: Iterable[int], tick: Tick
    ) -> tuple[list[TrainingError], list[dict[str, MotionVerdict]]]:
        """Errors and self-tests of a network per seed, as of `training_error`; MotiondeckError for a library."""
        if self.library is not None:
            raise MotiondeckError(f"{self.library}: accuracy is measured in training; give the recipe (.toml) instead")
        errors, verdicts = [], []
        for seed in seeds:
            errors.append(training_error(self.recipe, self.syllabus, seed))
            verdicts.append(self_test(errors[-1].network, self.syllabus.judge))
            tick()
        return errors, verdicts


def training_error(recipe: LibraryRecipe, syllabus: TrainingSet, seed: int) -> TrainingError:
    """Trains a recipe with a seed and measures it, as tables 4.1, 4.3 and 4.5 of Deliallisi 2017."""
    trainer = trainer_of(recipe.network)
    return trainer.training_error(recipe.network, syllabus.lessons(), syllabus.frames, seed, syllabus.judge)


def read_evaluation(subject: str, data: Path) -> Evaluation:
    """Reads a recipe (.toml) or a library (by name or file), and its recordings; MotiondeckError if one is missing."""
    if not data.is_dir():
        raise MotiondeckError(f"{data}: there is no such folder; --data is the folder that holds the recordings")
    if subject.endswith(".toml"):
        path, library = Path(subject), None
        recipe = read_recipe(path)
    else:
        path = library = find_library(subject)
        recipe = recipe_of(load_library(path).info.recipe, path)
    return Evaluation(path.stem, recipe, library, prepare(recipe, data))
