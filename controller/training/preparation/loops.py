"""Closing a clip, so that a motion can go on for ever or come to rest.

A recording ends; a network must not. A periodic motion is cut where it comes nearest to itself, and what mismatch is
left is eased out over the frames after the seam, value and velocity (a quintic, so that neither jumps). A one-shot is
eased into a hold after it has ended: the network learns to rest there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.quintic import run_out
from controller.rotations import Array

HOLD_SECONDS = 1.0  # at rest after a one-shot
EASE_SECONDS = 0.3  # in which a one-shot comes to rest
SEAM_SECONDS = 0.4  # over which the mismatch of a loop is eased out
VELOCITY_SECONDS = 1.0 / 15.0  # what a mismatch in velocity counts: as far as it leads in this time
MOST_STARTS = 1200  # that are tried one by one; in longer clips every second or third and so on, then those around


@dataclass(frozen=True)
class Seam:
    """Where a clip is cut into a loop.

    Attributes:
        start, end: the loop's first frame, and the one that is nearest to it and is left out.
        mismatch: of the features between both, velocities included (root of the sum of squares).
    """

    start: int
    end: int
    mismatch: float


def best_seam(features: Array, rate: float, *, at_least: float) -> Seam:
    """Where a clip comes nearest to itself.

    Args:
        features: what the cut is judged by (joint positions), shape (T, F).
        rate: frames per second, Hz.
        at_least: how much of the clip the loop keeps, in (0, 1).
    """
    seen = with_velocities(features, rate)
    frames = len(features)
    shortest = max(2, int(at_least * frames))
    stride = max(1, -(-frames // MOST_STARTS))
    best = _best_of(seen, range(0, frames - shortest, stride), shortest, stride)
    if stride > 1:
        near = range(max(0, best.start - stride), min(frames - shortest, best.start + stride + 1))
        best = min(best, _best_of(seen, near, shortest, 1), key=lambda seam: seam.mismatch)
    return best


def with_velocities(features: Array, rate: float) -> Array:
    """Features (T, F) at a rate in Hz, and how far their velocities lead in VELOCITY_SECONDS, shape (T, 2 F)."""
    return np.concatenate([features, VELOCITY_SECONDS * rate * np.gradient(features, axis=0)], axis=1)


def _best_of(seen: Array, starts: range, shortest: int, stride: int) -> Seam:
    """The best seam that begins at one of some frames."""
    best = Seam(0, len(seen) - 1, np.inf)
    for start in starts:
        mismatch = np.square(seen[start + shortest :: stride] - seen[start]).sum(1)
        place = int(mismatch.argmin())
        if mismatch[place] < best.mismatch:
            best = Seam(start, start + shortest + stride * place, float(mismatch[place]))
    return Seam(best.start, best.end, float(np.sqrt(best.mismatch)))


def close_loop(channels: Array, features: Array, rate: float, *, at_least: float) -> Array:
    """The best periodic part of a clip.

    Args:
        channels: the clip, shape (T, C).
        features: what the cut is judged by (joint positions), shape (T, F).
        rate: frames per second, Hz.
        at_least: how much of the clip the loop keeps, in (0, 1).

    Returns:
        One period, shape (P, C): its frame 0 follows its last one.
    """
    cut = best_seam(features, rate, at_least=at_least)
    loop = channels[cut.start : cut.end].copy()
    seam = min(max(2, round(SEAM_SECONDS * rate)), len(loop))
    slope = np.gradient(channels, axis=0)
    s = np.arange(seam)[:, None] / seam
    value_share, slope_share = run_out(s)
    loop[:seam] += (channels[cut.end] - channels[cut.start]) * value_share
    loop[:seam] += (slope[cut.end] - slope[cut.start]) * seam * slope_share
    return loop


def hold_end(channels: Array, still: slice, rate: float) -> Array:
    """A clip that comes to rest: its frames, an eased stop, a second of still frames.

    Args:
        channels: the clip, shape (T, C).
        still: the channels that are velocities, zero while resting.
        rate: frames per second, Hz.
    """
    ease = max(2, round(EASE_SECONDS * rate))
    slope = np.gradient(channels, axis=0)
    s = np.arange(1, ease + 1)[:, None] / ease
    # The slope runs out as (1 - s)^2 (1 + 2 s): what is walked on the way is its integral.
    way = s - s**3 + 0.5 * s**4
    stopping = channels[-1] + slope[-1] * ease * way
    stopping[:, still] = channels[-1:, still] * (1.0 - s) ** 2 * (1.0 + 2.0 * s)
    after = np.repeat(stopping[-1:], round(HOLD_SECONDS * rate), axis=0)
    after[:, still] = 0.0
    return np.concatenate([channels, stopping, after])
