"""The steps that correct a recording, in their order: its rate, then its ground."""

from __future__ import annotations

from dataclasses import replace

from controller.motion.clip import Clip
from controller.motion.reading_options import ReadingOptions
from controller.motion.take.ground import grounded
from controller.motion.take.timing import timed


def taken(clip: Clip, options: ReadingOptions) -> Clip:
    """A clip of a body at its true rate and on its floor, as far as the options ask for it."""
    if clip.skeleton.is_rig:
        return clip
    for step, wanted in ((timed, options.rate), (grounded, options.ground)):
        if wanted is not None:
            clip, decision = step(clip, wanted)
            clip = replace(clip, decisions=(*clip.decisions, decision))
    return clip
