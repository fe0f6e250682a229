"""Fills gaps of markers from the other markers (Vakulenko et al. 2017, section 4).

1. Around a gap the other markers are aligned, frame by frame, with their mean shape (Kabsch 1976), which removes the
   motion of the body as a whole.
2. Centers and satellites are trained on them. Their output has few principal components, the scores; the missing marker
   is a weighted sum of the scores. Or it follows from the principal components of the markers (`by_components`).
3. The residual of the prediction on both sides of the gap is interpolated over it, by a cubic or a line.
4. Network or components, the ridge of the weights, and cubic or line are chosen by cross-validation: intervals as long
   as the gap are hidden where the marker is seen, and filled by every method. The largest ridge leaves only the mean.
5. A cubic or a line through the marker's own path in the world is evaluated there, too. The gap is filled by a mean of
   the best methods of both kinds, weighted by their errors on the hidden intervals.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import expit

from controller.learning.centralized.satellite_learning import learn, ridge_readout, slow_and_fast
from controller.motion.clip import between_rows, bridged, runs
from controller.motion.rotations import Array, Flags
from controller.networks.ridge import ridge

CONTEXT_S = 3.0  # on both sides of a gap, besides the length of the gap
TOGETHER_S = 3.0  # gaps within this time are filled from one network

CENTERS = 2
SATELLITES_A_SECOND = 12.0
PIECE_S = 8.0
TRIES = 20
ITERATIONS = 60
SCORES = 24

# Sigma of `by_components`, in root mean square distances of the markers from their centre; the paper's 200 mm.
NEAR = 0.4
OWN_WEIGHT = 0.02  # of the missing marker there
KEPT = (0.99, 0.999)  # shares of the sum of singular values that are tried

HIDDEN = 8  # intervals for cross-validation
EAGERNESS = 1.0  # log weight per relative difference of the two errors
EDGE = 4  # frames on each side of a gap for its cubic

FEWEST_SEEN = 30  # frames of a marker, for its weights
FEWEST_OTHERS = 3  # markers, for the pose of the body
BRIDGED = 0.1  # largest missing share of the other markers outside the gap; interpolated linearly

FilledBy = Literal["network", "components", "path"]


@dataclass(frozen=True)
class FillMethod:
    """A method to fill a gap."""

    by: FilledBy  # "path" interpolates the marker's own
    strength: float  # of the network the ridge of its weights, per seen frame; of components the share that is kept
    cubic: bool  # else a line interpolates the residual or the path


_PREDICTORS: list[tuple[FilledBy, float]] = [
    *(("network", float(share)) for share in 10.0 ** np.arange(-8.0, 3.0)),
    *(("components", share) for share in KEPT),
    ("path", 0.0),
]
WAYS = [FillMethod(by, strength, cubic) for by, strength in _PREDICTORS for cubic in (True, False)]


class _Others(NamedTuple):
    """The other markers about their centre, onto their mean shape, (K, M, 3), and the scores of their network."""

    shape: Array
    scores: Array


@dataclass(frozen=True)
class Gap:
    """A marker that is not seen from frame `first` to before frame `end`."""

    marker: int
    first: int
    end: int
    # Mean absolute error of a coordinate on hidden intervals of the same length, in the unit of the markers; None if
    # there was none, or the gap was not filled.
    expected: float | None = None
    filled: bool = False
    # The method with the larger weight: from the others, or the marker's own path, as a "cubic" or a "line".
    by: FilledBy | Literal["cubic", "line"] | None = None

    @property
    def frames(self) -> int:
        """The length of the gap."""
        return self.end - self.first


def gaps_of(markers: Array) -> list[Gap]:
    """The gaps of markers (K, M, 3), by their first frames."""
    missing: Flags = np.asarray(np.isnan(markers).any(axis=-1))
    found = (Gap(m, first, end) for m in range(markers.shape[1]) for first, end in runs(missing[:, m]))
    return sorted(found, key=lambda gap: gap.first)


def fill_missing(markers: Array, rate: float, tick: Callable[[], None] = lambda: None) -> tuple[Array, list[Gap]]:
    """Fills the gaps of markers (K, M, 3), which are NaN; returns the markers and the gaps.

    A gap stays open if fewer than FEWEST_OTHERS markers are seen through it, or its own in fewer than FEWEST_SEEN
    frames around it. `tick` is called once a gap.
    """
    filled, done = markers.copy(), []
    for group in _groups(gaps_of(markers), round(TOGETHER_S * rate)):
        for gap in _fill_group(markers, filled, group, rate):
            # With fewer than three markers seen through a group, its gaps may still be filled one by one.
            done += [gap] if gap.filled or len(group) == 1 else _fill_group(markers, filled, [gap], rate)
            tick()
    return filled, done


def _groups(gaps: list[Gap], most: int) -> list[list[Gap]]:
    groups: list[list[Gap]] = []
    for gap in gaps:
        if groups and gap.end - groups[-1][0].first <= most:
            groups[-1].append(gap)
        else:
            groups.append([gap])
    return groups


def _fill_group(markers: Array, filled: Array, group: list[Gap], rate: float) -> list[Gap]:
    context = round(CONTEXT_S * rate) + max(gap.frames for gap in group)
    begin = max(0, min(gap.first for gap in group) - context)
    stop = min(len(markers), max(gap.end for gap in group) + context)
    part = markers[begin:stop]
    missing: Flags = np.asarray(np.isnan(part).any(axis=-1))
    within = np.zeros(len(part), dtype=bool)
    for gap in group:
        within[gap.first - begin : gap.end - begin] = True
    others = ~missing[within].any(axis=0) & (missing.mean(0) <= BRIDGED)
    if others.sum() < FEWEST_OTHERS:
        return group
    seen = np.where(missing[:, others, None], np.nan, part[:, others])
    base, turn, shape = _onto_mean_shape(np.stack([bridged(track) for track in seen.swapaxes(0, 1)], axis=1))
    known = _Others(shape, _scores(shape.reshape(len(shape), -1), rate))
    done = []
    for gap in group:
        hole = missing[:, gap.marker]
        if (~hole).sum() < FEWEST_SEEN:
            done.append(gap)
            continue
        world = part[:, gap.marker]
        body = _turned(world - base, turn)
        from_others, along, share, expected = _choose(known, body, world, hole, gap.frames)
        inside = slice(gap.first - begin, gap.end - begin)
        found = _fill(known, world, hole, along)[inside]
        if share > 0.0:
            predicted = _fill(known, body, hole, from_others)[inside]
            by_others = _turned(predicted, np.swapaxes(turn[inside], 1, 2)) + base[inside]
            found = share * by_others + (1.0 - share) * found
        filled[gap.first : gap.end, gap.marker] = found
        by = from_others.by if share > 0.5 else "cubic" if along.cubic else "line"
        done.append(Gap(gap.marker, gap.first, gap.end, expected, filled=True, by=by))
    return done


def _onto_mean_shape(markers: Array) -> tuple[Array, Array, Array]:
    """Centers (K, 3), rotations (K, 3, 3) and aligned shapes of markers (K, M, 3)."""
    base = markers.mean(1)
    centred = markers - base[:, None]
    mean = centred[len(centred) // 2]
    turn = np.zeros((len(markers), 3, 3))
    for _ in range(3):
        left, _, right = np.linalg.svd(np.swapaxes(centred, 1, 2) @ mean)
        left[:, :, -1] *= np.sign(np.linalg.det(left @ right))[:, None]
        turn = left @ right
        mean = (centred @ turn).mean(0)
    return base, turn, centred @ turn


def _turned(path: Array, turn: Array) -> Array:
    """The points of a path (K, 3), each rotated by its own matrix."""
    return (path[:, None] @ turn)[:, 0]


def _scores(flat: Array, rate: float) -> Array:
    """Principal components (K, SCORES) of networks' output, one for each PIECE_S at most, for coordinates (K, F)."""
    target = flat - flat.mean(0)
    pieces = np.array_split(target, max(1, int(np.ceil(len(flat) / (PIECE_S * rate)))))
    predicted = np.concatenate([_predicted(piece, rate) for piece in pieces])
    left, size, _ = np.linalg.svd(predicted, full_matrices=False)
    return left[:, :SCORES] * size[:SCORES] / max(size[0], 1e-300)


