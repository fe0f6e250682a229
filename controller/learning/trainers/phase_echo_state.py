"""Trains phase-driven echo-state networks: ridge readouts from the states that follow from the phase alone.

The channels are not fed back, so the states in playing are known before training, and one regression a piece suffices.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec

from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons, TrainingMotion
from controller.learning.trainers.clip import TRAINER as CLIPS
from controller.learning.trainers.clip import ClipRecipe, error_mm, keys_within
from controller.learning.trainers.phase_driven import PhaseDrivenRecipe, PhaseDrivenTrainer, course_of
from controller.learning.trainers.trainer import NewMotion, SettledNetwork
from controller.motion.rotations import Array
from controller.networks.phase_echo_state.network import KEYED_RIDGE, PhaseEchoStateMotion, PhaseEchoStateNetwork
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from controller.networks.reservoirs.phase_reservoir import PhaseReservoir

NEURONS_SHARE = 0.06  # of a tolerance, within which N neurons play what keys draw: the errors add up as squares
KEYED_TRIES, CLOSER = 10, 0.999  # tries to find keys, and how much nearer each is than would just do


class PhaseEchoStateRecipe(PhaseDrivenRecipe, frozen=True, kw_only=True, tag="phase-echo-state"):
    """The parameters of a phase-driven echo-state network: those that both kinds have."""

    neurons: int = 100
    harmonics: int = 4
    spectral_radius: float = 0.9
    drive_scale: float = 0.2  # with 1 a motion between two values overshoots by a fifth


class PhaseEchoStateTrainer(PhaseDrivenTrainer[PhaseEchoStateRecipe]):
    """Trains phase-driven echo-state networks."""

    recipe = PhaseEchoStateRecipe
    plays = PhaseEchoStateNetwork
    sizes = tuple({"neurons": neurons} for neurons in (20, 28, 40, 55, 75, 100, 140, 200, 280, 400))

    def unread(
        self, recipe: PhaseEchoStateRecipe, motion: TrainingMotion, reservoir: PhaseReservoir, rate: float
    ) -> PhaseEchoStateMotion:
        course = course_of(motion, recipe.piece_seconds * rate)
        return PhaseEchoStateMotion.unread(motion.frames.shape[1], course, reservoir, motion.driving)

    def sized(
        self, recipe: PhaseEchoStateRecipe, lessons: Lessons, seed: int, judge: Judge, progress: Callable[[str], None]
    ) -> PhaseEchoStateRecipe:
        """The recipe with the fewest neurons that play what the keys of a clip within the tolerance draw."""
        if (tolerance := recipe.tolerance_mm) is None:
            return recipe
        clip = CLIPS.settle(ClipRecipe(tolerance_mm=tolerance), lessons, seed, judge).network
        drawn = [
            one if one.driving else replace(one, frames=lessons.normalisation.apply(clip.anchors(one.name)))
            for one in lessons.motions
        ]
        frames = {one.name: lessons.normalisation.invert(one.frames) for one in drawn}
        near = Judge(judge.encoding, frames, judge.loops, judge.rate)
        strict = msgspec.structs.replace(recipe, tolerance_mm=NEURONS_SHARE * tolerance, ridge=KEYED_RIDGE)
        neurons = super().sized(strict, replace(lessons, motions=drawn), seed, near, progress).neurons
        return msgspec.structs.replace(recipe, neurons=neurons)

    def settle(self, recipe: PhaseEchoStateRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        if (tolerance := recipe.tolerance_mm) is None:
            return super().settle(recipe, lessons, seed, judge)
        network = self.train(recipe, lessons, seed)
        to, free = lessons.normalisation.invert, (one for one in lessons.motions if one.driving is None)
        keyed = {one.name: _keyed(network[one.name], one.name, judge, to(one.frames), tolerance) for one in free}
        return SettledNetwork(network.with_motions(keyed))

    def add(
        self, recipe: PhaseEchoStateRecipe, network: PhaseDrivenNetwork[Any], motion: NewMotion
    ) -> PhaseDrivenNetwork[Any]:
        added = super().add(recipe, network, motion)
        if recipe.tolerance_mm is None:
            return added
        name = motion.name
        return added.with_motions({name: _keyed(added[name], name, motion.judge, motion.frames, recipe.tolerance_mm)})


def _keyed(
    motion: PhaseEchoStateMotion, name: str, judge: Judge, frames: Array, tolerance_mm: float
) -> PhaseEchoStateMotion:
    """The motion that has learned frames (T, C), stored by the keys with the fewest bytes within a tolerance."""
    course, within = motion.course, tolerance_mm
    pieces = int(course.piece[-1]) + 1
    found = motion
    for _ in range(KEYED_TRIES):
        found = motion.reading(keys_within(within, frames, judge, name, loop=course.loop, pieces=pieces))
        if (error := error_mm(judge, name, found.read())) <= tolerance_mm:
            break
        within *= CLOSER * tolerance_mm / error  # what the network plays is a little farther off than what keys draw
    return found


TRAINER = PhaseEchoStateTrainer()
