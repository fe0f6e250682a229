"""Blends motions that run side by side, bone by bone: each bone shows the weighted mean of its rotations.

A rotation is a point q of the sphere of unit quaternions, and so is -q: the two sides of one rotation, which differ by
a whole turn. Of each motion's bone the side is kept by continuity, so that no bone passes through zero or changes sides
when two motions are half a turn apart. With weights w_i the blend shows the mean m of the points on these sides,

    sum_i w_i log_m(q_i) = 0,

found from the normalised sum of w_i q_i by m <- exp_m(sum_i w_i log_m(q_i)) (Buss and Fillmore 2001). It does not
depend on the order of the motions, and one of weight 0 has no part in it. Of two motions the first such step is exact:
m lies on the arc from one to the other, as far along it as the weight says.

All motions are seen from a heading that follows that of the hips smoothly: while a body stands on its hands the heading
of the hips flies round, but the body does not.

A bone that is a whole turn ahead of the others has to change sides some time. That turns the mean by up to 2 pi w at
once, which then runs out smoothly (`TurnsLeft`). Where w is near 0 or 1 that is little or nothing, so there the side is
changed from half a turn on.

Where bone directions alone are known, the twist of a bone follows a rule (`motion.orientation`) and may jump while the
bone itself does not. Then its last rotation is kept, turned the shortest way to where the bone points now.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos

import numpy as np
from numpy.typing import NDArray

from controller.motion import rotations as rot
from controller.motion.quintic import run_out
from controller.motion.rotations import Array
from controller.motion.skeleton import Posture

HEADING_RATE = 4.0  # 1/s, at which the smooth heading follows that of the hips (critically damped, of second order)
LONGER = 1.2 * np.pi  # a bone changes sides when it is pi + LONGER min(w, 1 - w) rad ahead of the mean of the others
# The shortest time in which a turn runs out, s; half a turn takes a second, others its root of their share of that.
LEAST_SECONDS = 0.2
TWIST_JUMP = 1.0  # a rotation that changes by more than this (rad) in a tick is a jump of a bone's twist
MEAN_STEPS = 3  # of the mean of more than two motions (`benchmarks many_blends` has what is left to the mean itself)
_HALF_TURN = np.pi - 1e-6  # rad; of a turn of that angle it is chance which way is the short one
_LITTLE = 1e-12


@dataclass(slots=True)
class SmoothHeading:
    """The heading of one motion, smoothed."""

    rate: float  # of the smooth one, rad/s
    offset: float = 0.0  # the heading of the hips less the smooth one, rad

    def advance(self, turn_rate: float, dt: float) -> None:
        """Follows a heading that turns by `turn_rate` (rad/s) for dt seconds."""
        change = HEADING_RATE**2 * self.offset + 2.0 * HEADING_RATE * (turn_rate - self.rate)
        self.rate += change * dt
        self.offset += (turn_rate - self.rate) * dt

    def in_frame(self, posture: Posture) -> tuple[Array, Array]:
        """The rotations (1 + B, 4) and the velocity (3,) of a posture, seen from the smooth heading."""
        back = rot.yaw(self.offset)
        return rot.multiply(back, posture.rotation), rot.rotate(back, np.array([*posture.velocity, 0.0]))


def smooth_headings(turn_rate: Array, dt: float) -> tuple[Array, Array]:
    """How a `SmoothHeading` follows hips that turn at rates (S,), rad/s, dt s apart, from rest: offset and rate."""
    hips: list[float] = turn_rate.tolist()
    smooth, seen = SmoothHeading(hips[0]), [(0.0, hips[0])]
    for turn in hips[1:]:
        smooth.advance(turn, dt)
        seen.append((smooth.offset, smooth.rate))
    offsets, rates = np.array(seen).T
    return offsets, rates


class TurnsLeft:
    """Turns of a number of bones that run out along quintics."""

    def __init__(self, bones: int) -> None:
        self._turn, self._rate = np.zeros((2, bones, 3))
        self._elapsed, self._seconds = np.ones((2, bones, 1))

    @property
    def lasts(self) -> bool:
        """Whether anything is left."""
        return bool((self._elapsed < self._seconds).any())

    @property
    def now(self) -> Array:
        """What is left of each, as rotation vectors, shape (bones, 3)."""
        value, slope = run_out(np.minimum(self._elapsed / self._seconds, 1.0))
        return value * self._turn + slope * self._seconds * self._rate

    def advance(self, dt: float) -> None:
        """Goes dt seconds on."""
        self._elapsed += dt

    def begin(self, bones: NDArray[np.int64], turn: Array, rate: Array) -> None:
        """Gives some bones turns (n, 3), rad, that change at rates (n, 3), rad/s, to run out from now on."""
        share = np.linalg.norm(turn, axis=-1, keepdims=True) / np.pi
        self._turn[bones], self._rate[bones], self._elapsed[bones] = turn, rate, 0.0
        self._seconds[bones] = np.maximum(LEAST_SECONDS, np.sqrt(share))


class PostureBlend:
    """Motions that are blended, each a posture per tick; at first there is one.

    `rest_direction` has the directions of the bones in the rest pose, shape (B, 3), where their twist follows a rule.
    """

    def __init__(self, first: Posture, rest_direction: Array | None = None) -> None:
        self._rest_direction = rest_direction
        self._headings = [SmoothHeading(float(first.turn_rate))]
        self._points = first.rotation[None].copy()  # of each motion and bone, on its side
        self._weights = np.ones(1)
        self._mean = first.rotation
        self._offset = 0.0
        self._left = TurnsLeft(len(first.rotation))
        self._held = False

    @property
    def settling(self) -> bool:
        """Whether a bone is still on its way from one side to the other."""
        return self._left.lasts

    def add(self, posture: Posture) -> None:
        """Adds a motion, the last from now on, with a weight of 0 so far; its heading is that of the blend."""
        points = posture.rotation
        self._headings.append(SmoothHeading(float(posture.turn_rate)))
        points = np.where(rot.dot(points, self._mean)[:, None] < 0.0, -points, points)
        self._points = np.concatenate([self._points, points[None]])
        self._weights = np.append(self._weights, 0.0)

    def hold_sides(self, points: Array) -> None:
        """Has each bone stay on the sides of these points, (M, 1 + B, 4), near those of the motions, while it can."""
        # That changes nothing that is shown while one motion has all the weight.
        near = np.where(_product(self._points, points) < 0.0, -1.0, 1.0)
        self._points = near[0] * near * self._points
        self._held = True

    def keep(self, motions: Sequence[int]) -> None:
        """Keeps these motions, in this order, and drops the others, whose weight is 0."""
        self._headings = [self._headings[motion] for motion in motions]
        self._points, self._weights = self._points[[*motions]], self._weights[[*motions]]

    def advance(self, postures: Sequence[Posture], weights: Sequence[float], dt: float) -> Posture:
        """The blend dt seconds later, with the weights of the motions in it, which sum to 1.

        Where one of them is 1 it is the posture of that motion, unchanged, unless it is `settling`.
        """
        share, before, was = np.array(weights), self._points, self._weights
        self._points, self._weights = np.empty_like(before), share
        offset = rate = height = 0.0
        velocity = np.zeros(3)
        for motion, (heading, posture) in enumerate(zip(self._headings, postures, strict=True)):
            weight = weights[motion]
            heading.advance(float(posture.turn_rate), dt)
            seen, its_velocity = heading.in_frame(posture)
            self._points[motion] = self._followed(seen, before[motion])
            offset, rate = offset + weight * heading.offset, rate + weight * heading.rate
            height, velocity = height + weight * float(posture.height), velocity + weight * its_velocity
        left = self._left.now if self._left.lasts else None
        self._left.advance(dt)
        sides = self._change_sides(np.abs(share))
        shown = self._mean = weighted_mean(self._points, share)
        if sides is not None:
            self._begin_turns(sides, (before, self._points), (was, share), left, dt)
        if self._left.lasts:
            shown = rot.multiply(rot.from_rotation_vector(self._left.now), shown)
        # Seen from a heading again that is the hips' own when one motion is left.
        turn_rate = rate + (offset - self._offset) / max(dt, 1e-9)
        self._offset = offset
        forth = rot.yaw(-offset)
        return Posture(
            np.array(height), rot.rotate(forth, velocity)[:2], np.array(turn_rate), rot.multiply(forth, shown)
        )

    def _followed(self, seen: Array, last: Array) -> Array:
        """The points of one motion, shape (1 + B, 4), on the sides of its last ones."""
        points = np.where(_product(seen, last) < 0.0, -seen, seen)
        if self._rest_direction is not None:
            jumps = _product(points, last)[1:, 0] < cos(0.5 * TWIST_JUMP)
            if True in jumps:
                jumped = np.flatnonzero(jumps)
                rest, bones = self._rest_direction[jumped], jumped + 1
                turn = rot.between(rot.rotate(last[bones], rest), rot.rotate(points[bones], rest))
                points[bones] = rot.multiply(turn, last[bones])
        return points

    def _change_sides(self, weight: Array) -> Array | None:
        """Has motions that are too far ahead of the others change sides, for each bone one after the other.

        Returns -1 for each motion and bone that has changed and has a weight, 1 for all others, shape (M, 1 + B);
        None if there is no such one.
        """
        points, idle = self._points, weight == 0.0
        longer = np.full(len(weight), 0.5) if self._held else np.abs(weight - np.rint(weight))
        least = -np.sin(0.5 * LONGER * longer)[:, None]
        sides: Array | None = None
        for _ in range(len(points)):
            parts = weight[:, None, None] * points
            others = parts.sum(0) - parts
            length = np.sqrt(_product(others, others)[..., 0])
            beyond = least * length - _product(points, others)[..., 0]
            if not (beyond > _LITTLE).any():
                break
            # Of two motions both are as far ahead of the other: the one with less weight changes.
            first = (beyond / np.maximum(length, _LITTLE) - _LITTLE * weight[:, None] - 9.0 * idle[:, None]).argmax(0)
            changes = (beyond > _LITTLE) & (idle[:, None] | (np.arange(len(points))[:, None] == first))
            points[changes] *= -1.0
            if changes[~idle].any():
                sides = np.ones(changes.shape) if sides is None else sides
                sides[changes & ~idle[:, None]] *= -1.0
        return sides

    def _begin_turns(
        self, sides: Array, points: tuple[Array, Array], weights: tuple[Array, Array], left: Array | None, dt: float
    ) -> None:
        """Begins the turns that lead from the mean on the new sides to what would be shown on those before.

        The points (M, 1 + B, 4) are those a tick ago on the old sides, and now on the new ones; the weights (M,) those
        a tick ago and now; `left` is what was left of earlier turns a tick ago, shape (1 + B, 3), rad, or None.
        """
        bones = np.flatnonzero((sides < 0.0).any(0))
        change = sides[:, bones, None]
        was, now = points[0][:, bones], points[1][:, bones]
        shown_before = weighted_mean(was, weights[0])
        if left is not None:
            shown_before = rot.multiply(rot.from_rotation_vector(left[bones]), shown_before)
        shown = rot.multiply(rot.from_rotation_vector(self._left.now[bones]), weighted_mean(change * now, weights[1]))
        before = rot.to_rotation_vector(
            rot.multiply(shown_before, rot.conjugate(weighted_mean(change * was, weights[0])))
        )
        turn = rot.to_rotation_vector(rot.multiply(shown, rot.conjugate(self._mean[bones])))
        # Half a turn runs out against the way on which the bone turns, which is slower than along with it.
        angle = np.linalg.norm(turn, axis=-1)
        along = rot.dot(turn, rot.to_rotation_vector(rot.multiply(shown, rot.conjugate(shown_before)))) < 0.0
        around = np.flatnonzero(along & (angle > _HALF_TURN))
        turn[around] *= 1.0 - 2.0 * np.pi / angle[around, None]
        self._left.begin(bones, turn, (turn - rot.nearest_rotation_vector(before, turn)) / max(dt, 1e-9))


def weighted_mean(points: Array, weights: Array) -> Array:
    """The mean of unit quaternions (M, ..., 4) on the sides that are given, with weights (M, ...) that sum to 1."""
    share = weights.reshape(*weights.shape, *[1] * (points.ndim - weights.ndim))
    mean = rot.normalise((share * points).sum(0))
    for _ in range(MEAN_STEPS if len(points) > 2 else 1):
        cosine = _product(points, mean)
        across = points - cosine * mean
        sine = np.sqrt(_product(across, across))
        step = (share * np.arctan2(sine, cosine) / np.maximum(sine, _LITTLE) * across).sum(0)
        angle = np.sqrt(_product(step, step))
        mean = rot.normalise(np.cos(angle) * mean + np.sin(angle) / np.maximum(angle, _LITTLE) * step)
    return mean


def _product(a: Array, b: Array) -> Array:
    """The scalar products along the last axis, shape (..., 1), with fewer calls than `rotations.dot`."""
    return np.matmul(a[..., None, :], b[..., None])[..., 0]
