"""The cause of a limb's wrong direction: its joints' ranges, their limits of speed, or the retargeter.

The angle between two limbs does not tell a solver's mistake from a joint's limit. So the best angles of each limb are
searched frame by frame, from the robot alone: seen from the trunk, its segments k point to

    d_k(q) = R(a_1, q_1) R(a_2, q_2) ... R(a_n, q_n) d_k(0),

with the axes a of the standing robot. Of angles spread over the ranges the best few are improved one hinge at a time:
with the others held, sum_k d_k(q) . g_k = A + B cos q_i + C sin q_i has its maximum in closed form (cyclic coordinate
descent, Wang and Chen 1991). As one segment may do better at the other's cost, limbs are compared as a whole: by the
angle whose 1 - cos is the mean of both.
"""

from collections.abc import Sequence
from typing import Any, Literal

import mujoco
import numpy as np

from controller.motion.rotations import Array, Flags
from sim.models.kinematic_tree import followers, path_to
from sim.robots.limb_directions import MEAN_LIMIT, WORST_LIMIT, LimbDirections, LimbSegment, degrees_between
from sim.robots.robot import Robot

Cause = Literal["out of reach", "held back", "carried wrongly"]
"""The joints' ranges, limits of speed and acceleration, or the retargeter."""
# Accepted error beyond the best within reach, degrees, or as a share of what is out of reach; rate of the search, Hz.
CLOSE, SHARE, RATE = 5.0, 0.25, 30.0
FULL = 0.99  # of a joint's speed limit
# Of the best angles: exponent of 2 of the first ones; number of the best that are improved; rounds; their end, rad.
SPREAD, FEW, ROUNDS, SETTLED = 12, 4, 30, 1e-3
GRID = 121  # number of angles for a hinge with followers, which has no closed form


def limb_causes(
    robot: Robot, directions: LimbDirections, wanted: Array, played: Array, goals: Array, rate: float
) -> list[tuple[Cause, dict[str, tuple[float, float]]]]:
    """The limbs beyond the limits, for T frames at a rate, Hz.

    Each has its cause, and by segment the mean and worst angle at the best joint angles, degrees.

    `wanted` and `played` are retargeted and played joints (T, J), rad, and `goals` the human's limbs as the
    robot's trunk sees them, (T, K, 3).
    """
    there = _pointing(robot, directions, played)
    off = degrees_between(there, goals)
    found = []
    for limb in directions.limbs:
        rows = [directions.segments.index(segment) for segment in limb]
        often = bool(off[:, rows].mean(axis=0).max() > MEAN_LIMIT)
        if not often and off[:, rows].max() <= WORST_LIMIT:
            continue
        worst = off[:, rows].max(axis=1)
        frames = np.union1d(np.arange(0, len(off), max(round(rate / RATE), 1)), [int(worst.argmax())])
        own = goals[frames][:, rows]
        best_of = ReachableLimb(robot, directions, limb)
        reach = best_of.best(own)

        far, least = worst[frames] > WORST_LIMIT, _as_a_whole(reach, own)
        cause: Cause = "out of reach"
        if _does_worse(there[frames][:, rows], own, least, often, far):
            # The retargeter keeps to the joints' speeds too: what it does on its way is no mistake.
            joints = best_of.joints
            step = np.abs(np.diff(wanted[:, joints], axis=0, prepend=wanted[:1, joints]))
            fast = np.any(step * rate >= FULL * robot.limits.velocity[joints], axis=1)
            there_now = np.flatnonzero(~fast[frames])
            meant, aim = _pointing(robot, directions, wanted[frames[there_now]])[:, rows], own[there_now]
            short = degrees_between(meant, aim)
            often = bool(len(short) and short.mean(axis=0).max() > MEAN_LIMIT)
            far = short.max(axis=1) > WORST_LIMIT
            cause = "carried wrongly" if _does_worse(meant, aim, least[there_now], often, far) else "held back"
        best = degrees_between(reach, own)
        means = zip(best.mean(axis=0).tolist(), best.max(axis=0).tolist(), strict=True)
        found.append((cause, dict(zip((segment.name for segment in limb), means, strict=True))))
    return found


