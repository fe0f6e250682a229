"""A robot beside a human in the world, by the axes of its joints and the joints of the recording's file.

Nothing here is shared with retargeting: the robot's joints are named by hand (`world_robots`), its points follow from
their axes and from its solids, and the human's joints come from `faithful_files`.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from benchmarks.recordings.faithful_files import Recorded, leg_length
from benchmarks.robots.world_reach import ArmReach
from benchmarks.robots.world_robots import Limbs, WorldRobot

Array = NDArray[np.float64]

SIDES = "rl"
LINES = {"thigh": ("hip", "kne"), "shank": ("kne", "ank"), "upper_arm": ("sho", "elb"), "forearm": ("elb", "wri")}
ARM = ("upper_arm", "forearm")
SEARCHED = 10.0  # rate of frames in which the best angles of arms are searched, Hz
STILL, LOW = 0.15, 0.08  # of a ball that stands: legs a second, and legs above the floor
FLOOR = 0.02  # share of the frames whose lowest point is below the floor
TIP = 0.1  # of a forearm without a wrist, as a share of its length
AT_END = 0.02  # rad from the end of a range
ROUNDING = 1e-6


@dataclass(frozen=True)
class Human:
    """What a person did in T frames."""

    lines: dict[str, Array]  # "r_thigh" and so on, and "trunk": unit vectors, shape (T, 3)
    hands: Array  # height of the lower hand above the floor, shares of the hip's height when standing, shape (T,)
    stands: Array  # whether the right and the left foot stand, shape (2, T)
    slide: float  # mean speed of the balls of feet that stand along the floor, mm/s


def human(recorded: Recorded, frames: slice) -> Human:
    """The joints of a file in some of its frames."""
    at = {name: place[frames] for name, place in recorded.places.items()}
    leg = leg_length(recorded.places)
    feet = np.stack([at[side + end][:, 2] for side in SIDES for end in ("ank", "foo") if side + end in at])
    floor = np.quantile(feet.min(axis=0), FLOOR)
    ankle = np.quantile(np.minimum(at["rank"][:, 2], at["lank"][:, 2]), FLOOR) - floor
    lines = {f"{side}_{name}": at[side + b] - at[side + a] for side in SIDES for name, (a, b) in LINES.items()}
    lines["trunk"] = at["lsho"] + at["rsho"] - at["lhip"] - at["rhip"]
    hands = np.minimum(at["rwri"][:, 2], at["lwri"][:, 2]) - floor
    stands, slides = [], []
    for side in SIDES:
        ball = at.get(side + "foo", at[side + "ank"])
        speed = np.linalg.norm(np.gradient(ball, axis=0), axis=1) * recorded.rate
        low = ball[:, 2] - np.quantile(ball[:, 2], FLOOR)
        stands.append((speed < STILL * leg) & (low < LOW * leg))
        step = 1000.0 * recorded.rate * np.linalg.norm(np.diff(ball[:, :2], axis=0), axis=1)
        slides.append(step[stands[-1][1:]])
    slide = float(np.mean(np.concatenate(slides))) if np.any(stands) else 0.0
    return Human({k: _unit(v) for k, v in lines.items()}, hands / (leg + ankle), np.array(stands), slide)


class RobotPoints:
    """The points of one robot by its axes; `up` (4,) turns its root body upright."""

    def __init__(self, robot: WorldRobot, model: mujoco.MjModel, up: Array) -> None:
        self.model, self._data = model, mujoco.MjData(model)
        self._data.qpos[3:7] = up
        mujoco.mj_kinematics(model, self._data)
        self._solid, self._body, self._radius = _solid_points(model)
        self._lines: dict[str, tuple[int, Array]] = {}
        self.feet: list[Array] = []  # rows of the solid points of each foot
        hips, shoulders, tips, legs, ankles = [], [], [], [], []
        for side, name in zip(SIDES, robot.sides, strict=True):
            hip, knee, ankle, foot = self._limb(robot.leg, name, f"{side}_thigh", f"{side}_shank")
            self.feet.append(np.flatnonzero(np.isin(self._body, self._below(foot))))
            legs.append(float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)))
            low = (self._placed(self._solid, self._body)[self.feet[-1], 2] - self._radius[self.feet[-1]]).min()
            ankles.append(float(ankle[2] - low))
            shoulder, _, wrist, hand = self._limb(robot.arm, name, f"{side}_upper_arm", f"{side}_forearm")
            hips.append(hip)
            shoulders.append(shoulder)
            tips.append(self._local(hand, wrist))
        chest = self._trunk(robot.arm, robot)
        self.arms: dict[str, ArmReach] = {}
        for side, name in zip(SIDES, robot.sides, strict=True):
            hinges = [model.joint(one.format(name)).id for one in (*robot.arm.centre, robot.arm.middle)]
            lines = [self._lines[f"{side}_{part}"] for part in ARM]
            self.arms[side] = ArmReach(model, hinges, chest, lines)
        self._hips = self._local(self._trunk(robot.leg, robot), np.mean(hips, axis=0))
        self._shoulders = self._local(chest, np.mean(shoulders, axis=0))
        self._hands = tips
        self.hip_height = float(np.mean(legs) + np.mean(ankles))  # standing, m

    def __call__(self, qpos: Array) -> tuple[dict[str, Array], float, Array]:
        """Unit vectors of the lines, the height of the lower hand as in `Human`, the solid points (P, 3), at (nq,)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self._data)
        turned = self._data.xmat.reshape(-1, 3, 3)
        lines = {name: turned[body] @ line for name, (body, line) in self._lines.items()}
        lines["trunk"] = _unit(self._world(self._shoulders) - self._world(self._hips))
        hand = min(float(self._world(point)[2]) for point in self._hands)
        return lines, hand / self.hip_height, self._placed(self._solid, self._body)

    def chests(self, qpos: Array) -> Array:
        """Rotations of the chest in some frames (T, nq), shape (T, 3, 3)."""
        found = np.empty((len(qpos), 3, 3))
        for frame, q in enumerate(qpos):
            self._data.qpos[:] = q
            mujoco.mj_kinematics(self.model, self._data)
            found[frame] = self._data.xmat[self.arms["r"].chest].reshape(3, 3)
        return found

    def heights(self, places: Array) -> Array:
        """How high the solid points (P, 3) are, their roundness counted, m."""
        return places[:, 2] - self._radius

    def _limb(self, limbs: Limbs, side: str, upper: str, lower: str) -> tuple[Array, Array, Array, int]:
        """Keeps the lines of a limb; returns its three points and the body that its end belongs to."""
        model, data = self.model, self._data
        joints = [model.joint(name.format(side)).id for name in limbs.centre]
        middle = model.joint(limbs.middle.format(side)).id
        below = int(model.jnt_bodyid[middle])
        above, axis = int(model.body_parentid[below]), data.xaxis[middle]
        knee = data.xanchor[middle].copy()
        start = _nearest(data.xanchor[joints], data.xaxis[joints], knee)
        if limbs.end is None:
            end, last = self._tip(below, knee), below
        else:
            joint = model.joint(limbs.end.format(side)).id
            end, last = data.xanchor[joint].copy(), int(model.jnt_bodyid[joint])
        for name, body, line in ((upper, above, knee - start), (lower, below, end - knee)):
            flat = line - (line @ axis) * axis  # an offset along the hinge turns no limb
            self._lines[name] = body, data.xmat[body].reshape(3, 3).T @ _unit(flat)
        return start, knee, end, last

    def _trunk(self, limbs: Limbs, robot: WorldRobot) -> int:
        joint = self.model.joint(limbs.centre[0].format(robot.sides[0])).id
        return int(self.model.body_parentid[self.model.jnt_bodyid[joint]])

    def _tip(self, body: int, start: Array) -> Array:
        solid, of, _ = _solid_points(self.model, seen=True)  # a forearm need not collide to its end
        points = self._placed(solid, of)[np.isin(of, self._below(body))]
        away = np.linalg.norm(points - start, axis=1)
        tip: Array = points[away >= (1.0 - TIP) * away.max()].mean(axis=0)
        return tip

    def _below(self, body: int) -> list[int]:
        found = [body]
        for other in range(body + 1, self.model.nbody):
            if int(self.model.body_parentid[other]) in found:
                found.append(other)
        return found

    def _placed(self, points: Array, bodies: NDArray[np.int64]) -> Array:
        turned = self._data.xmat.reshape(-1, 3, 3)[bodies]
        places: Array = self._data.xpos[bodies] + np.einsum("pij,pj->pi", turned, points)
        return places

    def _local(self, body: int, point: Array) -> tuple[int, Array]:
        return body, self._data.xmat[body].reshape(3, 3).T @ (point - self._data.xpos[body])

    def _world(self, point: tuple[int, Array]) -> Array:
        body, local = point
        world: Array = self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ local
        return world