def _predicted(target: Array, rate: float) -> Array:
    middle = target.mean(0)
    time = np.arange(len(target)) / rate
    satellites = int(np.clip(SATELLITES_A_SECOND * time[-1], 4, max(1, len(target) // 3)))
    starts = slow_and_fast(float(time[-1]), CENTERS, TRIES, 0)
    response = learn(target - middle, time, satellites, starts, iterations=ITERATIONS).respond(time)
    return response @ ridge_readout(response, target - middle).T + middle


def _choose(
    known: _Others, body: Array, world: Array, missing: Flags, gap: int
) -> tuple[FillMethod, FillMethod, float, float | None]:
    """The methods to fill a gap of some frames, by their errors on hidden intervals of its length, or shorter ones.

    `body` and `world` are the marker's path (K, 3) relative to the other markers and in the world. The method from the
    other markers, that along the marker's own path, the share of the former, and the mean absolute error of both by
    their shares, a bound on that of the mixture.
    """
    longest = max((end - first for first, end in runs(~missing)), default=0)
    length = min(gap, longest - 2 * EDGE)
    if length < 1:
        return WAYS[0], WAYS[-1], 0.0, None
    starts = [k for first, end in runs(~missing) for k in range(first + EDGE, end - length - EDGE + 1)]
    tried = np.unique(np.linspace(0, len(starts) - 1, HIDDEN).astype(int))
    missed = np.zeros((len(WAYS) // 2, 2))
    for start in (starts[place] for place in tried):
        hidden = slice(start, start + length)
        holes = missing.copy()
        holes[hidden] = True
        for index, way in enumerate(WAYS[::2]):
            path = world if way.by == "path" else body
            predicted = _predicted_path(known, path, holes, way)
            for column, cubic in enumerate((True, False)):
                found = _through_edges(predicted, path, holes, cubic=cubic)
                missed[index, column] += np.abs(found[hidden] - path[hidden]).mean()
    flat = missed.ravel() / len(tried)
    own_path = np.array([way.by == "path" for way in WAYS])
    others = int(np.where(own_path, np.inf, flat).argmin())
    path = int(np.where(own_path, flat, np.inf).argmin())
    both = flat[[others, path]]
    share = float(expit(EAGERNESS * (both[1] - both[0]) / max(both.min(), 1e-9)))
    return WAYS[others], WAYS[path], share, float(share * both[0] + (1.0 - share) * both[1])


def _fill(known: _Others, path: Array, missing: Flags, way: FillMethod) -> Array:
    return _through_edges(_predicted_path(known, path, missing, way), path, missing, cubic=way.cubic)


def _predicted_path(known: _Others, path: Array, missing: Flags, way: FillMethod) -> Array:
    """A path (K, 3) as the other markers predict it in every frame; zero by the path itself."""
    if way.by == "path":
        return np.zeros_like(path)
    if way.by == "components":
        return by_components(known.shape, path, missing, way.strength)
    there = path[~missing]
    weights = ridge(known.scores[~missing], there - there.mean(0), way.strength * len(there))
    return known.scores @ weights.T + there.mean(0)


def _through_edges(predicted: Array, path: Array, missing: Flags, *, cubic: bool) -> Array:
    """A path (K, 3) with the prediction in its gaps, and the residual at their edges interpolated over them."""
    out = np.where(missing[:, None], predicted, path)
    for first, end in runs(missing):
        edges = (first - EDGE, first - 1, end, end + EDGE - 1) if cubic else (first - 1, end)
        near = [k for k in edges if 0 <= k < len(path) and not missing[k]]
        inside, off = np.arange(first, end), path[near] - predicted[near]
        if len(near) == 4:
            out[first:end] += CubicSpline(near, off)(inside)
        elif near:
            out[first:end] += between_rows(off, np.array(near), inside)
    return out


def by_components(others: Array, path: Array, missing: Flags, kept: float) -> Array:
    """The path (K, 3) of a marker, predicted in every frame from M others (K, M, 3) about their centre.

    By principal components (Gloersen and Federolf 2016, PLoS ONE 11(3): e0152616): each coordinate is divided by its
    standard deviation and weighted by the distance d of its marker from the missing one, w = exp((d0^2 - d^2) /
    2 sigma^2), with d0 that of the nearest; the missing one has a small weight. With P the leading components of the
    frames in which it is seen, and P0 those of the same frames with its coordinates set to zero, a frame x0 in which
    they are zero becomes x = x0 P0 (P0^T P) P^T.

    `path` may be anything where it is missing; it is seen in two frames and more. `kept` is the share of the sum of
    singular values that the components have.
    """
    seen = ~missing
    near = NEAR * np.sqrt(np.square(others).sum(-1).mean()) + 1e-12
    apart = np.linalg.norm(others[seen] - path[seen, None], axis=-1).mean(0)
    weight = np.exp(0.5 * (np.square(apart.min()) - np.square(apart)) / near**2)  # the nearest has weight 1
    weight = np.append(np.repeat(weight, 3), [OWN_WEIGHT] * 3)
    full = np.concatenate([others.reshape(len(others), -1), np.where(missing[:, None], 0.0, path)], axis=1)
    mean, scale = full[seen].mean(0), np.maximum(full[seen].std(0), 1e-9 * near) / weight
    full = (full - mean) / scale
    own = slice(full.shape[1] - 3, None)
    without = full.copy()
    without[:, own] = 0.0
    found = [np.linalg.svd(frames[seen], full_matrices=False)[1:] for frames in (without, full)]
    count = max(1 + int(np.searchsorted(np.cumsum(size), kept * size.sum())) for size, _ in found)
    axes_without, axes = (rows[:count] for _, rows in found)
    return (without @ axes_without.T @ (axes_without @ axes.T) @ axes)[:, own] * scale[own] + mean[own]
