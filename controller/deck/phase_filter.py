"""Which motion a body does, where in it, and how fast: a Bayes filter over the courses of motions.

A state is a frame f of a motion and a tempo v. In each step of 1 / RATE s

    p(f, v)  <-  (1 - NEW) sum_u p(f - v, u) T(u, v) + NEW / S,      p(f, v)  <-  p(f, v) exp(-e(f, v) / 2)

T keeps the tempo but for a share CHANGE, and NEW is the chance of having gone anywhere else. e is the squared distance
of the measured points and of their changes in PAST steps from those of the state, after the turn about the vertical and
the shift along the ground that bring them nearest. Strangers hold their hands elsewhere, but move them alike, so w is
1 / PLACE^2 for places and 1 / MOVED^2 for changes. With z = x + i y and q of what is measured and expected, places less
their mean, and their heights h and g,

    e = sum w |z|^2 + sum w |q|^2 - 2 |sum w conj(q) z| + UP sum w (h - g)^2

so it does not matter where the body stands and where it faces. Points that are not seen do not count. A person holds
hands and head elsewhere than the body of the motions does: by how much, seen from the body, is a running mean over the
time OWN of what is left in the likeliest state, and belongs to the q and g of all states.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import between_rows
from controller.motion.rotations import Array

RATE = 30.0  # Hz
PAST = 4  # steps
TEMPOS: Array = np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0])
PLACE, MOVED, UP = 0.1, 0.04, 2.0  # m; how much heights count
NEW, CHANGE = 0.01, 0.15  # a step
ABOUT, KEPT_FROM = 8, 0.02  # frames about the likeliest one that belong to it; its share of the likelihood
OWN, MOST_OWN = 2.0, 0.15  # s, and m at most
FITS, STANDS = 0.28, 2.0  # of `share`, by the number K of points: m; of the probability of standing


@dataclass(frozen=True, slots=True)
class BodyPlace:
    """Where a body is most likely to be."""

    motion: int
    evidence: float  # the probability of that motion
    frame: float  # of the motion, at RATE; the mean about its likeliest frame
    tempo: float  # mean, in the motion's own


class PhaseFilter:
    """Follows K points of a body through courses (T, K, 3), m, at RATE; of a loop three rounds, (3 T, K, 3).

    The headings (T,), rad, are those of the body in each frame of a course.
    """

    def __init__(self, courses: Sequence[Array], headings: Sequence[Array], loops: Sequence[bool]) -> None:
        lengths = [len(course) // (3 if loop else 1) for course, loop in zip(courses, loops, strict=True)]
        self._first = np.concatenate([[0], np.cumsum(lengths)])
        self._loops, frames, self._count = [*loops], int(self._first[-1]), courses[0].shape[1]
        now, facing = np.empty((frames, self._count, 3)), np.empty(frames)
        moved = np.empty((len(TEMPOS), frames, self._count, 3))
        self._from = np.empty((2, len(TEMPOS), frames), dtype=np.int64)  # the frames before; `frames` stands for none
        self._share = TEMPOS[:, None] - np.floor(TEMPOS)[:, None]
        for first, long, course, heading, loop in zip(self._first[:-1], lengths, courses, headings, loops, strict=True):
            own, here, start = slice(first, first + long), np.arange(long), long if loop else 0
            flat, every = course.reshape(len(course), -1), np.arange(len(course))
            now[own], facing[own] = course[start : start + long], heading[start : start + long]
            for v, tempo in enumerate(TEMPOS):
                past = between_rows(flat, every, start + here - PAST * tempo).reshape(long, -1, 3)
                moved[v, own] = now[own] - past
                for table, back in zip(self._from, (np.floor(tempo), np.floor(tempo) + 1.0), strict=True):
                    before = here - int(back)
                    inside = (before >= 0) & (before < long)
                    table[v, own] = first + before % long if loop else np.where(inside, first + before, frames)
        centre, turn = _plane(now).mean(1, keepdims=True), np.exp(-1j * facing)[:, None]
        self._now = _Expected(turn * (_plane(now) - centre), now[..., 2])
        self._moved = _Expected(turn * _plane(moved), moved[..., 2])
        self._offset = np.zeros(self._count, dtype=complex)  # of the person's own points, and of their heights
        self._offset_up = np.zeros(self._count)
        self._misfit = PLACE**2  # m^2, of points from those of the likeliest state; a running mean over the time OWN
        size = len(TEMPOS)
        self._keep = np.eye(size) * (1.0 - CHANGE) + CHANGE / size
        self._belief: Array = np.full((size, frames), 1.0 / (size * frames))
        self._padded = np.zeros((size, frames + 1))
        self._seen = deque([np.full((self._count, 3), np.nan)] * (PAST + 1), maxlen=PAST + 1)

    def step(self, measured: Array) -> None:
        """Goes on by 1 / RATE s with measured points (K, 3), m; NaN for those not seen."""
        self._padded[:, :-1] = self._keep @ self._belief
        rows, (near, far) = np.arange(len(TEMPOS))[:, None], self._from
        belief = (1.0 - self._share) * self._padded[rows, near] + self._share * self._padded[rows, far]
        belief *= (1.0 - NEW) / max(float(belief.sum()), 1e-300)
        belief += NEW / belief.size
        self._seen.append(np.array(measured, dtype=float))
        if np.isfinite(self._seen[-1].sum(axis=1)).any():
            self._weigh(belief, self._seen[-1], self._seen[-1] - self._seen[0])
        self._belief = belief / belief.sum()

    @property
    def evidence(self) -> Array:
        """The probability of each motion."""
        return np.add.reduceat(self._belief.sum(0), self._first[:-1])

    @property
    def share(self) -> float:
        """The share of a body completed from K > 1 points: more, the less the motion fits; less if the body stands."""
        off = self._misfit * (1.0 - STANDS * float(self._belief[TEMPOS <= 0.0].sum()) / self._count)
        return off / (off + (FITS / self._count) ** 2)

    def place(self, motion: int | None = None, near: float | None = None) -> BodyPlace:
        """The likeliest place, or that in a motion; near a frame unless another is clearly likelier.

        A loop of two strides looks alike twice a round.
        """
        evidence = self.evidence
        best = int(evidence.argmax()) if motion is None else motion
        own = self._belief[:, self._first[best] : self._first[best + 1]]
        long, mode = own.shape[1], "wrap" if self._loops[best] else "constant"
        frames, around = np.pad(own.sum(0), ABOUT, mode=mode), np.arange(-ABOUT, ABOUT + 1)
        mass = np.convolve(frames, np.ones(2 * ABOUT + 1), "valid")
        top = int(mass.argmax())
        if near is not None:
            kept = round(near) % long if self._loops[best] else min(max(round(near), 0), long - 1)
            top = kept if mass[kept] > KEPT_FROM * mass[top] else top
        top += int(frames[top : top + 2 * ABOUT + 1].argmax()) - ABOUT
        weight = np.pad(own.sum(0), 2 * ABOUT, mode=mode)[top + ABOUT : top + 3 * ABOUT + 1]
        tempo = float(TEMPOS @ own.sum(1) / max(float(own.sum()), 1e-300))
        return BodyPlace(best, float(evidence[best]), top + float(weight @ around / max(weight.sum(), 1e-300)), tempo)

    def _weigh(self, belief: Array, points: Array, moved: Array) -> None:
        """Weighs the belief by the points and their changes, (K, 3), and learns the person's own offsets."""
        seen, follows = (np.isfinite(each.sum(axis=1)) for each in (points, moved))
        z, h = np.where(seen, _plane(points), 0.0), np.where(seen, points[:, 2] - self._offset_up, 0.0)
        z, total = np.where(seen, z - z.sum() / seen.sum(), 0.0), seen.sum() / PLACE**2
        mean, cross, square = self._now.sums(seen / PLACE**2, z, h, self._offset)
        change = np.where(follows, _plane(moved), 0.0), np.where(follows, moved[:, 2], 0.0)
        _, turned, apart = self._moved.sums(follows / MOVED**2, *change, np.zeros_like(z))
        cross = cross + turned.reshape(len(TEMPOS), -1)
        error = square - (np.square(mean.real) + np.square(mean.imag)) / total + apart.reshape(len(TEMPOS), -1)
        error -= 2.0 * np.abs(cross)
        belief *= np.exp((error.min() - error) / 2.0)
        best = np.unravel_index(belief.argmax(), belief.shape)
        back = np.exp(-1j * np.angle(cross[best]))
        flat, up = self._now.points(best[1])
        gain = seen / (RATE * OWN)
        left = back * z - (flat + self._offset - np.conj(mean[best[1]]) / total)
        off = np.square(np.abs(left + self._offset)) + np.square(h - up + self._offset_up)
        self._misfit += (float(off[seen].mean()) - self._misfit) / (RATE * OWN)
        self._offset += gain * left
        self._offset *= np.minimum(1.0, MOST_OWN / np.maximum(np.abs(self._offset), 1e-9))
        self._offset_up = (self._offset_up + gain * (h - up)).clip(-MOST_OWN, MOST_OWN)


