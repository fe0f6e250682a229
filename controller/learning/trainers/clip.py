"""Makes clips of keys, the rival of every network: splines in a few bits."""

from typing import Any

import msgspec

from controller.learning.key_fitting import fitted_keys, held_frames, keys_within
from controller.learning.measures.self_test import Judge
from controller.learning.preparation.training_motion import Lessons
from controller.learning.trainers.trainer import NewMotion, SettledNetwork, Trainer
from controller.motion.rotations import Array
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import STEPS_PER_BIT, Keys


class ClipRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="clip"):
    """The parameters of a clip of keys."""

    keys_every: int = 4  # frames
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

    def train(self, recipe: ClipRecipe, lessons: Lessons, seed: int) -> ClipPlayer:
        return _clip(recipe, lessons, None)

    def settle(self, recipe: ClipRecipe, lessons: Lessons, seed: int, judge: Judge) -> SettledNetwork:
        return SettledNetwork(_clip(recipe, lessons, judge))

    def add(self, recipe: ClipRecipe, network: ClipPlayer, motion: NewMotion) -> ClipPlayer:
        name, loop = motion.name, motion.loop
        keys = network.keys | {name: _keys(recipe, motion.judge, name, motion.frames, loop=loop)}
        return ClipPlayer.of_keys(keys, motion.lengths | {name: len(motion.frames)}, {**network.loops, name: loop})

    def readout_size(self, network: Any, scaling: Array) -> float:
        return 0.0


def _keys(recipe: ClipRecipe, judge: Judge | None, name: str, frames: Array, *, loop: bool) -> Keys:
    if judge is not None and recipe.tolerance_mm is not None:
        return keys_within(recipe.tolerance_mm, frames, judge, name, loop=loop)
    keys, held = fitted_keys(frames, recipe.keys_every, loop=loop), held_frames(frames, loop=loop)
    return Keys.of(keys, held, recipe.digits * STEPS_PER_BIT)


def _clip(recipe: ClipRecipe, lessons: Lessons, judge: Judge | None) -> ClipPlayer:
    frames = {one.name: lessons.normalisation.invert(one.frames) for one in lessons.motions}
    loops = {one.name: one.loop for one in lessons.motions}
    keys = {name: _keys(recipe, judge, name, part, loop=loops[name]) for name, part in frames.items()}
    return ClipPlayer.of_keys(keys, {name: len(part) for name, part in frames.items()}, loops)


TRAINER = ClipTrainer()