def measure(points: RobotPoints, qpos: Array, person: Human, rate: float) -> dict[str, float]:
    """A robot's frames (T, nq) beside a human's, T frames at a rate, Hz.

    Mean and worst angle in the world of "trunk", and means of the limbs, both sides alike, degrees; the trunk in frames
    in which no hip or waist is at the end of its range (`free`) or one is (`ends`; `at_end` is their share); the lowest
    hand of each, shares of the hip's height; `slide` of soles whose human foot stands, mm/s, and `own_slide` of its
    ball; `sunk`, mm; joints `beyond` their ranges. `upper_arm_can` and `forearm_can` are the means at the best angles
    within the ranges of the arms' joints, by a search of its own (`world_reach`).
    """
    off: dict[str, list[float]] = {name: [] for name in person.lines}
    hands, speeds, sunk, before = [], [], 0.0, None
    for frame, q in enumerate(qpos):
        lines, hand, places = points(q)
        for name, line in lines.items():
            cosine = float(np.clip(line @ person.lines[name][frame], -1.0, 1.0))
            off[name].append(float(np.degrees(np.arccos(cosine))))
        hands.append(hand)
        heights = points.heights(places)
        sunk = max(sunk, -float(heights.min()))
        if before is not None:
            for foot, stands in zip(points.feet, person.stands[:, frame], strict=True):
                if stands:
                    lowest = foot[np.argmin(heights[foot])]
                    speeds.append(float(np.linalg.norm((places - before)[lowest, :2])) * rate)
        before = places
    means = {name: float(np.mean([off[f"{side}_{name}"] for side in SIDES])) for name in LINES}
    worst = {f"{name}_worst": float(np.max([off[f"{side}_{name}"] for side in SIDES])) for name in LINES}
    trunk, at_end = np.array(off["trunk"]), _at_end(points, qpos)
    return {
        "trunk": float(trunk.mean()),
        "trunk_worst": float(trunk.max()),
        "free": float(trunk[~at_end].mean()) if not at_end.all() else 0.0,
        "ends": float(trunk[at_end].mean()) if at_end.any() else 0.0,
        "at_end": float(at_end.mean()),
        **means,
        **worst,
        **_can(points, qpos, person, rate),
        "hand": float(person.hands.min()),
        "robots_hand": float(np.min(hands)),
        "slide": 1000.0 * float(np.mean(speeds)) if speeds else 0.0,
        "own_slide": person.slide,
        "sunk": 1000.0 * sunk,
        "beyond": float(_beyond(points.model, qpos)),
    }


