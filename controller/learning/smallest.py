"""Chooses the smallest kind of network that keeps to an error, and measures the clip that does beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
from threadpoolctl import threadpool_limits

from controller.learning.measures.self_test import Judge, run_free
from controller.learning.preparation.training_motion import Lessons
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.clip import ClipRecipe
from controller.learning.trainers.phase_conceptor import PhaseConceptorTrainer, PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.trainer import NetworkRecipe, kind_of, trainer_of
from controller.learning.training_set import Progress, TrainingSet
from motiondeck_base.errors import MotiondeckError

# Sizes of the kinds that grow until they keep to the error, or are larger than another kind that does.
_GROWING: tuple[Sequence[NetworkRecipe], ...] = (
    [msgspec.structs.replace(PhaseRecipe(), **size) for size in PhaseConceptorTrainer.sizes],
    [CentralizedRecipe(satellites=count, rank="auto") for count in (20, 40, 80, 160)],
)


@dataclass(frozen=True)
class Candidate:
    """A kind of network, or the clip, with its bytes and error."""

    recipe: NetworkRecipe
    stored_bytes: int  # of its arrays in a library
    error_mm: float  # the largest mean distance of joints of a motion at the same phase
    note: str = ""  # why it is not chosen

    def __str__(self) -> str:
        note = f" ({self.note})" if self.note else ""
        return f"{kind_of(self.recipe)}: {self.stored_bytes / 1e3:.1f} kB, {self.error_mm:.2f} mm{note}"


def smallest_network(
    tolerance_mm: float, training_set: TrainingSet, seed: int, progress: Progress = lambda _: None
) -> list[Candidate]:
    """The smallest network of which no motion's mean error is larger, the other kinds that were tried, then the clip.

    MotiondeckError if none keeps to the tolerance.
    """
    lessons, judge = training_set.lessons(), training_set.judge
    keyed, clip = PhaseEchoStateRecipe(tolerance_mm=tolerance_mm), ClipRecipe(tolerance_mm=tolerance_mm)
    chosen: Candidate | None = None
    others: list[Candidate] = []
    with threadpool_limits(1):
        for sizes in ([trainer_of(keyed).sized(keyed, lessons, seed, judge, progress)], *_GROWING):
            progress(f"trying {kind_of(sizes[0])}")
            tried = _first_within(sizes, tolerance_mm, chosen.stored_bytes if chosen else None, lessons, seed, judge)
            if not tried.note:
                others += [replace(chosen, note="larger")] if chosen else []
                chosen = tried
            else:
                others.append(tried)
        progress("trying clip")
        rival = replace(_tried(clip, lessons, seed, judge), note="no network, for comparison")
    if chosen is None:
        raise MotiondeckError(f"no network keeps to {tolerance_mm:g} mm: {'; '.join(map(str, others))}")
    return [chosen, *others, rival]


def _first_within(
    sizes: Sequence[NetworkRecipe], tolerance_mm: float, most: int | None, lessons: Lessons, seed: int, judge: Judge
) -> Candidate:
    """The first of some rising sizes within a tolerance; with a note, if `most` bytes do not hold it, or none is."""
    tried: Candidate | None = None
    for recipe in sizes:
        tried = _tried(recipe, lessons, seed, judge)
        if most is not None and tried.stored_bytes >= most:
            return replace(tried, note="larger")
        if tried.error_mm <= tolerance_mm:
            return tried
    assert tried is not None
    return replace(tried, note="too far off")


def _tried(recipe: NetworkRecipe, lessons: Lessons, seed: int, judge: Judge) -> Candidate:
    network = trainer_of(recipe).settle(recipe, lessons, seed, judge).network
    errors = []
    for motion in network.motions:
        frames = len(judge.features(motion))
        errors.append(judge.at_the_same_phase(motion, run_free(network, motion, frames), frames).error_mm)
    return Candidate(recipe, network.stored_bytes, max(errors))
