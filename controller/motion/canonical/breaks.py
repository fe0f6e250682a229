"""Breaks: where a recording is not one motion, because its body or a limb is elsewhere from one frame to the next."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from controller.motion.canonical.clip_edits import jumps, span, spikes
from controller.motion.clip import Clip
from motiondeck_base.counted import counted


def breaks(clip: Clip, first: int = 0, end: int | None = None) -> tuple[list[int], list[str]]:
    """Where some frames of a clip are no motion.

    Args:
        clip: the recording.
        first, end: of the frames looked at; all of them by default.

    Returns:
        The frames before which it is to be cut, in order, and what happens there and when, a phrase each.
    """
    part = span(clip, first, len(clip) if end is None else end)
    jumped = [first + jump for jump in jumps(part)]
    spiked = [(first + frame, bone) for frame, bone in spikes(part)]
    found: list[str] = []
    if jumped:
        far = max(float(np.linalg.norm(clip.root_position[frame] - clip.root_position[frame - 1])) for frame in jumped)
        found.append(f"the body jumps by up to {far:.1f} m between two frames {_times(jumped, clip.rate)}")
    if spiked:
        bone, when = clip.skeleton.bones[spiked[0][1]], _times([frame for frame, _ in spiked], clip.rate)
        found.append(f"the end of bone '{bone}' is elsewhere for a moment {when}")
    return sorted({*jumped, *(edge for frame, _ in spiked for edge in (frame, frame + 1))}), found


def _times(frames: Sequence[int], rate: float) -> str:
    """When something happens, the first time in s; frames side by side are one time."""
    more = sum(later > frame + 2 for frame, later in pairwise(frames))
    return f"at {frames[0] / rate:.2f} s" + (f" and {counted(more, 'more time')}" if more else "")