def _can(points: RobotPoints, qpos: Array, person: Human, rate: float) -> dict[str, float]:
    frames = np.arange(0, len(qpos), max(round(rate / SEARCHED), 1))
    chests, found = points.chests(qpos[frames]), []
    for side, arm in points.arms.items():
        goals = np.stack([person.lines[f"{side}_{part}"][frames] for part in ARM], axis=1)
        found.append(arm(np.matmul(goals, chests)).mean(axis=0))
    return {f"{part}_can": float(can) for part, can in zip(ARM, np.mean(found, axis=0), strict=True)}


def _hinges(model: mujoco.MjModel) -> tuple[Array, Array, Array, Array]:
    joints = np.flatnonzero((model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE) & (model.jnt_limited != 0))
    return joints, model.jnt_qposadr[joints], model.jnt_range[joints, 0], model.jnt_range[joints, 1]


def _beyond(model: mujoco.MjModel, qpos: Array) -> int:
    _, at, lower, upper = _hinges(model)
    return int(((qpos[:, at] < lower - ROUNDING) | (qpos[:, at] > upper + ROUNDING)).sum())


def _at_end(points: RobotPoints, qpos: Array) -> NDArray[np.bool_]:
    """Whether a hip's or the waist's hinge is at the end of its range, by frame."""
    model = points.model
    joints, at, lower, upper = _hinges(model)
    names = [model.joint(joint).name for joint in joints]
    trunk = [any(word in name for word in ("hip", "waist", "torso", "leg_left", "leg_right")) for name in names]
    knees = [name.startswith("leg_") and name[-7] in "456" for name in names]
    rows = np.array(trunk) & ~np.array(knees)
    q = qpos[:, at[rows]]
    ends: NDArray[np.bool_] = ((q < lower[rows] + AT_END) | (q > upper[rows] - AT_END)).any(axis=1)
    return ends


