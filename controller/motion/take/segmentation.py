"""Cuts a recording into its motions: where the body jumps, where it rests, and where its behaviour changes.

A recording shorter than LONG is one motion. In a longer one, what lies between two rests, or between a rest and a jump,
is cut where the distribution of poses and their rates changes. Still ends of each motion are left out.

A segment of n seconds with covariance S, of poses and their rates in a few principal directions, costs

    n / 2 log det(S + NOISE^2 I)

(the Gaussian likelihood of a change of mean and covariance: Srivastava and Worsley 1986; for motions, with a subspace
in place of the covariance, Barbic et al. 2004), and every border a price. The least total is found by dynamic
programming over moments STEP apart. A start that can no longer be best is dropped (PELT: Killick, Fearnhead and Eckley
2012), and so is one more than REACH seconds ago that has not been best since: time grows with the length of a
recording, memory by 1 MB a minute.
"""

from contextlib import suppress
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import STILL_SPEED, breaks, moving_part, span, thinned
from controller.motion.clip import Clip, Decision, runs
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.rotations import Array, Indices, conjugate, multiply, yaw
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

FRAMES_PER_SECOND = 30.0  # of a clip that are looked at
STEP = 0.1  # s between moments that may be borders
SHORTEST_SECONDS = 1.0
DIRECTIONS = 12
NOISE = 0.01  # m, of a principal direction
PRICE = 0.5  # s: of a border, for each of the d (d + 3) / 2 figures of a mean and a covariance in d directions
CHANGE = PRICE * DIRECTIONS * (DIRECTIONS + 3) / 2
REACH = 60.0  # s
RATE_SECONDS = 0.1  # weight of a velocity
SLOW_WITHIN, SLOW_OVER = 0.3, 0.2  # s: a border moves to the slowest moment so near, with speeds averaged so long
LONG = 12.0  # s
LEAST_PART = 3.0  # s, of a long recording between two jumps
REST = 1.0  # s in which all joints are slower than STILL_SPEED, averaged over REST_OVER
REST_OVER = 0.2

Part = tuple[int, int]
Bounds = tuple[Part, ...]


def segments_of(clip: Clip, count: int | None = None) -> Bounds:
    """The segments of a clip by `find_segments`, FileFormatError as there."""
    seen = thinned(clip, FRAMES_PER_SECOND)
    found, stride = find_segments(poses_of(seen), seen.rate, count), round(clip.rate / seen.rate)
    return tuple((stride * first, min(stride * end, len(clip))) for first, end in found)


def poses_of(clip: Clip) -> Array:
    """Joints relative to the root in its heading frame, and its height, shape (T, 3 B + 3), m; angles of a rig, rad.

    Of a body with two legs these are the joints of the canonical body, so that fingers do not count.
    """
    if clip.skeleton.is_rig:
        return angles_of(clip.rotation[:, 1:])
    with suppress(FileFormatError):  # without legs
        clip = to_canonical(clip)
    turned = multiply(conjugate(yaw(clip.heading()))[:, None, :], clip.rotation)
    root = np.zeros((len(clip), 3))
    root[:, 2] = clip.root_position[:, 2]
    return clip.skeleton.joints(root, turned).reshape(len(clip), -1)


def find_segments(poses: Array, rate: float, count: int | None = None) -> Bounds:
    """The segments (first frame, end) of a recording with poses (T, P), m or rad, at a rate in Hz.

    These are `poses_of`, or others in which a motion spreads as far. Without a count of segments borders are added by
    PRICE. FileFormatError if the recording is too short for that many segments of a second each.
    """
    steps = int(len(poses) / rate / max(STEP, 1.0 / rate) + 1e-6)
    shortest = max(1, round(SHORTEST_SECONDS / max(STEP, 1.0 / rate)))
    if not 1 <= (wanted := 1 if count is None else count) <= steps // shortest:
        raise FileFormatError(
            f"{len(poses) / rate:.1f} s cannot be cut into {wanted} segments of a second or more each"
        )
    rates = RATE_SECONDS * rate * np.asarray(np.gradient(poses, axis=0))
    edges = np.linspace(0, len(poses), steps + 1).round().astype(np.int64)
    costs = _Costs(np.concatenate([poses, rates], axis=1), edges, rate)
    price = least = PRICE * costs.figures
    borders = _best_borders(costs, price, shortest)
    while count is not None and len(borders) < count - 1:
        price *= 0.7
        borders = _best_borders(costs, price, shortest) if price > 1e-3 * least else [*range(shortest, steps, shortest)]
    while count is not None and len(borders) >= count:
        borders.pop(int(np.argmin(_gains(costs, borders, steps))))
    speed = uniform_filter1d(np.sqrt(np.square(rates).sum(1)), max(1, round(SLOW_OVER * rate)))
    near = round(SLOW_WITHIN * rate)
    slow = [int(max(0, edge - near) + speed[max(0, edge - near) : edge + near + 1].argmin()) for edge in edges[borders]]
    return tuple(pairwise([0, *slow, len(poses)]))


class _Costs:
    """What a segment costs between any two of N + 1 moments."""

    def __init__(self, seen: Array, edges: Indices, rate: float) -> None:
        centred = seen - seen.mean(0)
        axes = np.linalg.eigh(centred.T @ centred)[1][:, ::-1][:, :DIRECTIONS]
        reduced = centred @ axes
        parts = [reduced[first:end] for first, end in pairwise(edges)]
        self.edges, self.rate, size = edges, rate, reduced.shape[1]
        self.figures = size * (size + 3) / 2
        self._sums = np.cumsum([np.zeros(size), *(part.sum(0) for part in parts)], axis=0)
        self._squares = np.cumsum([np.zeros((size, size)), *(part.T @ part for part in parts)], axis=0)

    def __call__(self, starts: Indices, end: int) -> Array:
        count = (self.edges[end] - self.edges[starts]).astype(float)
        mean = (self._sums[end] - self._sums[starts]) / count[:, None]
        spread = (self._squares[end] - self._squares[starts]) / count[:, None, None]
        spread -= mean[:, :, None] * mean[:, None, :] - NOISE**2 * np.eye(mean.shape[1])
        return 0.5 * count / self.rate * np.linalg.slogdet(spread)[1]


def _best_borders(costs: _Costs, price: float, shortest: int) -> list[int]:
    """The borders, as numbers of moments, with the least total of costs and prices."""
    moments, reach = len(costs.edges), round(REACH / STEP)
    best, before = np.full(moments, np.inf), np.zeros(moments, dtype=np.int64)
    best[0] = 0.0
    starts, until = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    for end in range(shortest, moments):
        starts, until = np.append(starts, end - shortest), np.append(until, moments)
        totals = best[starts] + costs(starts, end)
        chosen = int(totals.argmin())
        best[end], before[end] = totals[chosen] + price, starts[chosen]
        # A start that is worse than a border here is so for all later ends that are a segment away.
        until = np.where(totals > best[end], np.minimum(until, end + shortest), until)
        kept = (until > end) & ((end - starts < reach) | (starts == starts[chosen]))
        starts, until = starts[kept], until[kept]
    borders: list[int] = []
    at = int(before[-1])
    while at > 0:
        borders.append(at)
        at = int(before[at])
    return borders[::-1]


def _gains(costs: _Costs, borders: list[int], last: int) -> list[float]:
    ends = [0, *borders, last]
    return [
        float((costs(np.array([a]), c) - costs(np.array([a]), b) - costs(np.array([b]), c))[0])
        for a, b, c in zip(ends, ends[1:], ends[2:], strict=False)
    ]


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
