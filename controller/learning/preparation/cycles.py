"""Cycles of periodic motions, aligned in duration and phase, and one person's predicted from those of several.

Recordings that differ in an input, such as speed, become one motion: a single cycle of each (a stride, not two) is cut
out, stretched to the same number of frames, and shifted to the phase of the first.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from controller.learning.preparation.loops import Seam, close_loop, with_velocities
from controller.learning.preparation.training_motion import Variant
from controller.motion.clip import Clip
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError

SHORTEST_SECONDS = 0.4  # of a cycle
AS_WELL = 2.0  # a cycle is the shortest period with a mismatch up to this factor of the least
POSES, MOST_ROUNDS = 96, 20  # of a loop that is rolled into step
MANNER, NOISE = 1.0, 0.1  # of the variance of f in `person_variants`


def one_cycle(features: Array, rate: float, name: str) -> Seam:
    """The seam of one cycle of joint positions (T, F) at a rate in Hz; FileFormatError if they are too few."""
    seen = with_velocities(features, rate)
    shortest, longest = round(SHORTEST_SECONDS * rate), len(seen) - 1
    if longest <= shortest:
        raise FileFormatError(f"{name}: {len(seen) / rate:.2f} s are too short for a cycle of {SHORTEST_SECONDS} s")
    found = []
    for length in range(shortest, longest + 1):
        apart = np.square(seen[length:] - seen[:-length]).sum(1)
        start = int(apart.argmin())
        found.append(Seam(start, start + length, float(np.sqrt(apart[start]))))
    mismatch = np.array([seam.mismatch for seam in found])
    dips = [k for k in range(1, len(found) - 1) if mismatch[k] <= min(mismatch[k - 1], mismatch[k + 1])]
    if not dips:
        return found[int(mismatch.argmin())]
    best = float(mismatch[dips].min())
    return found[next(k for k in dips if mismatch[k] <= AS_WELL * best)]


def stretched(loop: Array, frames: int) -> Array:
    """A loop (P, C) resampled by a periodic cubic spline, shape (frames, C)."""
    closed = np.concatenate([loop, loop[:1]])
    at = np.arange(frames) * (len(loop) / frames)
    return CubicSpline(np.arange(len(closed)), closed, bc_type="periodic")(at)


def phase_lag(loop: Array, reference: Array) -> int:
    """The number of frames by which to roll a loop (T, F) to the phase of another one (T, F)."""
    own, other = (np.fft.rfft(a - a.mean(0), axis=0) for a in (loop, reference))
    return int(np.fft.irfft((other * own.conj()).sum(1), n=len(loop)).argmax())


def in_step(loops: Mapping[str, Array]) -> dict[str, float]:
    """The turns, rad, with which loops of features (T, F) have like poses at like phases.

    Each is rolled to the phase of the sum of the others, those before it at first, until none is rolled any more.
    """
    poses = {name: stretched(loop, POSES) for name, loop in loops.items()}
    rolled: dict[str, Array] = {}
    lags = dict.fromkeys(poses, 0)
    for _ in range(MOST_ROUNDS):
        before = dict(lags)
        for name, own in poses.items():
            others = [pose for other, pose in rolled.items() if other != name]
            lags[name] = phase_lag(own, np.sum(others, axis=0)) if others else 0
            rolled[name] = np.roll(own, lags[name], axis=0)
        if lags == before:
            break
    return {name: 2.0 * np.pi * lag / POSES for name, lag in lags.items()}


def aligned_cycles(encoding: Encoding, clips: Sequence[Clip], values: Sequence[float], rate: float) -> list[Variant]:
    """One cycle of each recording of a loop, with the phase and number of frames of the first.

    The clips have the encoding's body and the rate, Hz; without `values` of the input it is the speed, m/s.
    FileFormatError if a recording is too short.
    """
    found: list[Variant] = []
    reference: Array | None = None
    for index, clip in enumerate(clips):
        channels = encoding.encode(clip)
        cut = one_cycle(joint_features(encoding, channels), rate, clip.name)
        loop = close_loop(channels, cut, encoding.velocities, rate)
        seconds, value = len(loop) / rate, values[index] if values else ground_speed(loop)
        loop = stretched(loop, len(found[0].frames) if found else len(loop))
        features = joint_features(encoding, loop)
        reference = features if reference is None else reference
        found.append(Variant(value, seconds, np.roll(loop, phase_lag(features, reference), axis=0)))
    return found


def ground_speed(channels: Array) -> float:
    """The mean horizontal speed in channels (T, C) of bone directions, m/s."""
    return float(np.hypot(*channels[:, 2:4].mean(0)))


def person_variants(
    person: str, variants: Sequence[Variant], people: Sequence[str], values: Sequence[float]
) -> list[Variant]:
    """The predicted motion of a person at `values` of the input; an unknown name gives the average person.

    Two people at the same speed may differ more than one person at two speeds, in posture and in the swing of limbs.
    The channels of a person at a value of the input, as a level u in [-1, 1], are modelled as

        y(u) = c + d u + f(u) + g + e

    with a line c + d u and a Gaussian process f with the covariance exp(-(u - u')^2 / 2), the effect of the input on
    all people; g, the offset of the person, with the variance MANNER; and e, the noise of a recording, with the
    variance NOISE. The best linear unbiased prediction of all but e (universal kriging: Cressie 1993, section 3.4) is a
    weighted sum of the recordings,

        w = k K^-1 + (b - k K^-1 B) (B' K^-1 B)^-1 B' K^-1

    with K the covariance of the recordings, k that of the prediction with them, and rows (1, u) of each in B and b. The
    weights are the same for every channel and frame. They add up to 1 and keep lines, and so the speed of a body.

    `variants` are aligned recordings, at two different values at least, and `people` their persons' names.
    """
    known = np.array([variant.value for variant in variants])
    least, most = known.min(), known.max()
    levels, wanted = (2.0 * (at - least) / (most - least) - 1.0 for at in (known, np.asarray(values)))
    own = np.array(people)
    covariance = _alike(levels, levels) + MANNER * (own[:, None] == own) + NOISE * np.eye(len(own))
    inverse = np.linalg.inv(covariance)
    line, there = (np.column_stack([np.ones_like(at), at]) for at in (levels, wanted))
    weights = (_alike(wanted, levels) + MANNER * (own == person)) @ inverse
    weights += (there - weights @ line) @ np.linalg.solve(line.T @ inverse @ line, line.T @ inverse)
    frames = np.tensordot(weights, [variant.frames for variant in variants], 1)
    seconds = np.exp(weights @ np.log([variant.seconds for variant in variants]))
    return [Variant(*one) for one in zip(values, seconds.tolist(), frames, strict=True)]


def _alike(one: Array, other: Array) -> Array:
    """The covariance of f between levels (A,) and (B,), shape (A, B)."""
    return np.exp(-0.5 * np.square(one[:, None] - other))