def _does_worse(there: Array, goals: Array, least: Array, often: bool, far: Flags) -> bool:
    """Whether limbs (F, s, 3) exceed the least error (F,) within reach: often, or in frames `far` (F,)."""
    missing = _as_a_whole(there, goals) - least
    passes = np.maximum(CLOSE, SHARE * least)
    return bool((often and missing.mean() > passes.mean()) or (missing > passes)[far].any())


def _pointing(robot: Robot, directions: LimbDirections, joints: Array) -> Array:
    """Directions of the segments at joints (T, J), shape (T, K, 3)."""
    qpos, found = robot.model.qpos0.copy(), []
    for q in joints:
        robot.layout.place(q, qpos)
        found.append(directions(qpos))
    return np.array(found).reshape(len(joints), len(directions.segments), 3)


def _as_a_whole(there: Array, goals: Array) -> Array:
    """Error of limbs (T, s, 3) as a whole, shape (T,), degrees."""
    angles: Array = np.degrees(np.arccos(np.clip(np.einsum("tsi,tsi->ts", there, goals).mean(axis=1), -1.0, 1.0)))
    return angles


class ReachableLimb:
    """The best directions of one limb of s segments on n hinges, of which `joints` (m,), played indices, are free."""

    def __init__(self, robot: Robot, directions: LimbDirections, segments: Sequence[LimbSegment]) -> None:
        """Args: the robot; its segments; those of the limb."""
        from scipy.stats import qmc  # not where a library is only played

        at, model, joints, limits = directions.standing, robot.model, robot.joints, robot.limits
        trunk, body = path_to(model, segments[0].trunk), path_to(model, segments[-1].body)
        common = len([one for one in trunk if one in body])
        way = [(b, -1.0) for b in reversed(trunk[common:])] + [(b, 1.0) for b in body[common:]]
        hinges = [
            (joint, sign)
            for b, sign in way
            for joint in np.flatnonzero(model.jnt_bodyid == b).tolist()[:: int(sign)]
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        ]
        self._axis = np.array([sign * at.xaxis[joint] for joint, sign in hinges])
        self._direction = np.array([at.xmat[one.body].reshape(3, 3) @ one.direction for one in segments])
        ends = [path_to(model, one.body) for one in segments]
        self._turns = np.array([[sign < 0.0 or model.jnt_bodyid[j] in end for end in ends] for j, sign in hinges])
        led = followers(model)
        leaders = [led[joint][0] if joint in led else joint for joint, _ in hinges]
        names = [model.joint(leader).name for leader in leaders]
        free = sorted({name for name in names if name in joints}, key=names.index)
        self._leader = [free.index(name) if name in free else None for name in names]
        self._stand = [float(at.qpos[model.jnt_qposadr[joint]]) for joint, _ in hinges]
        self._curve = [
            led[joint][1] if joint in led else np.array([0.0, 1.0] if leader is not None else [stand])
            for (joint, _), leader, stand in zip(hinges, self._leader, self._stand, strict=True)
        ]
        self.joints = np.array([joints.index(name) for name in free], np.int64)
        self._lower, self._upper = limits.lower[self.joints], limits.upper[self.joints]
        by = self._leader
        self._alone = [by.count(k) == 1 and hinges[by.index(k)][0] not in led for k in range(len(free))]
        spread = qmc.Sobol(max(len(free), 1), scramble=False).random_base2(SPREAD)[:, : len(free)]
        self._angles = self._lower + spread * (self._upper - self._lower)
        self._there = self._directions(self._angles)

    def best(self, goals: Array) -> Array:
        """The directions (T, s, 3) within reach that are closest, in the sum of 1 - cos, to goals (T, s, 3)."""
        if not self._lower.size:
            return np.tile(self._direction, (len(goals), 1, 1))
        alike = goals.reshape(len(goals), -1) @ self._there.reshape(len(self._there), -1).T
        start = np.argpartition(-alike, FEW, axis=1)[:, :FEW]
        q, wanted = self._angles[start].reshape(-1, len(self._lower)), np.repeat(goals, FEW, axis=0)
        for _ in range(ROUNDS):
            before = q.copy()
            self._better(q, wanted)
            if np.abs(q - before).max() < SETTLED:
                break
        there = self._directions(q)
        alike = np.einsum("fsi,fsi->f", there, wanted).reshape(len(goals), FEW)
        return there[np.argmax(alike, axis=1) + FEW * np.arange(len(goals))]

    def _better(self, q: Array, goals: Array) -> None:
        """Improves one free hinge after another in q (F, m), for goals (F, s, 3)."""
        for k, alone in enumerate(self._alone):
            if alone:
                q[:, k] = self._best_angle(k, q, goals)
            else:
                tried = np.linspace(self._lower[k], self._upper[k], GRID)
                others = np.repeat(q, GRID + 1, axis=0)
                others[:, k] = np.concatenate([np.tile(tried, (len(q), 1)), q[:, k : k + 1]], axis=1).ravel()
                there = self._directions(others).reshape(len(q), GRID + 1, -1)
                best = np.argmax(np.einsum("fgi,fi->fg", there, goals.reshape(len(q), -1)), axis=1)
                q[:, k] = others.reshape(len(q), GRID + 1, -1)[np.arange(len(q)), best, k]

    def _best_angle(self, k: int, q: Array, goals: Array) -> Array:
        hinge = self._leader.index(k)
        axis, turns = self._axis[hinge], self._turns[hinge][:, None]
        segments, wanted = self._directions(q, hinge + 1), goals
        for before in range(hinge):
            back = _turn(self._axis[before], -self._angle(before, q), wanted)
            wanted = np.where(self._turns[before][:, None], back, wanted)
        flat = segments - (segments @ axis)[..., None] * axis
        cosine = np.sum(turns * wanted * flat, axis=(1, 2))
        sine = np.sum(turns * wanted * np.cross(axis, segments), axis=(1, 2))
        lower, upper = self._lower[k] - self._stand[hinge], self._upper[k] - self._stand[hinge]
        angle = lower + np.mod(np.arctan2(sine, cosine) - lower, 2.0 * np.pi)
        ends = np.array([lower, upper])
        nearer = ends[np.argmax(np.outer(cosine, np.cos(ends)) + np.outer(sine, np.sin(ends)), axis=1)]
        return np.where(angle <= upper, angle, nearer) + self._stand[hinge]

    def _directions(self, q: Array, first: int = 0) -> Array:
        """The segments' directions (F, s, 3) at free angles (F, m), turned by the hinges from one on."""
        found = np.tile(self._direction, (len(q), 1, 1))
        for hinge in reversed(range(first, len(self._axis))):
            found = np.where(self._turns[hinge][:, None], _turn(self._axis[hinge], self._angle(hinge, q), found), found)
        return found

    def _angle(self, hinge: int, q: Array) -> Array:
        """Angle of a hinge from the standing robot, shape (F,), at free angles (F, m)."""
        leader = self._leader[hinge]
        led_by = np.zeros(len(q)) if leader is None else q[:, leader]
        angle: Any = np.polynomial.polynomial.polyval(led_by, self._curve[hinge])
        return angle - self._stand[hinge]


def _turn(axis: Array, angle: Array, vectors: Array) -> Array:
    """Vectors (F, s, 3) turned about a unit axis (3,) by angles (F,) (Rodrigues)."""
    along = (vectors @ axis)[..., None] * axis
    cosine, sine = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    return along + cosine * (vectors - along) + sine * np.cross(axis, vectors)
