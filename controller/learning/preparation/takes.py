"""Several takes of one motion: carried onto the time of one of them, and averaged.

Hands never do the same twice at the same pace. Each take is laid over the reference by dynamic time warping: frames are
paired in order, so that the sum of squared differences is least (Sakoe and Chiba 1978). What hands did differently is
halved by four takes, what they did alike stays. Of a loop the takes need neither begin in the same phase nor last
equally many periods. The takes of a motion are NAME.clip, NAME.2.clip, NAME.3.clip and so on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.learning.preparation.loops import best_seam, with_velocities
from controller.motion.clip import Clip
from controller.motion.encodings.joint_angles import JointAngles, JointBody, Plays, how_taught, taught_clip
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError

_TAKE = re.compile(r"\.(\d+)$")
RETURNS = 0.2  # a motion is a loop if it returns to itself as well as this share of how far it spreads
_SHORTEST_LOOP = 0.15  # of a take; the shortest part that returns as well as any is one period
_AS_WELL = 1.5
_TOLD_APART = 0.5  # a take differs from the reference by less than this share of how far that spreads
_WARPED_AT = 150  # frames at most; warping costs their square
_PACES = np.linspace(0.6, 1.6, 21)  # of a take beside the reference


class JoinedTakes(NamedTuple):
    """Takes as one motion.

    Attributes:
        channels: shape (T, C); of a loop one period and a part of the next.
        apart: how far each take is from the result on average, a value a take (root mean square over channels).
    """

    channels: Array
    apart: list[float]


def motion_of(file: Path) -> str:
    """The motion that a clip is a take of: its name without ".clip" and the take's number."""
    return _TAKE.sub("", file.stem)


def by_motion(files: Iterable[Path]) -> list[list[Path]]:
    """Clips by the motion that they are takes of, in one folder; each in the order of the takes and once."""
    found: dict[Path, list[Path]] = {}
    for file in dict.fromkeys(files):
        found.setdefault(file.with_name(motion_of(file)), []).append(file)
    return [sorted(takes, key=_number_of) for takes in found.values()]


def read_takes(files: Sequence[Path]) -> tuple[Clip, Plays]:
    """The motion of some clips that are takes of it, and how it is to be played.

    Raises:
        FileFormatError: if one cannot be read, or they are of different joints, rates or motions, or are to be played
            differently.
    """
    clips = [read_clip(file) for file in files]
    plays: list[Plays] = [how_taught(file) for file in files]
    for file, clip, how in zip(files, clips, plays, strict=True):
        same = (clip.skeleton.bones, clip.rate, how) == (clips[0].skeleton.bones, clips[0].rate, plays[0])
        if not same or not clip.skeleton.is_rig:
            raise FileFormatError(
                f"{file} is no other take of {files[0]}: takes of a motion have the same joints in the same order, the "
                "same rate, and are all taught with --loop or all with --once."
            )
    if len(clips) == 1:
        return clips[0], plays[0]
    angles = [JointAngles(JointBody.of(clip.skeleton.bones)).encode(clip) for clip in clips]
    joined = join_takes(angles, list(map(str, files)), clips[0].rate, loop=plays[0] == "loop")
    return taught_clip(motion_of(files[0]), clips[0].skeleton.bones, clips[0].rate, joined.channels), plays[0]


def returns(channels: Array, rate: float, at_least: float) -> bool:
    """Whether a recording (T, C) comes back to where it was, so that it can go on for ever."""
    return best_seam(channels, rate, at_least=at_least).mismatch < RETURNS * _spread(with_velocities(channels, rate))


def join_takes(takes: Sequence[Array], names: Sequence[str], rate: float, *, loop: bool) -> JoinedTakes:
    """One motion from several takes of it.

    Args:
        takes: each of shape (T_i, C).
        names: of the takes, for messages.
        rate: frames per second, Hz.
        loop: whether it goes on for ever.

    Raises:
        FileFormatError: if a take differs from the others too much to be the same motion; it is named.
    """
    periods = [_period(take, rate) for take in takes] if loop else list(takes)
    reference = _middle_length(periods)
    within = _TOLD_APART * _spread(periods[reference])
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
                "a motion may. Teach it again, or give it a name of its own."
            )
        laid.append(over)
    mean = np.mean(laid, axis=0)
    apart = [_distance(one, mean) for one in laid]
    return JoinedTakes(np.concatenate([mean, mean[: round(0.4 * len(mean))]]) if loop else mean, apart)


def _number_of(file: Path) -> int:
    number = _TAKE.search(file.stem)
    return int(number[1]) if number else 1


def _period(take: Array, rate: float) -> Array:
    """One period of a loop: the shortest part of a take that returns about as well as any."""
    best = best_seam(take, rate, at_least=0.5)
    for share in (_SHORTEST_LOOP, 0.25, 0.35):
        seam = best_seam(take, rate, at_least=share)
        if seam.mismatch <= _AS_WELL * best.mismatch or seam.mismatch < 0.5 * RETURNS * _spread(take):
            return take[seam.start : seam.end]
    return take[best.start : best.end]


def _middle_length(takes: Sequence[Array]) -> int:
    """The take whose length has as many shorter as longer ones."""
    return sorted(range(len(takes)), key=lambda number: len(takes[number]))[len(takes) // 2]


def _best_part(take: Array, reference: Array) -> Array:
    """The part of a take that is most like one period of a loop, whatever its pace."""
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
    """A take on the time of the reference, shape of the reference."""
    few = min(_WARPED_AT, len(take), len(reference))
    coarse = [_resampled(one, few) for one in (reference, take)]
    own, other = _path(*coarse)
    # Where a frame of the reference has several partners, their middle.
    partner = np.array([other[own == frame].mean() for frame in range(few)]) / (few - 1)
    smooth = np.interp(np.linspace(0, 1, len(reference)), np.linspace(0, 1, few), partner)
    place = smooth * (len(take) - 1)
    return np.stack([np.interp(place, np.arange(len(take)), channel) for channel in take.T], axis=1)


def _path(reference: Array, take: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The pairs of frames of the cheapest way through two motions, first with first and last with last."""
    cost = np.square(reference[:, None] - take[None]).sum(axis=2)
    total = np.full((len(reference) + 1, len(take) + 1), np.inf)
    total[0, 0] = 0.0
    for row in range(len(reference)):
        # From above or from the corner all at once; along the row one after the other.
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


def _resampled(channels: Array, frames: int) -> Array:
    place = np.linspace(0, len(channels) - 1, frames)
    return np.stack([np.interp(place, np.arange(len(channels)), channel) for channel in channels.T], axis=1)


def _spread(channels: Array) -> float:
    """How far a motion goes from its mean, root mean square over frames of the sum over channels."""
    return float(np.sqrt(np.square(channels - channels.mean(0)).sum(1).mean()))


def _distance(one: Array, other: Array) -> float:
    """Root mean square over frames of the distance over all channels."""
    return float(np.sqrt(np.square(one - other).sum(1).mean()))
