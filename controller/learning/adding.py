"""Adds one motion to a library that has been trained, and leaves what is stored as it is.

The new motion is learned from its clip alone: a network whose motions share their reservoir gets one more conceptor or
readout, a centralized one one more motion.
It then has to pass the self-test beside the stored ones, which are judged by what they play.
"""

from dataclasses import dataclass
from pathlib import Path

import msgspec
from threadpoolctl import threadpool_limits

from controller.learning.fit import describe_motion, judged
from controller.learning.measures.disturbance import stress_test
from controller.learning.measures.recording_errors import recorded_part
from controller.learning.measures.self_test import Judge, run_free, self_test
from controller.learning.recipe import MotionRecipe, check_name, recipe_of
from controller.learning.trainers.trainer import NewMotion, kind_of, trainer_of
from controller.learning.training_set import LearnedPart, to_learn
from controller.library.motion_library import MotionInfo, MotionLibrary
from controller.motion.canonical.clip_edits import mirrored
from controller.motion.clip import Clip
from motiondeck_base.errors import MotiondeckError


@dataclass(frozen=True)
class Addition:
    """A library with one more motion, its last."""

    library: MotionLibrary
    part: LearnedPart  # the part of the recording that was learned

    @property
    def motion(self) -> MotionInfo:
        """The new motion and its verdict."""
        return self.library.info.motions[-1]


def add_motion(library: MotionLibrary, path: Path, clip: Clip, motion: MotionRecipe) -> Addition:
    """Learns a clip, of any skeleton and rate, as one more motion of a library; `path` of the library is for messages.

    MotiondeckError if the name is taken or cannot be typed, the clip does not fit, or the network takes no more.
    """
    info, network = library.info, library.network
    recipe = recipe_of(info.recipe, path)
    check_name(motion.name, path)
    if motion.name in network.motions:
        raise MotiondeckError(f"{path}: there is a motion '{motion.name}' in it already; give another --name")
    if recipe.as_recorded:
        raise MotiondeckError(f"{path}: its motions were learned as recorded, without loops; nothing is added to it")
    if network.kind != kind_of(recipe.network):
        raise MotiondeckError(f"the recipe in the library '{recipe.name}' is for another kind of network")
    own = mirrored(clip) if motion.mirrored else clip
    frames, part = to_learn(library.encoding, own, motion, info.rate, recipe.loop_keeps)
    trainer = trainer_of(recipe.network)
    lengths, loop = {known.name: known.frames for known in info.motions}, motion.plays == "loop"
    new = NewMotion(recipe.name, library.encoding, info.rate, info.seed, lengths, motion.name, frames, loop)
    with threadpool_limits(1):
        grown = trainer.add(recipe.network, network, new)
        loops = {known.name: known.plays == "loop" for known in info.motions} | {motion.name: loop}
        played = {name: run_free(network.twin(), name, length) for name, length in lengths.items()}
        judge = Judge(library.encoding, played | {motion.name: frames}, loops, info.rate)
        verdict = self_test(grown, judge, (motion.name,))
        if trainer.stress_tested:
            verdict = stress_test(grown, verdict, judge, info.seed)
    described = describe_motion(motion, frames, grown, verdict[motion.name], recipe.network.anchor_every)
    grown_recipe = msgspec.structs.replace(recipe, motions=[*recipe.motions, motion])
    thanks = f"{info.acknowledgement} '{motion.name}' was added from {Path(motion.file).name}.".strip()
    tree, motions = msgspec.json.decode(msgspec.json.encode(grown_recipe)), [*info.motions, described]
    header = msgspec.structs.replace(info, motions=motions, recipe=tree, acknowledgement=thanks)
    recorded = recorded_part(own, part.first, part.end, loop=loop, body=part.body)
    added = judged(MotionLibrary(header, grown, library.encoding), {motion.name: lambda: recorded})
    return Addition(added, part)
