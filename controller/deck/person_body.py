"""A person's whole body from a few of its points: a reservoir that they drive, taught by the motions of a library.

It is driven by the points as seen from the ground below their middle, x along their smoothed line from right to left.
In that frame it tells where the body faces, the place of its root, m, and the directions of all bones.
"""

from collections.abc import Callable, Sequence

import numpy as np

from controller.deck.phase_filter import RATE
from controller.motion.clip import between_rows
from controller.motion.rotations import Array, normalise, rotate, yaw
from controller.motion.skeleton import Skeleton
from controller.networks.reservoirs.completion import Completion, LiveCompletion

SMOOTHED = 0.2  # s, time constant of the line
STAND, NOISE, LOST = 20, 0.02, 0.25  # of what it is taught: steps for which it stands, m, and the share of frames
HELD = 0.5  # s for which a point that is not seen counts as where it was

Learn = Callable[[Sequence[tuple[Array, Array]], float], Completion]


def paired(points: Sequence[str]) -> list[tuple[int, int]]:
    """Which of these points are right and left of each other."""
    return [(points.index("r" + x[1:]), k) for k, x in enumerate(points) if x[0] == "l" and "r" + x[1:] in points]


def body_rows(skeleton: Skeleton, joints: Array, heading: Array) -> Array:
    """Where a body faces, its root and its bones' directions, (T, 2 + B, 3), of joints (T, 1 + B, 3), m, in the world.

    The headings (T,), rad, are those of the body.
    """
    faces = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    bones = normalise(joints[:, 1:] - joints[:, skeleton.parent + 1])
    return np.concatenate([faces[:, None], joints[:, :1], bones], axis=1)


class PersonBody:
    """The body from K points of these names, some of which are `paired`.

    It is taught by courses of the points (T, K, 3), m, and of `body_rows` (T, 2 + B, 3), at RATE.
    """

    def __init__(self, points: Sequence[str], courses: Sequence[tuple[Array, Array]], learn: Learn) -> None:
        self._pairs, examples = np.array(paired(points)).T, list[tuple[Array, Array]]()
        rng = np.random.default_rng(0)
        for places, rows in courses:  # there and back, once with a stand on the way, and at twice the tempo
            there, stand = np.arange(len(rows) - 1.0), rng.integers(len(rows) - 1)
            back = np.concatenate([there, there[-1:].repeat(STAND), there[::-1]])
            for at in (back, np.sort(np.append(there, np.full(STAND, stand))), there[::2]):
                seen, whole = (between_rows(x.reshape(len(x), -1), np.arange(len(x)), at) for x in (places, rows))
                measured = seen.reshape(len(at), -1, 3) + NOISE * rng.standard_normal((len(at), len(points), 3))
                measured[1:][rng.random(len(at) - 1) < LOST] = np.nan
                self._begin(len(points))
                frames = [(self._seen(one), *self._frame) for one in measured]
                given, middles, angles = (np.array(each) for each in zip(*frames, strict=True))
                body = whole.reshape(len(at), -1, 3)
                body[:, 1] -= middles
                examples.append((given, rotate(yaw(-angles)[:, None], body).reshape(len(at), -1)))
        self._begin(len(points))
        self._learned = learn(examples, RATE)
        self._live: LiveCompletion | None = None

    def step(self, measured: Array) -> Array | None:
        """Goes on by 1 / RATE s with points (K, 3), m, NaN where not seen: `body_rows`, if all were seen of late."""
        seen = self._seen(measured)
        if self._unseen.max() > HELD * RATE:
            self._live = None
            return None
        self._live = self._live or self._learned.follow(seen)
        rows = rotate(yaw(self._frame[1]), self._live.step(seen).reshape(-1, 3))
        rows[1] += self._frame[0]
        return rows

    def _begin(self, count: int) -> None:
        self._last, self._unseen, self._line = np.zeros((count, 3)), np.full(count, np.inf), 0j

    def _seen(self, measured: Array) -> Array:
        """What drives the reservoir, (3 K,)."""
        lost: Array = np.isnan(measured.sum(axis=1))
        self._last = np.where(lost[:, None], self._last, measured)
        self._unseen = np.where(lost, self._unseen + 1.0, 0.0)
        x, y, _ = (self._last[self._pairs[1]] - self._last[self._pairs[0]]).mean(0)
        self._line = self._line * np.exp(-1.0 / (RATE * SMOOTHED)) + complex(x, y)
        middle, angle = self._frame = self._last.mean(0) * [1.0, 1.0, 0.0], float(np.angle(self._line))
        return rotate(yaw(-angle), self._last - middle).ravel()
