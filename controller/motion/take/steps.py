"""The steps that correct a recording, in their order: the unit of its path, its rate, its ground."""

from dataclasses import replace

import numpy as np

from controller.motion.clip import Clip, Decision, ReadingOptions
from controller.motion.take.ground import grounded
from controller.motion.take.timing import timed
from motiondeck_base.arrays_on_disk import release

TIMES = (100.0, 1000.0, 0.01, 0.001, 1.0 / 0.0254, 0.0254)
# Legs: the lowest joint of a body on a floor at 0 is often this near to it, and mostly no higher, in hops too.
ON_FLOOR, FLIES = 0.15, 0.5
OFF_FLOOR = 0.5  # legs: and one with a path in another unit mostly this far off
MOSTLY = (10.0, 90.0)  # percentiles of time


def in_one_unit(clip: Clip) -> tuple[Clip, Decision | None]:
    """A clip whose path is in the unit of its bones; with a decision where it was not."""
    leg = clip.skeleton.leg_length
    low = clip.joints()[..., 2].min(axis=1) - clip.root_position[:, 2]  # relative to the root
    height = clip.root_position[:, 2]
    now = np.percentile(low + height, MOSTLY)
    if np.abs(now).min() < OFF_FLOOR * leg or leg <= 0.0 or np.ptp(clip.root_position, axis=0).max() == 0.0:
        return clip, None
    for times in TIMES:
        lowest, highest = np.percentile(low + times * height, MOSTLY)
        if abs(lowest) < ON_FLOOR * leg and highest < FLIES * leg:
            evidence = f"times {times:g} feet stand near 0, as it is the lowest joint is at {now[0]:.2f} m"
            decided = f"the path of the root is in another unit than the bones: times {times:g}"
            moved = replace(clip, root_position=times * clip.root_position)
            return moved, Decision("unit", decided, evidence, "--ground none", notable=True)
    return clip, None


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
            release()
    return clip
