"""The times at which the frames of a recording were truly recorded: held frames and missing ones.

Exporters hold frames to fill a higher rate: every one of 30 Hz twice in a file of 60 Hz, or three and two times in turn
of 24 Hz. Where frames were lost, a file either repeats the last one or goes on without a sign, and then a step is as
long as two. Both are found from the steps of all joints while the body moves.
"""

from dataclasses import dataclass, replace

import numpy as np

from controller.motion.canonical.clip_edits import FASTEST_BODY, cubic, interpolated
from controller.motion.clip import Clip, Decision
from controller.motion.rotations import Array, Flags, Indices, by_blocks, continuous
from motiondeck_base.words import counted

SAME = 1e-7  # m: frames whose joints are this near are one frame held
MOVES = 0.1  # m/s: of the fastest joint, over MOVES_SECONDS; where it is slower nothing is judged
MOVES_SECONDS = 0.2
# Of a pattern: the least share of held frames, how far the rate may be from a usual one, and the least share of frames
# that are held as often as the pattern says.
PATTERN, RATE_OFF, REGULAR = 0.05, 0.03, 0.9
LONGEST_HOLD = 0.25  # s: a body that is still for longer stands still
USUAL_RATES = np.array([10, 12, 12.5, 15, 20, 24, 25, 30, 40, 48, 50, 60, 90, 100, 120])  # Hz
TELEVISION = 1.001  # 29.97 and 59.94 Hz are 30 and 60 over this
# A gap: a step that is the steps beside it times this, but for a deviation in the same measure, of joints faster than
# GAP_SPEED, m/s. Each frame beyond ALONG allows as much again, because limbs change their pace over it.
GAP, GAP_DEVIATION, GAP_SPEED, ALONG = 1.7, 0.4, 0.3, 2.5
MOST_MISSING = 5  # frames; more are a jump
BLOCK = 2000  # steps that are looked at together, for the sake of memory


@dataclass(frozen=True)
class Timing:
    """Which frames of a file were recorded, and when."""

    frames: Indices  # the frames that were recorded, shape (K,)
    at: Array  # when, in frames of the file, shape (K,)
    rate: float  # at which they were recorded, Hz
    decided: str = ""
    evidence: str = ""  # the figures; empty if the file is right


def timing_of(points: Array, rate: float) -> Timing:
    """The timing of points (T, K, 3), m, in a file of a rate in Hz; NaN where a point was not seen."""
    step, count = np.diff(points, axis=0), len(points)
    del points  # as large as the recording
    np.nan_to_num(step, copy=False)
    length = by_blocks(lambda way: np.sqrt(np.square(way).sum(-1)).max(axis=1, initial=0.0), step)
    width = max(1, round(MOVES_SECONDS * rate))
    moves = rate * np.convolve(length, np.ones(width) / width, "same")[: len(length)] > MOVES
    same = length < SAME
    found = None
    if moves.sum() > width and (same & moves).any():
        found = _without_held(same, moves, rate * length > FASTEST_BODY, rate)
    elif moves.sum() > width:
        found = _with_gaps(step, rate)
    every = np.arange(count)
    return found or Timing(every, every.astype(float), rate)


def _without_held(same: Flags, moves: Flags, leaps: Flags, rate: float) -> Timing | None:
    """The timing without held frames: of a pattern at its own rate, of single ones with a gap for each.

    `same` says whether each frame but the first is as the one before, `moves` whether the body moves there,
    and `leaps` whether it gets there by a jump: what is held then is a lost body.
    """
    held, moving = int((same & moves).sum()), int(moves.sum())
    true = rate * (1.0 - held / moving)
    slowed = TELEVISION if abs(rate / np.rint(rate) - 1.0 / TELEVISION) < 1e-4 else 1.0
    usual = [*(USUAL_RATES / slowed).tolist(), *(rate / times for times in (2, 3, 4, 5))]
    nearest = min(usual, key=lambda one: abs(np.log(one / true)))
    begins = np.flatnonzero(np.concatenate([[True], ~same]))
    lasts = np.diff(np.append(begins, len(same) + 1))
    in_motion = np.concatenate([[False], moves])[begins] & (begins > 0)
    figures = f"{held} of {moving} frames in motion repeat the one before"
    times = rate / nearest
    fits = (lasts >= np.floor(times)) & (lasts <= np.ceil(times))
    if held > PATTERN * moving and abs(nearest / true - 1.0) < RATE_OFF and fits[in_motion].mean() > REGULAR:
        # A body that stands still holds frames for longer: as many as the pattern has in that time.
        frames = np.repeat(begins, np.where(lasts <= np.ceil(times), 1, np.rint(lasts / times).astype(np.int64)))
        decided = f"{nearest:g} Hz, the frames held in a file of {rate:g} Hz are left out"
        return Timing(frames, np.arange(len(frames)) * times, nearest, decided, figures)
    bridged = same & moves & np.repeat((lasts <= 1 + LONGEST_HOLD * rate) & ~np.append(False, leaps)[begins], lasts)[1:]
    frames = np.flatnonzero(np.concatenate([[True], ~bridged]))
    if bridged[-1:].all():  # nothing follows to bridge to
        frames = np.append(frames, len(same))
    if not bridged.any():
        return None
    return Timing(frames, frames.astype(float), rate, f"{counted(int(bridged.sum()), 'held frame')} bridged", figures)