class _Expected:
    """The expected points of states, x + i y of shape (..., K) and heights, m, to be compared with measured ones."""

    def __init__(self, flat: NDArray[np.complex128], up: Array) -> None:
        count = flat.shape[-1]
        self._flat, height = np.conj(flat).reshape(-1, count).astype(np.complex64), up.reshape(-1, count)
        square = np.square(np.abs(self._flat)) + UP * np.square(height)
        self._real = np.concatenate([square, height], axis=1).astype(np.float32)

    def points(self, state: Any) -> tuple[Any, Any]:
        """The points of a state and their heights, (K,)."""
        return np.conj(self._flat[state]), self._real[state, self._flat.shape[1] :]

    def sums(
        self, weight: Array, z: NDArray[np.complex128], height: Array, offset: NDArray[np.complex128]
    ) -> tuple[Any, Any, Any]:
        """Of each state with its points offset sum w conj(q), sum w conj(q) z and sum w (|q|^2 + UP (g^2 - 2 g h))."""
        both = self._flat @ np.column_stack([weight, weight * z, weight * offset]).astype(np.complex64)
        real = self._real @ np.concatenate([weight, -2.0 * UP * weight * height]).astype(np.float32)
        shift = weight * np.conj(offset)
        square = real + 2.0 * both[:, 2].real + float(weight @ np.square(np.abs(offset)))
        return both[:, 0] + shift.sum(), both[:, 1] + shift @ z, square


def _plane(points: Array) -> NDArray[np.complex128]:
    return points[..., 0] + 1j * points[..., 1]
