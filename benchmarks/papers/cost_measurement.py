"""Measures the cost of training and playing a network, by its size, its recordings or its motions."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from controller.learning.recipe import LibraryRecipe
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.learning.trainers.trainer import trainer_of
from controller.learning.training_set import TrainingSet
from controller.networks.base import AnyNetwork

SIZES = (300, 600, 1000, 1500)
SATELLITES = (16, 36, 64, 100)
SHARES = (0.25, 0.5, 1.0)
STEPS = 300


@dataclass(frozen=True)
class TrainingCost:
    """What one network cost.

    Attributes:
        varied: "N", "T" or "P": what differs from the recipe.
        neurons, frames, motions: N, of a centralized network its centers and satellites; how many frames were learned
            in all; P.
        training_s: processor time of one training on one core, s.
        training_mb: the most memory that arrays took meanwhile, MB.
        step_us: processor time of one frame, microseconds (median of STEPS).
        stored_mb: of the network, MB.
    """

    varied: str
    neurons: int
    frames: int
    motions: int
    training_s: float
    training_mb: float
    step_us: float
    stored_mb: float


def costs(
    recipe: LibraryRecipe, syllabus: TrainingSet, seed: int, tick: Callable[[], None] = lambda: None
) -> list[TrainingCost]:
    """The costs of a recipe with other sizes, shorter recordings and fewer motions, one seed each."""
    found = []
    for varied, plan, taught in variants(recipe, syllabus):
        found.append(measure(varied, plan, taught, seed))
        tick()
    return found


def variants(recipe: LibraryRecipe, syllabus: TrainingSet) -> Iterator[tuple[str, LibraryRecipe, TrainingSet]]:
    """What `costs` measures: what is varied, and the recipe and frames for it."""
    centralized = isinstance(recipe.network, CentralizedRecipe)
    for size in SATELLITES if centralized else SIZES:
        yield "N", _sized(recipe, size), syllabus
    names = list(syllabus.frames)
    # Of a reservoir the whole recipe is among those in which N is varied.
    shares = SHARES if centralized else SHARES[:-1]
    for share in shares:
        frames = {name: part[: max(60, int(share * len(part)))] for name, part in syllabus.frames.items()}
        yield "T", recipe, replace(syllabus, frames=frames)
    for share in shares:
        kept = names[: max(1, round(share * len(names)))]
        few = replace(
            syllabus,
            frames={name: syllabus.frames[name] for name in kept},
            before={name: part for name, part in syllabus.before.items() if name in kept},
        )
        yield "P", recipe, few


def measure(varied: str, recipe: LibraryRecipe, syllabus: TrainingSet, seed: int) -> TrainingCost:
    """Trains once for the time and once more for the memory, whose tracing takes time, and plays."""
    lessons, trainer = syllabus.lessons(), trainer_of(recipe.network)
    with threadpool_limits(1):
        began = time.process_time()
        network = trainer.train(recipe.network, lessons, seed)
        training_s = time.process_time() - began
        neurons, step_us = network.neurons, _step_us(network)
        stored = _stored_bytes(network)
        del network
        tracemalloc.start()
        trainer.train(recipe.network, lessons, seed)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    frames = sum(len(part) for part in syllabus.frames.values())
    return TrainingCost(varied, neurons, frames, len(lessons.motions), training_s, peak / 1e6, step_us, stored / 1e6)


def exponent(found: list[TrainingCost], varied: str, against: str, what: str) -> float | None:
    """The slope p of  log cost = p log size + c  over the costs in which a size was varied; None below two sizes."""
    part = [cost for cost in found if cost.varied == varied]
    if varied != "N" and part:
        # The recipe in full is one of those in which N was varied.
        part += [cost for cost in found if cost.varied == "N" and cost.neurons == part[0].neurons]
    sizes = np.array([getattr(cost, against) for cost in part], dtype=np.float64)
    if len(set(sizes)) < 2:
        return None
    values = np.array([getattr(cost, what) for cost in part])
    return float(np.polyfit(np.log(sizes), np.log(np.maximum(values, 1e-9)), 1)[0])


def _sized(recipe: LibraryRecipe, size: int) -> LibraryRecipe:
    """The recipe with so many neurons in its reservoir, or satellites for each motion."""
    name = "satellites" if isinstance(recipe.network, CentralizedRecipe) else "neurons"
    return msgspec.structs.replace(recipe, network=msgspec.structs.replace(recipe.network, **{name: size}))


def _step_us(network: AnyNetwork) -> float:
    network.cue(network.motions[0], 0)
    out = np.empty(network.channels)
    spent = np.empty(STEPS)
    for step in range(STEPS):
        began = time.perf_counter()
        network.advance(out)
        spent[step] = time.perf_counter() - began
    return 1e6 * float(np.median(spent))


def _stored_bytes(network: AnyNetwork) -> int:
    return sum(array.nbytes for array in network.arrays().values())
