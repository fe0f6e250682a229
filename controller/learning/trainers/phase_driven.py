"""Trains phase-driven networks: the parts that both kinds share.

The phase assigns each state to a frame of the recording, so readouts are learned from the states of the playing
network. Motions are independent of each other.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar, TypeVar

import msgspec
import numpy as np

from controller.learning.measures.self_test import Judge, self_test
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.clip import held_frames
from controller.learning.trainers.trainer import NewMotion, Trainer, mabs
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.rotations import Array, Indices
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork, PhaseMotion
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY, Float32, PhaseCourse, PhaseReservoir
from controller.networks.ridge import learn_readouts
from controller.networks.storage import PhaseScales
from motiondeck_base.arrays_on_disk import on_disk, release

FEWEST_PIECE_FRAMES = 8  # a shorter piece does not determine its directions
Recipe = TypeVar("Recipe", bound="PhaseDrivenRecipe")
OneMotion = TypeVar("OneMotion", bound=PhaseMotion)


class PhaseDrivenRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The parameters that both phase-driven networks have."""

    neurons: int  # N
    harmonics: int  # H of the phase
    spectral_radius: float  # of W
    phase_scale: float = 3.0  # of W_phi
    bias_scale: float = 0.8  # of b
    piece_seconds: float = 1.5  # approximate duration of the pieces of a motion, s
    ridge: float = 1e-3  # gamma of all regressions
    drive_scale: float = 1.0  # of W_u, if a motion has an input besides the phase
    tolerance_mm: float | None = None  # selects the smallest size with which no motion has a larger error, mm
    anchor_every = ANCHOR_EVERY

    def scales(self, *, driven: bool) -> PhaseScales:
        """The scales of the shared weights; driven, if a motion has an input besides the phase."""
        drive = self.drive_scale if driven else 0.0
        sizes = self.neurons, self.harmonics, self.spectral_radius
        return PhaseScales(*sizes, 0.0, self.phase_scale, self.bias_scale, drive, leads_in=True)


def course_of(motion: TrainingMotion, piece_frames: float) -> PhaseCourse:
    """The course of the phase for pieces of about `piece_frames`; a motion with an input is one piece."""
    frames, piece_frames = len(motion.frames), max(piece_frames, FEWEST_PIECE_FRAMES)
    if motion.driving is not None:
        return PhaseCourse.of(frames, 1, loop=True)
    if not motion.loop:
        held = held_frames(motion.frames, loop=False)
        return PhaseCourse.of(frames, max(1, round((frames - held) / piece_frames)), loop=False, held=held)
    # A loop of half turns closes after an even number of them.
    pieces = 2 * round(0.5 * frames / piece_frames)
    return replace(PhaseCourse.of(frames, max(1, pieces), loop=True), turn=motion.turn)


def settled_lesson(unread: PhaseMotion, motion: TrainingMotion) -> tuple[Float32, Array, Indices]:
    """The states in which a motion settles at each value of its input, (T, k), their frames and pieces.

    The frames, (T, C), are normalised.
    """
    if (driving := motion.driving) is not None:
        states = np.concatenate([unread.settled_at(driving.level(variant.value)) for variant in motion.variants])
        frames = np.concatenate([variant.frames for variant in motion.variants])
        return states, frames, np.tile(unread.course.piece, len(motion.variants))
    return unread.settled_frames(motion.frames)


class PhaseDrivenTrainer(Trainer[Recipe]):
    """Trains networks that a phase drives: each motion for itself, its readouts from the settled states."""

    center_driven = takes_inputs = True
    least_range = 1.0
    plays: ClassVar[type[PhaseDrivenNetwork[Any]]]
    # Parameters of networks of rising size, whose stored size grows by about 1.4 from one to the next.
    sizes: ClassVar[tuple[dict[str, int], ...]]

    def sized(
        self, recipe: Recipe, lessons: Lessons, seed: int, judge: Judge, progress: Callable[[str], None]
    ) -> Recipe:
        """The recipe with the smallest size whose network keeps to its tolerance and passes, else with the largest.

        The tolerance is the mean distance of joints at the same phase; `progress` gets each size that is tried.
        """
        sized = recipe
        for size in [] if recipe.tolerance_mm is None else self.sizes:
            progress("trying " + ", ".join(f"{name} {value}" for name, value in size.items()))
            changes: Any = size
            sized = msgspec.structs.replace(recipe, **changes)
            verdicts = self_test(self.train(sized, lessons, seed), judge)
            if all(one.passed and one.error_mm <= (recipe.tolerance_mm or 0.0) for one in verdicts.values()):
                break
        return sized

    def readout_size(self, network: PhaseDrivenNetwork[Any], scaling: Array) -> float:
        parts = [network[name].readout[:, :, :-1] for name in network.motions]
        return float(np.mean([mabs(readout * scaling[:, None]) for readout in parts]))

    @abstractmethod
    def unread(self, recipe: Recipe, motion: TrainingMotion, reservoir: PhaseReservoir, rate: float) -> PhaseMotion:
        """One motion in a reservoir, before its readouts are learned; `rate` in Hz."""

    def learn(
        self, recipe: Recipe, one: TrainingMotion, reservoir: PhaseReservoir, normalisation: Normalisation, rate: float
    ) -> PhaseMotion:
        """One motion in a reservoir; `rate` in Hz."""
        return self.read(recipe, self.unread(recipe, one, reservoir, rate), one, normalisation)

    def read(
        self, recipe: Recipe, unread: OneMotion, motion: TrainingMotion, normalisation: Normalisation
    ) -> OneMotion:
        """A motion with the readouts of its settled states."""
        states, frames, piece = settled_lesson(unread, motion)
        release()
        return unread.reading_with(on_disk(learn_readouts(states, piece, normalisation.invert(frames), recipe.ridge)))

    def train(self, recipe: Recipe, lessons: Lessons, seed: int) -> PhaseDrivenNetwork[Any]:
        scales = recipe.scales(driven=any(one.driving is not None for one in lessons.motions))
        reservoir = PhaseReservoir.draw(scales, lessons.motions[0].frames.shape[1], seed)
        return self.plays(scales, seed, lessons.normalisation, self.learn_all(recipe, lessons, reservoir))

    def learn_all(self, recipe: Recipe, lessons: Lessons, reservoir: PhaseReservoir) -> dict[str, Any]:
        """All motions by name, in a reservoir."""
        rate, to = lessons.rate, lessons.normalisation
        return {one.name: self.learn(recipe, one, reservoir, to, rate) for one in lessons.motions}

    def add(self, recipe: Recipe, network: PhaseDrivenNetwork[Any], motion: NewMotion) -> PhaseDrivenNetwork[Any]:
        one = motion.scaled(network.normalisation)
        part = self.learn(recipe, one, network.reservoir, network.normalisation, motion.rate)
        return network.with_motions({motion.name: part})
