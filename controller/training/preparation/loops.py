"""Closing a clip, so that a motion can go on for ever or come to rest.

A recording ends; a network must not. A periodic motion is cut where it comes nearest to itself, and what mismatch is
left is eased out over the frames after the seam, value and velocity (a quintic, so that neither jumps). A motion that
happens once is eased into a hold after it has ended: the network learns to rest there.
"""

from __future__ import annotations

import numpy as np

from controller.quintic import run_out
from controller.rotations import Array

HOLD_AFTER = 120


def close_loop(channels: Array, features: Array, *, at_least: float, seam: int = 48, velocity_frames: int = 8) -> Array:
    """The best periodic part of a clip.

    Args:
        channels: the clip, shape (T, C).
        features: what the cut is judged by (joint positions), shape (T, F).
        at_least: how much of the clip the loop keeps, in (0, 1).
        seam: over how many frames the mismatch is eased out.
        velocity_frames: weight of a mismatch in velocity, in frames.

    Returns:
        One period, shape (P, C): its frame 0 follows its last one.
    """
    velocity = np.gradient(features, axis=0)
    seen = np.concatenate([features, velocity_frames * velocity], axis=1)
    frames = len(channels)
    shortest = max(2, int(at_least * frames))
    best, cut = np.inf, (0, frames - 1)
    for start in range(frames - shortest):
        mismatch = np.square(seen[start + shortest :] - seen[start]).sum(1)
        end = int(mismatch.argmin())
        if mismatch[end] < best:
            best, cut = mismatch[end], (start, start + shortest + end)
    start, end = cut
    loop = channels[start:end].copy()
    seam = min(seam, len(loop))
    slope = np.gradient(channels, axis=0)
    s = np.arange(seam)[:, None] / seam
    value_share, slope_share = run_out(s)
    loop[:seam] += (channels[end] - channels[start]) * value_share
    loop[:seam] += (slope[end] - slope[start]) * seam * slope_share
    return loop


def hold_end(channels: Array, still: slice, ease: int = 36) -> Array:
    """A clip that comes to rest: its frames, an eased stop, HOLD_AFTER still frames.

    Args:
        channels: the clip, shape (T, C).
        still: the channels that are velocities, zero while resting.
        ease: how many frames the motion takes to come to rest.
    """
    slope = np.gradient(channels, axis=0)
    s = np.arange(1, ease + 1)[:, None] / ease
    # The slope runs out as (1 - s)^2 (1 + 2 s): what is walked on the way is its integral.
    way = s - s**3 + 0.5 * s**4
    stopping = channels[-1] + slope[-1] * ease * way
    stopping[:, still] = channels[-1:, still] * (1.0 - s) ** 2 * (1.0 + 2.0 * s)
    after = np.repeat(stopping[-1:], HOLD_AFTER, axis=0)
    after[:, still] = 0.0
    return np.concatenate([channels, stopping, after])