def _with_gaps(step: Array, rate: float) -> Timing | None:
    """The timing with the frames that are missing where a step is a multiple of those beside it."""
    if len(step) < 3:
        return None
    parts = [_as_those_beside(step[first : first + BLOCK + 2], rate) for first in range(0, len(step) - 2, BLOCK)]
    moves, times, deviation = (np.concatenate(one) for one in zip(*parts, strict=True))
    straight = deviation < GAP_DEVIATION * np.maximum(1.0, times - ALONG + 1.0)
    gaps = moves & straight & (times > GAP) & (times < MOST_MISSING + 1.5)
    if not gaps.any():
        return None
    missing = np.zeros(len(step), dtype=np.int64)
    missing[1:-1][gaps] = np.maximum(1, np.rint(times[gaps]).astype(np.int64) - 1)
    at = np.concatenate([[0], np.cumsum(1 + missing)])
    first, *others = np.flatnonzero(missing).tolist()
    more = f" and {counted(len(others), 'more time')}" if others else ""
    farthest = f"all joints step {float(times[gaps].max()):.1f} times as far as before and after"
    decided = f"{counted(int(missing.sum()), 'missing frame')} filled in"
    return Timing(np.arange(len(at)), at.astype(float), rate, decided, f"at {first / rate:.2f} s{more} {farthest}")


def _as_those_beside(step: Array, rate: float) -> tuple[Flags, Array, Array]:
    """Of inner steps of (S, K, 3): whether fast, how many times those beside it, deviation from that, (S - 2,) each."""
    beside = 0.5 * (step[:-2] + step[2:])
    square = np.square(beside).sum((1, 2))
    times = (step[1:-1] * beside).sum((1, 2)) / np.maximum(square, 1e-12)
    aside = step[1:-1] - times[:, None, None] * beside
    deviation = np.sqrt(np.square(aside).sum((1, 2)) / np.maximum(square, 1e-12))
    return np.sqrt(np.square(beside).sum(-1)).max(axis=1) * rate > GAP_SPEED, times, deviation


def timed(clip: Clip, wanted: float | str) -> tuple[Clip, Decision]:
    """A clip at the rate at which it was recorded, with missing frames filled in.

    `wanted` is "auto", "none", or the true rate, Hz: then as many frames of the file are left out.
    """
    overrule = "rate in the recipe, Hz or 'none'"
    if wanted == "none":
        return clip, Decision("rate", f"{clip.rate:g} Hz", "as given", overrule)
    if isinstance(wanted, float | int):
        count = int(np.floor((len(clip) - 1) * wanted / clip.rate + 1e-6)) + 1
        kept = np.minimum(np.rint(np.arange(count) * clip.rate / wanted).astype(np.int64), len(clip) - 1)
        return _chosen(clip, kept, float(wanted)), Decision("rate", f"{wanted:g} Hz", "as given", overrule)
    timing = timing_of(clip.joints(), clip.rate)
    if not timing.decided:
        why = "no frame repeats the one before, and no step is as long as two"
        return clip, Decision("rate", f"{clip.rate:g} Hz", why, overrule)
    taken = replace(_chosen(clip, timing.frames, timing.rate), rate=timing.rate)
    if timing.rate == clip.rate:
        taken = _spread_out(taken, timing.at)
    return taken, Decision("rate", timing.decided, timing.evidence, overrule, notable=True)


def _chosen(clip: Clip, frames: Indices, rate: float) -> Clip:
    if np.array_equal(frames, np.arange(len(clip))):
        return replace(clip, rate=rate)
    return replace(clip, rate=rate, root_position=clip.root_position[frames], rotation=clip.rotation[frames])


def _spread_out(clip: Clip, at: Array) -> Clip:
    """A clip whose frames belong to the times `at`, in frames, (T,): cubics fill the frames between."""
    wanted = np.arange(int(at[-1]) + 1)
    low = np.minimum(np.searchsorted(at, wanted, "right") - 1, len(at) - 2)
    position, rotation = clip.root_position[low], clip.rotation[low]
    between = np.flatnonzero(at[low] != wanted)
    low, wanted = low[between], wanted[between]
    time = [at[np.clip(low + step, 0, len(at) - 1)] for step in (-1, 0, 1, 2)]
    filled = interpolated(clip, low, lambda points: _between(points, time, wanted))
    position[between], rotation[between] = filled.root_position, filled.rotation
    return replace(clip, root_position=position, rotation=continuous(rotation, own=True))


def _between(points: list[Array], time: list[Array], wanted: Indices) -> Array:
    """Cubics between the second and the third of four points with slopes over their neighbours, at uneven times."""
    shape = (-1, *[1] * (points[0].ndim - 1))
    before, start, end, after = (one.reshape(shape) for one in time)
    long = end - start
    slope = (points[2] - points[0]) / (end - before) * long
    slope_end = (points[3] - points[1]) / (after - start) * long
    return cubic(points[1], slope, points[2], slope_end, (wanted.reshape(shape) - start) / long)
