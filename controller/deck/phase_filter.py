"""Which motion a body does, where in it, and how fast: a Bayes filter over the courses of motions.

A state is a frame f of a motion and a tempo v. In each step of 1 / RATE s

    p(f, v)  <-  (1 - NEW) sum_u p(f - v, u) T(u, v) + NEW / S,      p(f, v)  <-  p(f, v) exp(-e(f, v) / (2 s^2 n))

T keeps the tempo but for a share CHANGE, NEW is the chance of having gone anywhere else, and the errors of n successive
measurements are alike. e is the squared distance of the measured points, now and PAST steps ago, from those of the
state, after the turn about the vertical and the shift along the ground that bring them nearest. With z = x + i y and q
of measured and expected points, each less its mean, and their heights h and g,

    e = sum |z|^2 + sum |q|^2 - 2 |sum conj(q) z| + sum (h - g)^2

so it does not matter where the body stands and where it faces. Points that are not seen do not count.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, Flags

RATE = 30.0  # Hz
PAST = 6  # steps
TEMPOS: Array = np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0])
DEVIATION = 0.05  # s, of a point of another person, m
ALIKE = 1.5  # n
NEW, CHANGE = 0.01, 0.15  # a step


@dataclass(frozen=True, slots=True)
class BodyPlace:
    """Where a body is most likely to be."""

    motion: int
    evidence: float  # the probability of that motion
    frame: float  # of the motion, at RATE; the mean about its likeliest frame
    deviation: float  # of that, frames
    tempo: float  # mean, in the motion's own


class PhaseFilter:
    """Follows K points of a body through courses (T, K, 3), m, at RATE; of a loop three rounds, (3 T, K, 3)."""

    def __init__(self, courses: Sequence[Array], loops: Sequence[bool]) -> None:
        lengths = [len(course) // (3 if loop else 1) for course, loop in zip(courses, loops, strict=True)]
        self._first = np.concatenate([[0], np.cumsum(lengths)])
        self._loops, frames, self._count = [*loops], int(self._first[-1]), courses[0].shape[1]
        now = np.empty((frames, self._count, 3))
        past = np.empty((len(TEMPOS), frames, self._count, 3))
        self._from = np.empty((2, len(TEMPOS), frames), dtype=np.int64)  # the frames before; `frames` stands for none
        self._share = TEMPOS[:, None] - np.floor(TEMPOS)[:, None]
        for first, long, course, loop in zip(self._first[:-1], lengths, courses, loops, strict=True):
            own, here, start = slice(first, first + long), np.arange(long), long if loop else 0
            now[own] = course[start : start + long]
            for v, tempo in enumerate(TEMPOS):
                past[v, own] = _between(course, start + here - PAST * tempo)
                for table, back in zip(self._from, (np.floor(tempo), np.floor(tempo) + 1.0), strict=True):
                    before = here - int(back)
                    inside = (before >= 0) & (before < long)
                    table[v, own] = first + before % long if loop else np.where(inside, first + before, frames)
        centre = now.mean(1, keepdims=True) * np.array([1.0, 1.0, 0.0])
        self._now = _Expected(now - centre)
        self._past = _Expected((past - centre).reshape(-1, self._count, 3))
        size = len(TEMPOS)
        self._keep = np.eye(size) * (1.0 - CHANGE) + CHANGE / size
        self._belief: Array = np.full((size, frames), 1.0 / (size * frames))
        self._padded = np.zeros((size, frames + 1))
        self._seen: deque[Array] = deque(maxlen=PAST + 1)

    def step(self, measured: Array) -> None:
        """Goes on by 1 / RATE s with measured points (K, 3), m; NaN for those not seen."""
        self._padded[:, :-1] = self._keep @ self._belief
        rows, (near, far) = np.arange(len(TEMPOS))[:, None], self._from
        belief = (1.0 - self._share) * self._padded[rows, near] + self._share * self._padded[rows, far]
        belief *= (1.0 - NEW) / max(float(belief.sum()), 1e-300)
        belief += NEW / belief.size
        self._seen.append(np.array(measured, dtype=float))
        error = self._errors()
        if error is not None:
            belief *= np.exp((error.min() - error) / (2.0 * DEVIATION**2 * ALIKE))
        self._belief = belief / belief.sum()

    @property
    def evidence(self) -> Array:
        """The probability of each motion."""
        return np.add.reduceat(self._belief.sum(0), self._first[:-1])

    def place(self, motion: int | None = None) -> BodyPlace:
        """The likeliest place, or that in a motion."""
        evidence = self.evidence
        best = int(evidence.argmax()) if motion is None else motion
        own = self._belief[:, self._first[best] : self._first[best + 1]]
        frames, long = own.sum(0), own.shape[1]
        top = int(frames.argmax())
        near = np.arange(top - long // 2, top - long // 2 + long) if self._loops[best] else np.arange(long)
        weight = frames[near % long] / max(frames.sum(), 1e-300)
        middle = float(weight @ near)
        deviation = float(np.sqrt(weight @ np.square(near - middle)))
        return BodyPlace(
            best, float(evidence[best]), middle, deviation, float(TEMPOS @ own.sum(1) / max(own.sum(), 1e-300))
        )

    def _errors(self) -> Array | None:
        now = self._seen[-1]
        points = np.concatenate([now, self._seen[0] if len(self._seen) > PAST else np.full_like(now, np.nan)])
        seen: Flags = np.isfinite(points.sum(axis=1))
        if not seen[: self._count].any():
            return None
        weight = seen.astype(float)
        z, h = np.where(seen, points[:, 0] + 1j * points[:, 1], 0.0), np.where(seen, points[:, 2], 0.0)
        total = weight.sum()
        z = np.where(seen, z - z.sum() / total, 0.0)
        own = self._now.sums(weight[: self._count], z[: self._count], h[: self._count])
        before = self._past.sums(weight[self._count :], z[self._count :], h[self._count :])
        mean, cross, square = (a + b.reshape(len(TEMPOS), -1) for a, b in zip(own, before, strict=True))
        off_mean = (np.square(mean.real) + np.square(mean.imag)) / total
        return square - off_mean - 2.0 * np.abs(cross) + float(np.square(np.abs(z)).sum() + np.square(h).sum())


class _Expected:
    """The expected points of states, (S, K, 3), m, ready to be compared with measured ones."""

    def __init__(self, points: Array) -> None:
        flat = points[..., 0] - 1j * points[..., 1]
        self._flat = flat.astype(np.complex64)
        square = np.square(np.abs(flat)) + np.square(points[..., 2])
        self._real = np.concatenate([square, points[..., 2]], axis=1).astype(np.float32)

    def sums(self, weight: Array, z: NDArray[np.complex128], height: Array) -> tuple[Any, Any, Any]:
        """Of each state sum w conj(q), sum w conj(q) z and sum w (|q|^2 + g^2 - 2 g h), (S,)."""
        both = self._flat @ np.column_stack([weight, weight * z]).astype(np.complex64)
        real = self._real @ np.concatenate([weight, -2.0 * weight * height]).astype(np.float32)
        return both[:, 0], both[:, 1], real


def _between(course: Array, place: Array) -> Array:
    low = np.floor(place).astype(np.int64)
    share = (place - low)[:, None, None]
    last = len(course) - 1
    return (1.0 - share) * course[low.clip(0, last)] + share * course[(low + 1).clip(0, last)]
