"""From a recipe to a motion library: read, close the loops, train, test, and try the next seed if a motion fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from threadpoolctl import threadpool_limits

from controller.errors import FileFormatError, MotiondeckError
from controller.evaluation.accuracy import nrmse
from controller.evaluation.matching import joint_features
from controller.mocap.bone_directions import LEFT, TURN_RATE, BoneDirections
from controller.mocap.clip import Clip
from controller.mocap.normalisation import Normalisation
from controller.mocap.reading import read_clip
from controller.rotations import Array
from controller.training.conceptor_training import ConceptorRecipe, train_conceptors
from controller.training.echo_state_training import train_echo_state
from controller.training.lesson import Lesson
from controller.training.library import VERSION, LibraryInfo, MotionInfo, MotionLibrary, Network, describe_skeleton
from controller.training.loops import close_loop, hold_end
from controller.training.recipe import LibraryRecipe, MotionRecipe
from controller.training.self_test import Verdict, self_test

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Syllabus:
    """The frames that a recipe wants learned.

    Attributes:
        encoding: of the channels.
        rate: frames per second.
        frames: what each motion is learned from, shape (T, channels), in the encoding's units.
        loops: whether it is a loop.
    """

    encoding: BoneDirections
    rate: float
    frames: dict[str, Array]
    loops: dict[str, bool]


def fit(recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None) -> MotionLibrary:
    """Trains the library of a recipe from the recordings in a folder.

    Args:
        recipe: what to train.
        data: the folder that the recipe's files lie in.
        progress: is told each step in a few words; there are `steps(recipe)` of them without retries.

    Returns:
        The library of the first seed with which every motion passes the self-test; where none does, that of the seed
        with which most do.

    Raises:
        MotiondeckError: if a recording is missing or damaged.
    """
    syllabus = prepare(recipe, data, progress)
    normalisation = Normalisation.fit(list(syllabus.frames.values()))
    lessons = [
        Lesson(name, normalisation.apply(frames), syllabus.loops[name]) for name, frames in syllabus.frames.items()
    ]
    best: tuple[int, int, Network, dict[str, Verdict]] | None = None
    # Two BLAS threads on a busy machine wait for each other longer than they help.
    with threadpool_limits(1):
        for seed in recipe.seeds:
            progress(f"training (seed {seed})")
            if isinstance(recipe.network, ConceptorRecipe):
                network: Network = train_conceptors(lessons, normalisation, recipe.network, seed)
            else:
                network = train_echo_state(lessons, normalisation, recipe.network, seed)
            progress("self-test")
            verdicts = self_test(network, syllabus.encoding, syllabus.frames, syllabus.loops)
            passed = sum(verdict.passed for verdict in verdicts.values())
            if best is None or passed > best[0]:
                best = (passed, seed, network, verdicts)
            if passed == len(lessons):
                break
    if best is None:
        raise MotiondeckError(f"recipe '{recipe.name}' names no seed")
    _, seed, network, verdicts = best
    info = LibraryInfo(
        version=VERSION,
        name=recipe.name,
        network="conceptor" if isinstance(recipe.network, ConceptorRecipe) else "echo-state",
        encoding="bone directions",
        rate=syllabus.rate,
        seed=seed,
        motions=[
            _motion_info(motion, syllabus, network, verdicts[motion.name], recipe.network.anchor_every)
            for motion in recipe.motions
        ],
        skeleton=describe_skeleton(syllabus.encoding),
        recipe=msgspec.json.decode(msgspec.json.encode(recipe)),
        licence=recipe.licence,
        acknowledgement=recipe.acknowledgement,
        leak=1.0 if isinstance(recipe.network, ConceptorRecipe) else recipe.network.leak,
    )
    return MotionLibrary(info, network, syllabus.encoding)


def steps(recipe: LibraryRecipe) -> int:
    """How many steps a fit takes when the first seed passes."""
    return len(recipe.motions) + 2


def prepare(recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None) -> Syllabus:
    """Reads a recipe's recordings, carries them to one body, and closes their loops or holds their ends."""
    body = read_clip(_find(data, recipe.body)).skeleton
    encoding = BoneDirections(body)
    frames: dict[str, Array] = {}
    rates: set[float] = set()
    for motion in recipe.motions:
        progress(f"reading {motion.name}")
        clip = _cut(read_clip(_find(data, motion.file)), motion).carried_to(body)
        rates.add(clip.rate)
        channels = encoding.encode(clip)
        if motion.plays == "loop":
            features = joint_features(encoding, channels)
            frames[motion.name] = close_loop(channels, features, at_least=recipe.loop_keeps)
        else:
            frames[motion.name] = hold_end(channels, slice(TURN_RATE, LEFT + 1))
    if len(rates) > 1:
        raise FileFormatError(f"recipe '{recipe.name}' mixes frame rates: {sorted(rates)} Hz")
    loops = {motion.name: motion.plays == "loop" for motion in recipe.motions}
    return Syllabus(encoding, rates.pop(), frames, loops)


def _find(data: Path, file: str) -> Path:
    """A recording below the data folder, or directly in it."""
    for path in (data / file, data / Path(file).name):
        if path.exists():
            return path
    raise FileFormatError(f"{data / file}: there is no such file; --data is the folder that holds the recordings")


def _cut(clip: Clip, motion: MotionRecipe) -> Clip:
    if motion.frames is None:
        return clip
    first, end = motion.frames
    if not 0 <= first < end <= len(clip):
        raise FileFormatError(f"motion '{motion.name}': frames {first} to {end} are not in a clip of {len(clip)}")
    return replace(clip, root_position=clip.root_position[first:end], rotation=clip.rotation[first:end])


def _motion_info(
    motion: MotionRecipe, syllabus: Syllabus, network: Network, verdict: Verdict, anchor_every: int
) -> MotionInfo:
    taught = syllabus.frames[motion.name][::anchor_every]
    return MotionInfo(
        name=motion.name,
        plays=motion.plays,
        frames=len(syllabus.frames[motion.name]),
        source=motion.file,
        nrmse=nrmse(network.recall(motion.name), taught),
        error_mm=verdict.error_mm,
        passed=verdict.passed,
        reason=verdict.reason,
    )
