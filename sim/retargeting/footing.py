"""Footing: places the root of a robot so that standing feet stay in place, on the floor.

A robot with other proportions slides and floats along the human's path. So

- the height of its lowest sole is that of the human's, to scale, and nothing is ever below the floor;
- the root moves against the displacement of the touching points of the robot's skin. Those of a foot count as far as
  the human's heel or ball is still and low, and most for a still sole. Where nothing touches, or slides on purpose, the
  root follows the human's path, to scale.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.encodings.robot_joints import RootPath
from controller.motion.rotations import IDENTITY, Array
from controller.motion.skeleton import Pose
from sim.models.kinematic_tree import Scratch, UprightPelvis, below
from sim.models.surface import LowestPoint, Surface
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.robot_trunk import RobotTrunk

# Height of a touching point of the skin, lengths of the leg, and the multiple of it from which a point is ignored.
TOUCHES, CLOSE = 0.002, 3.0
OTHERS = 0.2  # weight of hands and knees, whose stillness is not measured, as the share of a standing foot
NOWHERE = -1e9  # radius of padding points in the rows of soles, m


class Footing:
    """Places the root of one robot, tick by tick."""

    def __init__(
        self,
        stance: HumanStance,
        model: mujoco.MjModel,
        feet: Sequence[int],
        root_rotation: Array,
        scale: float,
        pelvis: UprightPelvis | None = None,
        trunk: RobotTrunk | None = None,
    ) -> None:
        """Args: stance of the human; robot; its right and left foot, if any; rotation (4,) of a root that faces x.

        The stance is shared with the retargeter; `scale` is the robot's size over the human's; `pelvis` is that of a
        robot whose root is above its waist; `trunk` turns the pelvis, by default as the human's root.
        """
        self.stance = stance
        self._model, self._data = model, Scratch(model)
        # A root whose own axes are those of an upright robot is turned as the human's.
        self._turned = root_rotation if np.any(root_rotation != IDENTITY) else None
        self._scale, self._pelvis, self._trunk = scale, pelvis, trunk
        self._touches = TOUCHES * stance.leg * scale
        self._surface, self._lowest = Surface.touching(model), LowestPoint(model)
        # The points of the bodies of the soles, as rows of equal length.
        surface = self._surface
        sides = {body: side for side, foot in enumerate(feet) for body in below(model, foot)}
        sides = {body: side for body, side in sides.items() if (surface.body == body).any()}
        self._feet_known = len(set(sides.values())) == 2 == self.stance.feet
        if not self._feet_known:  # then the lowest body stands
            sides = dict.fromkeys(sides or map(int, np.unique(surface.body)), 0)
        self._bodies, self._side = np.array([*sides], np.int64), np.array([*sides.values()], np.int64)
        self._side_of_row = [*sides.values()]
        self._sides = sorted(set(sides.values()))
        self._one_each = len(sides) == len(self._sides)
        most = max(int((surface.body == body).sum()) for body in sides)
        self._points, self._radius = np.zeros((len(sides), 3, most)), np.full((len(sides), most), NOWHERE)
        for row, body in enumerate(sides):
            mine = np.flatnonzero(surface.body == body)
            self._points[row, :, : len(mine)] = surface.centre[mine].T
            self._radius[row, : len(mine)] = surface.radius[mine]
        # The rest of the skin counts only close to the floor.
        self._other = surface.part(np.setdiff1d(surface.body, self._bodies))
        self._other_solids = np.flatnonzero(~np.isin(self._lowest.body, self._bodies))
        self.reset()

    def reset(self, dt: float | None = None) -> None:
        """Resets place and stance: the next pose stands where the human stands; poses are dt seconds apart."""
        self.stance.reset(dt)
        self._human: tuple[float, float] | None = None
        self._root = (0.0, 0.0)

    def heading(self, human: float) -> float:
        """Where the robot faces whose human has a heading, rad."""
        return human

    def place(self, pose: Pose, qpos: Array) -> None:
        """Writes the root's position and rotation into qpos (nq,), whose joints are placed."""
        human = pose.rotation[0]
        if self._trunk is not None and len(pose.rotation) > 1:
            human = self._trunk.rotation(pose)
        if self._turned is None:
            qpos[3:7] = human
        else:
            mujoco.mju_mulQuat(qpos[3:7], human, self._turned)
        if len(pose.rotation) == 1:
            # Runs recorded by version 1 have the human's root only.
            qpos[:3] = self._scale * pose.root_position
            return
        stance, data = self.stance, self._data
        stance(pose, "root")
        data.qpos[:] = qpos
        data.qpos[:3] = 0.0
        if self._pelvis is None:
            mujoco.mj_kinematics(self._model, data)
        else:
            self._pelvis.place(data, human)
            qpos[3:7] = data.qpos[3:7]
        points = np.matmul(data.xmat.take(self._bodies, axis=0).reshape(-1, 3, 3), self._points)
        points += data.xpos.take(self._bodies, axis=0)[:, :, None]
        x, y = pose.root_position[:2].tolist()
        if self._human is None or stance.begun:
            self._human, self._root = (x, y), (self._scale * x, self._scale * y)
            self._before, self._others = points, None

        heights = points[:, 2] - self._radius
        lows = np.minimum.reduce(heights, axis=1)
        bounds = self._lowest.bounds(data)
        height = max(self._scale * stance.raised - min(lows.tolist()), -self._lowest(data, bounds))
        # A foot stands on its own lowest points if the human's is still and low: a toe that trails may hold it up.
        if not self._one_each:
            lows = np.array([lows[self._side == foot].min() for foot in self._sides]).take(self._side)
        heights -= lows[:, None]
        heights *= -2.0 / self._touches
        weight = np.exp(heights, out=heights)
        totals = np.add.reduce(weight, axis=1).tolist()
        ways = np.matmul(points[:, :2] - self._before[:, :2], weight[:, :, None])[:, :, 0].tolist()
        counts = stance.holding if self._feet_known else (OTHERS,)
        touching = max(counts)
        total = gone_x = gone_y = 0.0
        for side, own, (x_way, y_way) in zip(self._side_of_row, totals, ways, strict=True):
            square = counts[side] * counts[side]
            total, gone_x, gone_y = total + square * own, gone_x + square * x_way, gone_y + square * y_way
        others = self._others_gone(bounds, height)
        if others is not None:
            gone_x, gone_y, total = gone_x + others[0], gone_y + others[1], total + others[2]
            touching = max(touching, others[3])

        dx, dy = self._scale * (x - self._human[0]), self._scale * (y - self._human[1])
        if touching > 1e-6:
            dx = (1.0 - touching) * dx - touching * gone_x / total
            dy = (1.0 - touching) * dy - touching * gone_y / total
        self._root = self._root[0] + dx, self._root[1] + dy
        self._human, self._before = (x, y), points
        qpos[0], qpos[1], qpos[2] = *self._root, height

    def _others_gone(self, bounds: Array, height: float) -> tuple[float, float, float, float] | None:
        """The touching rest of the skin: displacement times weight, x and y; weight; largest contact; or None."""
        lowest = np.minimum.reduce(bounds.take(self._other_solids), initial=np.inf)
        if lowest + height > CLOSE * self._touches:
            self._others = None
            return None
        points = self._other.positions(self._data)
        weight = OTHERS * np.exp((points[:, 2] - self._other.radius + height) * (-1.0 / self._touches))
        before, self._others = points if self._others is None else self._others, points
        x, y = ((weight * weight) @ (points - before)[:, :2]).tolist()
        return x, y, float(weight @ weight), float(weight.max())


class FixedBase(Footing):
    """Places the root of a robot without legs: it stays where it stands, upright, whatever way the human goes."""

    def __init__(self, stance: HumanStance, model: mujoco.MjModel, root_rotation: Array) -> None:
        """Args: as of `Footing`; the root stands at the model's own place."""
        self.stance = stance
        self._place = np.concatenate([model.qpos0[:3], root_rotation])

    def reset(self, dt: float | None = None) -> None:
        self.stance.reset(dt)

    def place(self, pose: Pose, qpos: Array) -> None:
        qpos[:7] = self._place


class BakedRoot(Footing):
    """Places the root of a robot whose motions were carried to it beforehand: where it was, footing included."""

    def __init__(self) -> None:
        self._path = RootPath()

    def reset(self, dt: float | None = None) -> None:
        self._path.reset()

    def heading(self, human: float) -> float:
        """Where the robot faces, rad; the human's heading is not known."""
        return self._path.heading

    def place(self, pose: Pose, qpos: Array) -> None:
        qpos[:7] = self._path(pose)
