"""Judges motions of a library anew against a recording."""

from pathlib import Path

import msgspec

from controller.learning.fit import judged
from controller.learning.measures.recording_errors import recorded_part
from controller.learning.recipe import LibraryRecipe, MotionRecipe, recipe_of
from controller.learning.recording_analysis import find_skeleton
from controller.learning.training_set import read_motion, to_learn
from controller.library.library_header import MotionInfo
from controller.library.motion_library import MotionLibrary
from controller.motion.reading_options import AS_FOUND
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import MotiondeckError


def judge_against(library: MotionLibrary, path: Path, file: Path) -> list[MotionInfo]:
    """The verdicts on the library's motions that were learned from a file of this name, by that file.

    `path` is for messages. MotiondeckError if no motion was learned from it alone, or it cannot be read or compared.
    """
    if not file.exists():
        raise MotiondeckError.missing(file, "file")
    recipe = recipe_of(library.info.recipe, path)
    plans = [one for one in recipe.motions if Path(one.file).name == file.name]
    if not plans:
        known = ", ".join(sorted({Path(one.file).name for one in recipe.motions}))
        raise MotiondeckError(f"{path}: no motion in it was learned from {file.name}; give one of {known}")
    return [_judge(library, path, file, recipe, plan) for plan in plans]


def _judge(library: MotionLibrary, path: Path, file: Path, recipe: LibraryRecipe, plan: MotionRecipe) -> MotionInfo:
    info = next(one for one in library.info.motions if one.name == plan.name)
    clip = read_motion(Path(), _of_file(plan, file))
    if (known_part := info.against_recording) is not None:
        first, end = known_part.from_s, known_part.to_s
    else:
        part = to_learn(library.encoding, clip, plan, library.info.rate, recipe.loop_keeps)[1]
        first, end = part.first, part.end
    body = None if info.body is None else Skeleton.restore(info.body)
    recorded = recorded_part(clip, first, end, loop=info.plays == "loop", body=body)
    if recorded is None or plan.takes or recipe.as_recorded or library.network.as_autonomous is not None:
        raise MotiondeckError(f"{path}: motion '{info.name}' has no time or no body of one recording to compare with")
    # What the self-test said stays; what the recording said is said anew.
    reason = "" if known_part is not None and info.reason == known_part.reason else info.reason
    motions = [msgspec.structs.replace(info, passed=not reason, reason=reason)]
    alone = MotionLibrary(msgspec.structs.replace(library.info, motions=motions), library.network, library.encoding)
    return judged(alone, {info.name: lambda: recorded}).info.motions[0]


def _of_file(plan: MotionRecipe, file: Path) -> MotionRecipe:
    """The recipe of a motion for a file that may lie elsewhere than when it was learned."""
    skeleton = find_skeleton(file, AS_FOUND)
    return msgspec.structs.replace(
        plan, file=str(file.absolute()), skeleton=None if skeleton is None else str(skeleton.absolute())
    )
