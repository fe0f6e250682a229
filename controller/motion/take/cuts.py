"""Cuts a recording into its motions: where the body jumps, where it rests, and where its behaviour changes.

A recording shorter than LONG is one motion. In a longer one, what lies between two rests, or between a rest and a jump,
is cut where the distribution of poses changes (`segmentation`). Still ends of each motion are left out.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from controller.motion.canonical.clip_edits import STILL_SPEED, breaks, moving_part, span, thinned
from controller.motion.clip import Clip
from controller.motion.decision import Decision
from controller.motion.markers import runs
from controller.motion.rotations import Array
from controller.motion.take.segmentation import CHANGE, FRAMES_PER_SECOND, SHORTEST_SECONDS, find_segments, poses_of
from motiondeck_base.files import listed

LONG = 12.0  # s
LEAST_PART = 3.0  # s, of a long recording between two jumps
REST = 1.0  # s in which all joints are slower than STILL_SPEED, averaged over REST_OVER
REST_OVER = 0.2

Part = tuple[int, int]


class Cuts(NamedTuple):
    """The motions of a recording, first frame and end each, and why."""

    motions: list[Part]
    jumps: list[str]  # a phrase for each kind of jump at which the recording was cut
    decision: Decision


def cuts_of(clip: Clip, first: int, end: int, *, whole: bool = False) -> Cuts:
    """The motions between two frames of a clip; with `whole` the longest part without a jump is one motion."""
    at, jumped = breaks(clip, first, end)
    parts = list(pairwise([first, *at, end]))
    motions: list[Part] = []
    if not whole and end - first >= LONG * clip.rate:
        long = [part for part in parts if part[1] - part[0] >= LEAST_PART * clip.rate]
        motions = [motion for part in long for motion in _motions(span(clip, *part), part[0])]
    motions = motions or [max(parts, key=lambda part: part[1] - part[0])]
    return Cuts(motions, jumped, _decision(clip, motions, jumped))


def _motions(clip: Clip, offset: int) -> list[Part]:
    """The motions of a clip without jumps, in frames of the recording that it is from."""
    seen = thinned(clip, FRAMES_PER_SECOND)
    stride = round(clip.rate / seen.rate)
    poses = poses_of(seen)
    found: list[Part] = []
    for first, end in pairwise([0, *rests(poses, seen.rate), len(seen)]):
        inner = [(0, end - first)]
        if end - first >= LONG * seen.rate:
            inner = find_segments(poses[first:end], seen.rate)
        found += [(stride * (first + start), min(stride * (first + stop), len(clip))) for start, stop in inner]
    motions: list[Part] = []
    for first, end in found:
        start, stop = moving_part(span(clip, first, end))
        if stop - start >= SHORTEST_SECONDS * clip.rate:
            motions.append((offset + first + start, offset + first + stop))
    return motions


def rests(poses: Array, rate: float) -> list[int]:
    """The middle of each rest in poses (T, P), m or rad, at a rate in Hz, but for those at both ends."""
    speed = rate * np.abs(np.gradient(poses, axis=0))
    fastest = uniform_filter1d(speed, max(1, round(REST_OVER * rate)), axis=0).max(axis=1)
    still = [(first, end) for first, end in runs(fastest < STILL_SPEED) if end - first >= REST * rate]
    return [(first + end) // 2 for first, end in still if first > 0 and end < len(poses)]


def _decision(clip: Clip, motions: list[Part], jumped: list[str]) -> Decision:
    overrule = "frames in the recipe"
    if len(motions) == 1:
        (first, end) = motions[0]
        what = f"{first / clip.rate:.2f} to {end / clip.rate:.2f} s of {clip.duration:.2f} s"
        why = ", ".join(jumped) or f"joints are slower than {STILL_SPEED:g} m/s before and after, or the recording ends"
        return Decision("cuts", what, why, overrule, notable=bool(jumped))
    times = listed(f"{first / clip.rate:.2f}" for first, _ in motions)
    why = f"between them the distribution of poses changes by a log likelihood of {CHANGE:g} s or more, or they rest"
    why = ", ".join([*jumped, f"{why} for {REST:g} s"])
    return Decision("cuts", f"{len(motions)} motions, from {times} s on", why, f"--whole, or {overrule}", notable=True)
