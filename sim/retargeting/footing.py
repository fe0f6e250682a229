"""Footing: where the root of a robot goes so that its feet stand where they stand, neither in the floor nor above it.

A robot with other proportions than the human's slides and floats if its root just takes the human's path. Here

- the lowest point of its soles is as high above the floor as that of the human's soles, to scale, and nothing of it is
  ever below the floor: no fixed offset;
- what stands stays where it is: the root goes back by as much as the touching points of the robot's skin would have
  gone on. Those of a foot count as far as the human's heel or ball is still and low. Where nothing touches, or slides
  on purpose, the root takes the human's way, to scale.

The floor of the human is where its still foot is, because recordings stand a few centimetres off and even drift.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Sequence
from math import dist, exp, hypot

import mujoco
import numpy as np

from controller.mocap.posture import Pose
from controller.mocap.skeleton import Skeleton
from controller.rotations import Array
from sim.models.kinematic_tree import below
from sim.models.surface import LowestPoint, Surface
from sim.retargeting.flat_feet import FlatFeet
from sim.retargeting.human_soles import Sole, Soles

# In lengths of the leg: how far a sole may seem to be off the floor and still stand on it, and how close to the floor a
# point of the skin touches it.
STANDS = 0.02
TOUCHES = 0.006
# So many times as high as that a point counts no more.
CLOSE = 3.0
# Heel or ball is still if it is slower than this, in lengths of the leg a second. Hands and knees, whose stillness is
# not looked at, count as much as a foot of such a share.
STILL = 0.3
OTHERS = 0.2
NEAR = 0.05  # lengths of the leg above the floor: so high a still foot hardly stands
# So fast the floor follows a foot upwards, 1/s, that has been still for so long, s: at the top of a leap it is still
# for a moment. Down it follows any foot at once.
FOLLOWS, SURE = 60.0, 0.08
TELEPORT = 0.3  # lengths of the leg in one tick: nobody walked there
NOWHERE = -1e9  # the radius of what fills up the rows of soles with fewer points, m


class Footing:
    """Places the root of one robot, tick by tick."""

    def __init__(
        self,
        skeleton: Skeleton,
        model: mujoco.MjModel,
        feet: Sequence[int],
        root_rotation: Array,
        scale: float,
        dt: float,
        flat: FlatFeet | None = None,
    ) -> None:
        """Looks at the robot's skin.

        Args:
            skeleton: whose poses will come.
            model: the robot.
            feet: the bodies that are its right and left foot; none for a robot without feet.
            root_rotation: of the root body while the robot stands upright and faces x, shape (4,).
            scale: the robot's size over the human's.
            dt: seconds from one pose to the next.
            flat: the slopes of the human's feet, shared with who poses the robot's.
        """
        self.flat = flat or FlatFeet(dt)
        self._soles, self._human_leg = Soles(skeleton), max(skeleton.leg_length, 1e-3)
        self._model, self._data = model, mujoco.MjData(model)
        self._xmat = self._data.xmat.reshape(-1, 3, 3)
        self._turned, self._scale, self._dt = root_rotation.tolist(), scale, dt
        self._touches = TOUCHES * max(skeleton.leg_length * scale, 1e-3)
        self._surface, self._lowest = Surface.of(model), LowestPoint(model)
        self._find_soles(feet)
        self.reset()

    def _find_soles(self, feet: Sequence[int]) -> None:
        """The points of the bodies of the soles, as rows of equal length."""
        model, surface = self._model, self._surface
        sides = {body: side for side, foot in enumerate(feet) for body in below(model, foot)}
        sides = {body: side for body, side in sides.items() if (surface.body == body).any()}
        self._feet_known = len(set(sides.values())) == 2 == self._soles.count
        if not self._feet_known:  # then whatever is lowest stands
            sides = dict.fromkeys(sides or map(int, np.unique(surface.body)), 0)
        self._bodies, self._side = np.array([*sides], np.int64), np.array([*sides.values()], np.int64)
        self._sides = sorted(set(sides.values()))
        self._one_each = len(sides) == len(self._sides)
        most = max(int((surface.body == body).sum()) for body in sides)
        self._points, self._radius = np.zeros((len(sides), 3, most)), np.full((len(sides), most), NOWHERE)
        for row, body in enumerate(sides):
            mine = np.flatnonzero(surface.body == body)
            self._points[row, :, : len(mine)] = surface.centre[mine].T
            self._radius[row, : len(mine)] = surface.radius[mine]
        # The rest of the skin is looked at only where it comes close to the floor.
        self._other = surface.part(np.setdiff1d(surface.body, self._bodies))
        self._other_solids = np.flatnonzero(~np.isin(self._lowest.body, self._bodies))

    def reset(self, dt: float | None = None) -> None:
        """Forgets where it was: the next pose stands where the human stands.

        Args:
            dt: seconds from one pose to the next from now on; by default as before.
        """
        self._dt = dt or self._dt
        self.flat.tick(self._dt)
        self._floor: float | None = None
        self._still_for = 0.0
        self._human = self._root = (0.0, 0.0)
        self._others: Array | None = None

    def place(self, pose: Pose, qpos: Array) -> None:
        """Writes the root's position and rotation into qpos (nq,), whose joints are in place already."""
        qpos[3:7] = _product(pose.rotation[0].tolist(), self._turned)
        if len(pose.rotation) == 1:
            # Of a run recorded by version 1 only the human's root is known: the robot goes along its path.
            qpos[:3] = self._scale * pose.root_position
            return
        data = self._data
        data.qpos[:] = qpos
        data.qpos[:3] = 0.0
        mujoco.mj_kinematics(self._model, data)
        turn, at = self._xmat.take(self._bodies, axis=0), data.xpos.take(self._bodies, axis=0)
        soles = self._soles(pose, self.flat.slope)
        x, y = pose.root_position[:2].tolist()
        if self._floor is None or hypot(x - self._human[0], y - self._human[1]) > TELEPORT * self._human_leg:
            self._floor, self._before = min([sole.lowest for sole in soles]), soles
            self._human, self._root = (x, y), (self._scale * x, self._scale * y)
            self._turn, self._at, self._others = turn, at, None
        still = self._stillness(soles)
        raised = self._raised(soles, still)

        heights = np.matmul(turn[:, 2:], self._points)[:, 0]
        heights += at[:, 2:]
        heights -= self._radius
        lows = np.minimum.reduce(heights, axis=1)
        bounds = self._lowest.bounds(data)
        height = max(self._scale * raised - float(np.minimum.reduce(lows)), -self._lowest(data, bounds))
        # A foot stands on its own lowest points if the human's is still and low: a toe that trails may hold it up.
        if not self._one_each:
            lows = np.array([lows[self._side == foot].min() for foot in self._sides]).take(self._side)
        heights -= lows[:, None]
        weight = np.exp(heights * (-1.0 / self._touches))
        counts = np.array(self._standing(soles, still))
        weight *= (counts if self._one_each else counts.take(self._side))[:, None]
        touching = float(np.maximum.reduce(weight, axis=None))
        weight *= weight
        sums = np.add.reduce(weight, axis=1)
        moved = np.matmul(turn - self._turn, np.matmul(self._points, weight[:, :, None]))[:, :2, 0]
        moved += sums[:, None] * (at - self._at)[:, :2]
        gone_x, gone_y = np.add.reduce(moved).tolist()
        total = float(np.add.reduce(sums))
        others = self._others_gone(bounds, height)
        if others is not None:
            gone_x, gone_y, total = gone_x + others[0], gone_y + others[1], total + others[2]
            touching = max(touching, others[3])

        dx, dy = self._scale * (x - self._human[0]), self._scale * (y - self._human[1])
        if touching > 1e-6:
            dx = (1.0 - touching) * dx - touching * gone_x / total
            dy = (1.0 - touching) * dy - touching * gone_y / total
        self._root = self._root[0] + dx, self._root[1] + dy
        self._human, self._before, self._turn, self._at = (x, y), soles, turn, at
        qpos[0], qpos[1], qpos[2] = *self._root, height

    def _stillness(self, soles: list[Sole]) -> list[float]:
        """How still the heel and the ball of each foot are: 1 if they stand, towards 0 the faster they go."""
        slow = STILL * self._human_leg * self._dt
        still = []
        for foot, (now, before) in enumerate(zip(soles, self._before, strict=True)):
            heel, ball = dist(now.heel, before.heel), dist(now.ball, before.ball)
            still.append(1.0 / (1.0 + (min(heel, ball) / slow) ** 8))
            if max(ball, dist(now.ankle, before.ankle)) < 0.5 * slow and now is not before:
                self.flat.stood(foot, now.slope)
        return still

    def _standing(self, soles: list[Sole], still: list[float]) -> list[float]:
        """How much the points of each foot count: 1 for those of one that stands."""
        if not self._feet_known:
            return [OTHERS]
        assert self._floor is not None
        near, counts = NEAR * self._human_leg, []
        for share, sole in zip(still, soles, strict=True):
            counts.append(share * exp((self._floor - sole.lowest) / near))
        return counts

    def _raised(self, soles: list[Sole], still: list[float]) -> float:
        """How high the human's lowest sole is above its floor, m; the floor goes along with feet that stand."""
        assert self._floor is not None
        low, share = soles[0].lowest, still[0]
        for sole, other in zip(soles[1:], still[1:], strict=True):
            if sole.lowest < low:
                low, share = sole.lowest, other
        rise = low - self._floor
        self._still_for = self._still_for + self._dt if share > 0.5 else 0.0
        if rise > 0.0:
            rise *= min(FOLLOWS * self._dt, 1.0) if self._still_for > SURE else 0.0
        self._floor += rise
        return max(low - self._floor - STANDS * self._human_leg, 0.0)

    def _others_gone(self, bounds: Array, height: float) -> tuple[float, float, float, float] | None:
        """What of the other skin touches: how far it has gone, times its weight, x and y; its weight; how close."""
        if (
            not len(self._other_solids)
            or np.minimum.reduce(bounds.take(self._other_solids)) + height > CLOSE * self._touches
        ):
            self._others = None
            return None
        points = self._other.positions(self._data)
        weight = OTHERS * np.exp((points[:, 2] - self._other.radius + height) * (-1.0 / self._touches))
        before, self._others = points if self._others is None else self._others, points
        x, y = ((weight * weight) @ (points - before)[:, :2]).tolist()
        return x, y, float(weight @ weight), float(weight.max())


def _product(p: list[float], q: list[float]) -> list[float]:
    """The product of two quaternions."""
    a, b, c, d = p
    w, x, y, z = q
    return [
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ]
