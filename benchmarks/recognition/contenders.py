"""The rows of the benchmark's table: the proposal, ours, and all peers."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.recognition.alignment import aligned
from benchmarks.recognition.baselines import (
    conceptor_evidence,
    eros,
    frame_gaussians,
    linear_experts,
    mean_pose,
    nearest_by_warping,
)
from benchmarks.recognition.committee import A_JOINT, GROUPS, NEURONS, committee, with_model_space
from benchmarks.recognition.folds import Seeded
from benchmarks.recognition.frequency_retrieval import ALL_NUMBERS, FREQUENCIES, frequency_vector, nearest_frequencies
from benchmarks.recognition.methods import Method, Prepare, at_recorded_angles, looking_at, proposal, shared_experts
from benchmarks.recognition.motion_templates import motion_templates, relations
from benchmarks.recognition.self_organising_map import motion_strings
from benchmarks.recognition.unknown import Doubter
from controller.learning.recognition.experts import STRETCHED_LEAK, ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe, features, with_velocity
from controller.learning.recognition.labelled_recordings import Dataset, Example
from controller.motion.rotations import Array

POSITIONS = FeatureRecipe(velocity=False)
WITH_VELOCITY = FeatureRecipe()
SPARSE = FeatureRecipe(velocity=False, rate=15.0)
FIVE_JOINTS = FeatureRecipe(joints=("lfoot", "rfoot", "lwrist", "rwrist", "head"))
ANY_HEADING = FeatureRecipe(heading=False)
ROTATIONS = FeatureRecipe(kind="rotations")

ALIGNED_FRAMES = 60  # two seconds at 30 Hz

OURS = "experts (ours)"
NESTED = "experts (ours, nested choice)"
COMMITTEE = "experts (ours, a committee)"
MODEL_SPACE = "experts (ours, model space)"
PROPOSED = "proposal"


def ours(seed: int, look: FeatureRecipe = WITH_VELOCITY) -> list[Method]:
    """Our experts with their standing settings."""
    return [Method(OURS, looking_at(look), shared_experts(ExpertRecipe(seed=seed)))]


def learned_stretched(seed: int) -> Method:
    """Our experts for motions that are learned at several durations: neurons without a time constant of their own."""
    return Method(OURS, looking_at(WITH_VELOCITY), shared_experts(ExpertRecipe(leak=STRETCHED_LEAK, seed=seed)))


def candidates(seed: int) -> list[Method]:
    """The settings among which a nested choice picks."""
    out = []
    for look, neurons, ridge, leak in itertools.product(
        (POSITIONS, WITH_VELOCITY), (50, 100, 200), (0.03, 0.1, 0.3), (0.3, 1.0)
    ):
        recipe = ExpertRecipe(neurons=neurons, ridge=ridge, leak=leak, seed=seed)
        out.append(Method(f"{neurons} {ridge} {leak}", looking_at(look), shared_experts(recipe)))
    return out


def in_committee(seed: int) -> list[Method]:
    """Our experts as a committee within one reservoir, judged joint by joint."""
    return [Method(COMMITTEE, looking_at(WITH_VELOCITY), committee(ExpertRecipe(neurons=NEURONS, seed=seed)))]


def in_model_space(seed: int) -> list[Method]:
    """The committee with the votes of the clips' own readouts: what `recognize run` names clips by."""
    recipe = ExpertRecipe(neurons=NEURONS, groups=GROUPS, leak=STRETCHED_LEAK, seed=seed)
    return [Method(MODEL_SPACE, looking_at(WITH_VELOCITY), with_model_space(recipe))]


# Ways to judge among which the recognition of unknown motions chooses: groups of neurons, channels together.
WAYS_TO_JUDGE: tuple[tuple[int, int | None], ...] = ((1, None), (1, A_JOINT), (GROUPS, None), (GROUPS, A_JOINT))
LEVELS = (0.0, 0.1)


def doubters(dataset: Dataset, seed: int, ways: Sequence[tuple[int, int | None]] = WAYS_TO_JUDGE) -> list[Doubter]:
    """What may tell known motions of a dataset from unknown ones."""
    signals = [looking_at(WITH_VELOCITY)(example, 1.0) for example in dataset.examples]
    recipe = ExpertRecipe(neurons=NEURONS, seed=seed)
    scores = [committee(recipe, *way)(signals, dataset.labels, len(dataset.classes)) for way in ways]
    return [Doubter(score, level) for score in scores for level in LEVELS]


def contenders() -> dict[str, tuple[Seeded, bool]]:
    """Every method of the table by name: what it is for a seed, and whether the seed makes a difference."""

    def fixed(look: FeatureRecipe, prepare: Prepare) -> tuple[Seeded, bool]:
        return (lambda seed: [Method("", looking_at(look), prepare)]), False

    def small(seed: int) -> Sequence[Method]:
        recipe = ExpertRecipe(neurons=10, ridge=0.01, leak=1.0, seed=seed)
        return [Method("", looking_at(POSITIONS), shared_experts(recipe, centred=False))]

    def in_time(seed: int) -> Sequence[Method]:
        return [Method("", _aligned, shared_experts(ExpertRecipe(seed=seed)))]

    def evidence(seed: int) -> Sequence[Method]:
        return [Method("", looking_at(POSITIONS), conceptor_evidence(ExpertRecipe(neurons=30, leak=1.0, seed=seed)))]

    def retrieved(numbers: NDArray[np.int64]) -> tuple[Seeded, bool]:
        return (lambda seed: [Method("", frequency_vector, nearest_frequencies(numbers))]), False

    def proposed(neurons: int) -> tuple[Seeded, bool]:
        return (lambda seed: [Method("", at_recorded_angles, proposal(neurons, seed))]), True

    return {
        f"{PROPOSED}, 50 neurons": proposed(50),
        f"{PROPOSED}, 200 neurons": proposed(200),
        OURS: (ours, True),
        NESTED: (candidates, True),
        COMMITTEE: (in_committee, True),
        MODEL_SPACE: (in_model_space, True),
        "experts, positions only": (lambda seed: ours(seed, POSITIONS), True),
        "experts, 5 joints": (lambda seed: ours(seed, FIVE_JOINTS), True),
        "experts, not turned into the heading": (lambda seed: ours(seed, ANY_HEADING), True),
        "experts, rotations of bones": (lambda seed: ours(seed, ROTATIONS), True),
        "experts, clips aligned in time": (in_time, True),
        "experts, 10 neurons, raw error": (small, True),
        "conceptor evidence": (evidence, True),
        "linear experts (VAR 2), no reservoir": fixed(WITH_VELOCITY, linear_experts(2, 0.1)),
        "linear experts (VAR 4), no reservoir": fixed(WITH_VELOCITY, linear_experts(4, 1.0)),
        "nearest mean pose": fixed(POSITIONS, mean_pose),
        "Gaussian of single frames": fixed(POSITIONS, frame_gaussians()),
        "1-NN dynamic time warping": fixed(SPARSE, nearest_by_warping),
        "1-NN Eros": fixed(POSITIONS, eros),
        "1-NN frequency vectors": retrieved(FREQUENCIES),
        "1-NN frequency vectors and extents": retrieved(ALL_NUMBERS),
        "self-organising map": fixed(SPARSE, motion_strings()),
        "motion templates": ((lambda seed: [Method("", relations, motion_templates)]), False),
    }


def _aligned(example: Example, stretch: float) -> Array:
    """Joint positions and their velocities, every clip brought to the same number of frames."""
    return with_velocity(aligned(features(example.clip, POSITIONS, stretch), ALIGNED_FRAMES), POSITIONS.rate)
