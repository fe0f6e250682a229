"""Averages several takes of a motion on the time of one of them.

Each take is aligned with the reference by dynamic time warping: frames are paired in order with the least sum of
squared differences (Sakoe and Chiba 1978). Four takes halve their random differences. Takes of a loop may have any
phase and number of periods. The takes of a motion are NAME.clip, NAME.2.clip, NAME.3.clip and so on.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controller.learning.preparation.loops import best_seam, with_velocities
from controller.motion.clip import Clip, between_rows
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import FileFormatError

_TAKE = re.compile(r"\.(\d+)$")
RETURNS = 0.2  # largest mismatch at the seam of a loop, relative to the spread of the motion
_SHORTEST_LOOP = 0.15  # of a take; the shortest part with about the least mismatch is one period
_AS_WELL = 1.5
_LARGEST_DIFFERENCE = 0.5  # of a take from the reference, relative to its spread
_WARPED_AT = 150  # frames at most; warping costs their square
_PACES = np.linspace(0.6, 1.6, 21)  # of a take relative to the reference


class JoinedTakes(NamedTuple):
    """Takes as one motion."""

    channels: Array  # shape (T, C); of a loop one period and a part of the next
    apart: list[float]  # mean distance of each take from the result (root mean square over channels)


def motion_of(file: Path) -> str:
    """The name of the motion of a take: without ".clip" and the number of the take."""
    return _TAKE.sub("", file.stem)


def by_motion(files: Iterable[Path]) -> list[list[Path]]:
    """Clips grouped by motion and folder, in the order of the takes, without repetitions."""
    found: dict[Path, list[Path]] = {}
    for file in dict.fromkeys(files):
        found.setdefault(file.with_name(motion_of(file)), []).append(file)
    return [sorted(takes, key=_number_of) for takes in found.values()]


def read_takes(files: Sequence[Path]) -> Clip:
    """The motion of some takes; FileFormatError if one is unreadable, or unlike the others."""
    clips = [read_clip(file) for file in files]
    joints, rate, plays = clips[0].skeleton.bones, clips[0].rate, clips[0].plays
    for file, clip in zip(files, clips, strict=True):
        same = (clip.skeleton.bones, clip.rate, clip.plays) == (joints, rate, plays)
        if not same or not clip.skeleton.is_rig:
            raise FileFormatError(
                f"{file} is not a take of {files[0]}: takes of a motion have the same joints in the same order, the "
                "same rate, and are all taught with --loop or all with --once."
            )
    if len(clips) == 1:
        return clips[0]
    angles = [angles_of(clip.rotation[:, 1:]) for clip in clips]
    joined = join_takes(angles, list(map(str, files)), rate, loop=plays == "loop")
    return taught_clip(motion_of(files[0]), joints, rate, joined.channels, plays=plays)


def is_periodic(channels: Array, rate: float, at_least: float) -> bool:
    """Whether a recording (T, C) at a rate in Hz returns to an earlier state."""
    return best_seam(channels, rate, at_least=at_least).mismatch < RETURNS * spread_of(with_velocities(channels, rate))


def with_kind(clip: Clip) -> Clip:
    """A clip of joints that says how it plays: as it did, else as a loop if it returns to an earlier state."""
    loop = len(clip) > 4 and is_periodic(angles_of(clip.rotation[:, 1:]), clip.rate, at_least=0.5)
    return clip if clip.plays else replace(clip, plays="loop" if loop else "once")


def join_takes(takes: Sequence[Array], names: Sequence[str], rate: float, *, loop: bool) -> JoinedTakes:
    """One motion from several takes (T_i, C) at a rate in Hz; FileFormatError names one that differs too much."""
    periods = [_period(take, rate) for take in takes] if loop else list(takes)
    reference = sorted(range(len(takes)), key=lambda number: len(periods[number]))[len(takes) // 2]
    within = _LARGEST_DIFFERENCE * spread_of(periods[reference])
    laid: list[Array] = []
    for number, take in enumerate(takes):
        if number == reference:
            laid.append(periods[reference])
            continue
        part = _best_part(take, periods[reference]) if loop else take
        over = _laid_over(part, periods[reference])
        if (differs := _distance(over, periods[reference])) > within:
            more = math.ceil(100.0 * (differs / within - 1.0))
            raise FileFormatError(
                f"{names[number]} is not the motion of {names[reference]}: they differ by {more} % more than takes of "
                "a motion may. Teach it again, or give it another name."
            )
        laid.append(over)
    mean = np.mean(laid, axis=0)
    apart = [_distance(one, mean) for one in laid]
    return JoinedTakes(np.concatenate([mean, mean[: round(0.4 * len(mean))]]) if loop else mean, apart)


def _number_of(file: Path) -> int:
    number = _TAKE.search(file.stem)
    return int(number[1]) if number else 1


def _period(take: Array, rate: float) -> Array:
    """One period of a loop: the shortest part of a take with about the least mismatch."""
    best = best_seam(take, rate, at_least=0.5)
    for share in (_SHORTEST_LOOP, 0.25, 0.35):
        seam = best_seam(take, rate, at_least=share)
        if seam.mismatch <= _AS_WELL * best.mismatch or seam.mismatch < 0.5 * RETURNS * spread_of(take):
            return take[seam.start : seam.end]
    return take[best.start : best.end]


def _best_part(take: Array, reference: Array) -> Array:
    """The part of a take that is nearest to one period of a loop, at any pace."""
    step = max(1, len(reference) // 40)
    wanted = reference[::step]
    best, found = np.inf, take
    for pace in _PACES:
        length = round(pace * len(reference))
        if length > len(take) or length < 4:
            continue
        places = np.linspace(0, length - 1, len(wanted)).round().astype(int)
        starts = np.arange(0, len(take) - length + 1, step)
        apart = np.square(take[starts[:, None] + places] - wanted).mean(axis=(1, 2))
        if apart.min() < best:
            best, start = float(apart.min()), int(starts[apart.argmin()])
            found = take[start : start + length]
    return found


def _laid_over(take: Array, reference: Array) -> Array:
    few = min(_WARPED_AT, len(take), len(reference))
    coarse = [between_rows(one, np.arange(len(one)), np.linspace(0, len(one) - 1, few)) for one in (reference, take)]
    own, other = _path(*coarse)
    # The mean of several partners of a frame of the reference.
    partner = np.array([other[own == frame].mean() for frame in range(few)]) / (few - 1)
    smooth = np.interp(np.linspace(0, 1, len(reference)), np.linspace(0, 1, few), partner)
    return between_rows(take, np.arange(len(take)), smooth * (len(take) - 1))


def _path(reference: Array, take: Array) -> tuple[Indices, Indices]:
    """The pairs of frames of the warping path with the least cost."""
    cost = np.square(reference[:, None] - take[None]).sum(axis=2)
    total = np.full((len(reference) + 1, len(take) + 1), np.inf)
    total[0, 0] = 0.0
    for row in range(len(reference)):
        # From above or from the corner vectorised; along the row sequentially.
        above = np.minimum(total[row, 1:], total[row, :-1]) + cost[row]
        best = np.inf
        for column, (arrive, here) in enumerate(zip(above.tolist(), cost[row].tolist(), strict=True)):
            best = min(arrive, best + here)
            total[row + 1, column + 1] = best
    row, column = len(reference), len(take)
    pairs = []
    while row and column:
        pairs.append((row - 1, column - 1))
        row, column = min(((row - 1, column - 1), (row - 1, column), (row, column - 1)), key=lambda place: total[place])
    own, other = np.array(pairs[::-1]).T
    return own, other


def spread_of(channels: Array) -> float:
    """Root mean square distance of a motion from its mean, over all channels."""
    return float(np.sqrt(np.square(channels - channels.mean(0)).sum(1).mean()))


def _distance(one: Array, other: Array) -> float:
    return float(np.sqrt(np.square(one - other).sum(1).mean()))
