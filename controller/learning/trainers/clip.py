"""Makes clips of keys, the rival of every network; how many keys and how fine, with the fewest bytes in an error."""

from functools import partial
from typing import Any

import msgspec
import numpy as np

from controller.learning.measures.self_test import Judge, distances
from controller.learning.preparation.training_motion import Lessons
from controller.learning.trainers.trainer import NewMotion, SettledNetwork, Trainer
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import FEWEST_KEYS, STEPS_PER_BIT, Keys, spline

KEYS_EVERY = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40)  # frames
COARSEST, FINEST = 2 * STEPS_PER_BIT, 13 * STEPS_PER_BIT  # steps of 2^-2 to 2^-13
TINY = 1e-9  # of a ridge: a one-shot with a key a frame has two keys more than frames
MISSED = 1.1  # times the fewest bytes so far, after which no fewer are looked for


class ClipRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, tag="clip"):
    """The parameters of a clip of keys."""

    keys_every: int = 4  # frames
    digits: int = 10  # binary digits of a key behind the point, of a direction, m, m/s or rad
    # Has each motion take the keys with the fewest bytes whose mean error is at most this, mm.
    tolerance_mm: float | None = None
    anchor_every = 1


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


def held_frames(frames: Array, *, loop: bool) -> int:
    """How many frames at the end of a one-shot, shape (T, C), hold the one before them."""
    moving = np.flatnonzero((np.diff(frames, axis=0) != 0.0).any(1))
    return 0 if loop else len(frames) - 2 - int(moving.max(initial=0))


def fitted_keys(frames: Array, every: float, *, loop: bool) -> Array:
    """The keys of least squares of frames (T, C), `every` frames apart, shape (K, C)."""
    from scipy.sparse import csr_array, eye_array  # what plays needs none of it
    from scipy.sparse.linalg import spsolve

    moving = frames[: len(frames) - held_frames(frames, loop=loop)]
    count = max(FEWEST_KEYS, round(len(moving) / every) + (0 if loop else 2))
    near, weights = spline(len(moving), count, loop=loop)
    rows = np.repeat(np.arange(len(moving)), 4)
    design = csr_array((weights.ravel(), (rows, near.ravel())), shape=(len(moving), count))
    squares = design.T @ design + TINY * eye_array(count)
    return np.asarray(spsolve(squares.tocsc(), design.T @ moving))


def error_mm(judge: Judge, motion: str, frames: Array) -> float:
    """The mean distance of joints from those of a motion at the same phase, of frames (T, C)."""
    return float(distances(joint_features(judge.encoding, frames), judge.features(motion)).mean())


def keys_within(tolerance_mm: float, frames: Array, judge: Judge, motion: str, *, loop: bool, pieces: int = 1) -> Keys:
    """The keys of a motion's frames (T, C) with the fewest bytes within a mean error; the finest if none keep to it."""
    found: Keys | None = None
    held = held_frames(frames, loop=loop)

    def keeps_to_it(keys: Keys) -> bool:
        return error_mm(judge, motion, keys.drawn(len(frames), loop=loop)) <= tolerance_mm

    for every in KEYS_EVERY:
        rounded = partial(Keys.of, fitted_keys(frames, every, loop=loop), held, pieces=pieces)
        best, low, high = rounded(FINEST), COARSEST, FINEST
        if found is not None and not keeps_to_it(best):
            break
        while high - low > 1:
            middle = (low + high) // 2
            if keeps_to_it(keys := rounded(middle)):
                best, high = keys, middle
            else:
                low = middle
        if found is None or best.packed.nbytes < found.packed.nbytes:
            found = best
        elif best.packed.nbytes > MISSED * found.packed.nbytes:
            break
    assert found is not None
    return found


TRAINER = ClipTrainer()