def _nearest(anchors: Array, axes: Array, toward: Array) -> Array:
    """The point nearest to some axes (n, 3); along one that alone matters, level with a point (3,)."""
    matrix, right = 1e-6 * np.eye(3), 1e-6 * toward
    for anchor, axis in zip(anchors, axes, strict=True):
        aside = np.eye(3) - np.outer(axis, axis)
        matrix, right = matrix + aside, right + aside @ anchor
    found: Array = np.linalg.solve(matrix, right)
    return found


def _solid_points(model: mujoco.MjModel, *, seen: bool = False) -> tuple[Array, NDArray[np.int64], Array]:
    """Points of the solids that collide, of all if none does, in their bodies' frames (P, 3), bodies (P,), radii, m.

    With `seen`, of all solids.
    """
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0) | seen
    collides |= not collides[model.geom_bodyid > 0].any()
    found: list[Array] = []
    bodies: list[int] = []
    radii: list[float] = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if not body or not collides[geom]:
            continue
        points, radius = _shape(model, geom)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        found.append(points @ turn.reshape(3, 3).T + model.geom_pos[geom])
        bodies += [body] * len(points)
        radii += [radius] * len(points)
    return np.concatenate(found), np.array(bodies, np.int64), np.array(radii)


def _shape(model: mujoco.MjModel, geom: int) -> tuple[Array, float]:
    """Points of a solid in its own frame, and how round it is about them, m."""
    x, y, z = model.geom_size[geom]
    kind = mujoco.mjtGeom
    corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=float)
    match int(model.geom_type[geom]):
        case kind.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first = int(model.mesh_vertadr[mesh])
            vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(float)
            try:
                return vertices[ConvexHull(vertices).vertices], 0.0
            except QhullError:
                return vertices, 0.0
        case kind.mjGEOM_BOX:
            return corners * [x, y, z], 0.0
        case kind.mjGEOM_CAPSULE:
            return np.array([[0, 0, -y], [0, 0, y]]), float(x)
        case kind.mjGEOM_CYLINDER:
            turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
            rim = np.stack([x * np.cos(turn), x * np.sin(turn)], axis=1)
            return np.concatenate([np.column_stack([rim, np.full(16, end)]) for end in (-y, y)]), 0.0
        case kind.mjGEOM_SPHERE:
            return np.zeros((1, 3)), float(x)
        case _:  # an ellipsoid
            return np.concatenate([np.eye(3), -np.eye(3)]) * [x, y, z], 0.0


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
