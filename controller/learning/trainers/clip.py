"""Makes clips of keys, the rival of every network: splines in a few bits."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from controller.learning.key_fitting import KEYS_EVERY, fitted_keys, held_frames, keys_within
from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons
from controller.learning.trainers.trainer import NewMotion, SettledNetwork, Trainer
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import STEPS_PER_BIT, Keys


class ClipRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="clip"):
    """The parameters of a clip of keys."""

    keys_every: float = 4.0  # frames
    digits: int = 10  # binary digits of a key behind the point, of a direction, m, m/s or rad
    # Has each motion take the keys with the fewest bytes whose mean error is at most this, mm.
    tolerance_mm: float | None = None

    @property
    def anchor_every(self) -> int:
        """Frames between the states at which a motion can start."""
        return 1


class ClipTrainer(Trainer[ClipRecipe]):
    """Makes clips of keys."""

    recipe = ClipRecipe
    center_driven = True
    stress_tested = False
    noise_note = stored_noise_note = "A clip has no state that noise could reach."

    def problems(self, recipe: ClipRecipe, motions: Sequence[str]) -> Iterator[str]:
        if recipe.keys_every < KEYS_EVERY[0]:
            yield f"network.keys_every is {recipe.keys_every}; {KEYS_EVERY[0]} frames are the fewest"

    def train(self, recipe: ClipRecipe, lessons: Lessons, seed: int) -> AnyNetwork:
        return _clip(lessons, lambda _, frames, loop: _plain(recipe, frames, loop=loop))

    def settle(self, recipe: ClipRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        if recipe.tolerance_mm is None:
            return super().settle(recipe, lessons, seed, judge)
        return SettledNetwork(clip_within(recipe.tolerance_mm, lessons, judge))

    def add(self, recipe: ClipRecipe, network: ClipPlayer, motion: NewMotion) -> AnyNetwork:
        keys = network.keys | {motion.name: _plain(recipe, motion.frames, loop=motion.loop)}
        lengths = motion.lengths | {motion.name: len(motion.frames)}
        return ClipPlayer.of_keys(keys, lengths, {**network.loops, motion.name: motion.loop})

    def readout_size(self, network: Any, scaling: Array) -> float:
        return 0.0


def clip_within(tolerance_mm: float, lessons: Lessons, judge: Judge) -> ClipPlayer:
    """The smallest clip of keys of which no motion has a larger mean error."""

    return _clip(lessons, lambda name, frames, loop: keys_within(tolerance_mm, frames, judge, name, loop=loop))


def _plain(recipe: ClipRecipe, frames: Array, *, loop: bool) -> Keys:
    keys, held = fitted_keys(frames, recipe.keys_every, loop=loop), held_frames(frames, loop=loop)
    return Keys.of(keys, held, recipe.digits * STEPS_PER_BIT)


def _clip(lessons: Lessons, keys_of: Callable[[str, Array, bool], Keys]) -> ClipPlayer:
    motions = [(one.name, lessons.normalisation.invert(one.frames), one.loop) for one in lessons.motions]
    keys = {name: keys_of(name, frames, loop) for name, frames, loop in motions}
    lengths, loops = {name: len(frames) for name, frames, _ in motions}, {name: loop for name, _, loop in motions}
    return ClipPlayer.of_keys(keys, lengths, loops)


TRAINER = ClipTrainer()
