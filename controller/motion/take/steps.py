"""The steps that correct a recording, in their order: the unit of its path, its rate, its ground."""

from dataclasses import replace

from controller.motion.clip import Clip
from controller.motion.reading_options import ReadingOptions
from controller.motion.take.ground import grounded
from controller.motion.take.path_unit import in_one_unit
from controller.motion.take.timing import timed


def taken(clip: Clip, options: ReadingOptions) -> Clip:
    """A clip of a body with its path in its unit, at its true rate and on its floor, as options ask."""
    if clip.skeleton.is_rig:
        return clip
    if options.ground == "auto":
        clip, decision = in_one_unit(clip)
        clip = clip if decision is None else replace(clip, decisions=(*clip.decisions, decision))
    for step, wanted in ((timed, options.rate), (grounded, options.ground)):
        if wanted is not None:
            clip, decision = step(clip, wanted)
            clip = replace(clip, decisions=(*clip.decisions, decision))
    return clip
