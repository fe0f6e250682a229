"""A robot's limbs as vectors between points of its bodies, and how they turn with its joints.

Thigh, whole leg, upper arm, forearm and whole arm are such vectors, and so are the axes of feet, head and chest. They
are seen from the pelvis, which stands upright and faces x.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.mocap.rest_pose import FOOT_SLOPE
from controller.rotations import Array, conjugate, rotate
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.kinematic_tree import Scratch, below, hinges_between
from sim.models.limb_geometry import ACROSS, centre_of, end_hinge, folds, level_with, sine
from sim.models.model_file import followers
from sim.models.surface import Surface
from sim.models.upright_pelvis import UprightPelvis
from sim.retargeting.human_limbs import AHEAD, LEFT, LIMBS

SIDES = ("r", "l")
PARTS = (
    "pelvis",
    "chest",
    "head",
    *(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")),
)
FEET = "feet"
"""The vector from the right sole to the left one, the last of all: no limb, but what keeps feet where they stand."""
PLANE = "arm_plane"
"""The vector across the plane of a bent arm, such as "r_arm_plane": about it the elbow folds."""
BALL = 0.75  # of the length of a sole from its heel on
CARRIED = 0.5  # lengths of the limb above the knee or elbow
BALL_HINGES = 3  # so many turn a limb as a ball would
STEEPEST_SOLE = 0.5  # rad: what slopes more than this at rest is no sole


@dataclass(frozen=True)
class Vectors:
    """K vectors, each from a point of one body to a point of another (or the same).

    Attributes:
        names: what each is, such as "r_leg", length K.
        rest: what each is when every joint is at zero, shape (K, 3), m.
        body: of start and end, shape (2, K).
        point: start and end in the frames of these bodies, shape (2, K, 3), m.
        length: shape (K,), m.
    """

    names: tuple[str, ...]
    body: NDArray[np.int64]
    point: Array
    rest: Array
    length: Array


@dataclass(frozen=True)
class Measured:
    """One segment of a limb: the hinge at its near end, its axis (3,) as the robot stands straight, its length, m."""

    joint: int
    axis: Array
    length: float


class RobotLimbs:
    """The limbs of one robot.

    Attributes:
        vectors: its limbs.
        hinges: the names of the hinges that move them, length N: those that are played, in the order of `joints`.
        reach: length of the legs and arms when stretched, by name ("r_leg"), m.
        surface: the robot's skin.
        segments: thighs, shanks, upper arms and forearms by name ("r_thigh").
        turns_chest: which of the N joints move the chest, shape (N,).
    """

    def __init__(
        self, path: Path, model: mujoco.MjModel, parts: Mapping[str, str], root_rotation: Array, joints: tuple[str, ...]
    ) -> None:
        """Finds the limbs.

        Args:
            path: the robot file, for errors.
            model: the robot.
            parts: part to body, as `match` gives them.
            root_rotation: of the root body while the robot stands upright and faces x, shape (4,).
            joints: the hinges that are played.

        Raises:
            UnknownNameError: if there is no such part or body.
            FileFormatError: if a limb has no joint where it needs one.
        """
        self._path, self._model = path, model
        self._data = Scratch(model)
        self._parts = {part: self._body(part, body) for part, body in parts.items()}
        for part in ("pelvis", "r_thigh", "r_shank", "l_thigh", "l_shank"):
            if part not in self._parts:
                raise FileFormatError(f"{path}: parts.{part} is missing: name the body that is its {part}")
        self._parts.setdefault("chest", self._parts["pelvis"])
        self._data.qpos[:] = model.qpos0
        self._data.qpos[:3] = 0.0
        for joint, (leader, curve) in followers(model).items():
            if leader == joint:
                self._data.qpos[model.jnt_qposadr[joint]] = curve[0]
        self._pelvis = UprightPelvis(model, self._parts["pelvis"], root_rotation)
        self._pelvis.place(self._data)
        self.surface = Surface.of(model)
        self.reach: dict[str, float] = {}
        self.segments: dict[str, Measured] = {}
        waist = set(self._joints_above(self._parts["chest"])) ^ set(self._joints_above(self._parts["pelvis"]))
        self._axes = [part for part in ("head", "chest") if part in self._parts and (part == "head" or waist)]
        self.vectors = self._find()

        index = [model.joint(name).id for name in joints]
        self._joint = np.array(index, np.int64)
        self._qpos = model.jnt_qposadr[self._joint]
        moves = np.array([np.isin(self._joint, self._joints_above(body)) for body in range(model.nbody)], dtype=float)
        # What hangs from the root beside the pelvis goes the other way, seen from it.
        moves -= moves[self._parts["pelvis"]]
        self._followers = [
            (index.index(leader), joint, curve)
            for joint, (leader, curve) in followers(model).items()
            if leader in index
        ]
        self.turns_chest = moves[self._parts["chest"]] != 0.0
        self._moves = moves[self.vectors.body][:, :, None, :]
        self._difference = self._moves[1] - self._moves[0]
        self._cross = np.zeros((3, len(index), 3))
        self._follower_moves = [
            np.array([[joint in self._joints_above(int(b)) for b in row] for row in self.vectors.body], dtype=float)
            - (joint in self._joints_above(self._parts["pelvis"]))
            for _, joint, _ in self._followers
        ]

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Which of the N joints turn or move each of the K vectors, shape (K, N)."""
        return np.any(self._moves[:, :, 0] != 0.0, axis=0)

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's state at the last `place`."""
        return self._data

    def place(self, q: Array) -> None:
        """Puts the hinges at q (N,), rad."""
        self._data.qpos[self._qpos] = q
        for leader, joint, curve in self._followers:
            self._data.qpos[self._model.jnt_qposadr[joint]] = np.polyval(curve[::-1], q[leader])
        if self._pelvis.below_a_waist:
            self._pelvis.place(self._data)
        else:
            mujoco.mj_kinematics(self._model, self._data)

    def chest_rotation(self) -> Array:
        """The rotation of the chest since the robot stood straight, shape (3, 3)."""
        return self._data.xmat[self._parts["chest"]].reshape(3, 3) @ self._chest_at_rest.T

    def positions(self) -> Array:
        """Where the vectors start and end, shape (2, K, 3), m."""
        body = self.vectors.body
        rotation = self._data.xmat[body].reshape(*body.shape, 3, 3)
        return self._data.xpos[body] + np.matmul(rotation, self.vectors.point[..., None])[..., 0]

    def feet_apart(self) -> Array:
        """The vector FEET, shape (3,), m."""
        (right, left), (start, end) = self.vectors.body[:, -1], self.vectors.point[:, -1]
        there = self._data.xpos[left] + self._data.xmat[left].reshape(3, 3) @ end
        return there - self._data.xpos[right] - self._data.xmat[right].reshape(3, 3) @ start

    def stand_on(self, rolled: Sequence[float]) -> None:
        """From now on the vector FEET goes from and to this part of each sole: 0 is the heel, 1 the ball."""
        for foot, share in enumerate(rolled):
            heel, ball = self.sole_ends[foot]
            self.vectors.point[foot, -1] = (1.0 - share) * heel + share * ball

    def jacobian(self, positions: Array) -> Array:
        """How the vectors turn with the joints, shape (K, 3, N), m/rad."""
        axis, anchor = self._data.xaxis[self._joint], self._data.xanchor[self._joint]
        start, end = positions
        # a x p = S_a p for each axis a. A joint moves each end of a vector that hangs below it by a x (end - anchor).
        cross, count = self._cross, len(axis)
        cross[1, :, 0], cross[2, :, 0] = axis[:, 2], -axis[:, 1]
        cross[0, :, 1], cross[2, :, 1] = -axis[:, 2], axis[:, 0]
        cross[0, :, 2], cross[1, :, 2] = axis[:, 1], -axis[:, 0]
        swept = (positions.reshape(-1, 3) @ cross.reshape(-1, 3).T).reshape(2, len(end), 3, count)
        turn = self._moves[1] * swept[1]
        turn -= self._moves[0] * swept[0]
        turn -= self._difference * np.einsum("cnk,nk->cn", cross, anchor)
        for (leader, joint, curve), moves in zip(self._followers, self._follower_moves, strict=True):
            q = self._data.qpos[self._qpos[leader]]
            slope = np.polyval(np.polyder(curve[::-1]), q)
            own = self._data.xaxis[joint], self._data.xanchor[joint]
            lever = moves[1][:, None] * (end - own[1]) - moves[0][:, None] * (start - own[1])
            turn[:, :, leader] += slope * np.cross(own[0], lever)
        return turn

    def _find(self) -> Vectors:
        names: list[str] = []
        ends: list[tuple[int, int]] = []
        points: list[tuple[Array, Array]] = []

        def add(name: str, start: tuple[int, Array], end: tuple[int, Array]) -> None:
            names.append(name)
            ends.append((start[0], end[0]))
            points.append((self._local(*start), self._local(*end)))

        leg = 0.0
        for side in SIDES:
            leg = max(leg, self._limb(add, side, "thigh", "shank", "foot", "leg"))
            if f"{side}_upper_arm" in self._parts and f"{side}_forearm" in self._parts:
                self._limb(add, side, "upper_arm", "forearm", "hand", "arm")
        # An axis counts as much as a limb as long as its vector.
        size = 0.3 * leg
        for side in SIDES:
            if f"{side}_foot" in self._parts:
                foot = self._parts[f"{side}_foot"]
                for name, axis in zip(("ahead", "up"), self._sole(side), strict=True):
                    at = self._data.xpos[foot]
                    add(f"{side}_foot_{name}", (foot, at), (foot, at + size * axis))
        for part in self._axes:
            body = self._parts[part]
            for name, axis in (("ahead", AHEAD), ("left", LEFT)):
                at = self._data.xpos[body]
                add(f"{part}_{name}", (body, at), (body, at + size * axis))
        if all(f"{side}_foot" in self._parts for side in SIDES):
            soles = [self._sole_ends(side) for side in SIDES]
            feet = [self._parts[f"{side}_foot"] for side in SIDES]
            self.sole_ends = np.array([[self._local(b, p) for p in pair] for b, pair in zip(feet, soles, strict=True)])
            add(FEET, *((foot, pair.mean(axis=0)) for foot, pair in zip(feet, soles, strict=True)))
        self._chest_at_rest = self._data.xmat[self._parts["chest"]].reshape(3, 3).copy()
        body, point = np.array(ends, np.int64).T.copy(), np.array(points).transpose(1, 0, 2).copy()
        world = self._data.xpos[body] + rotate(self._data.xquat[body], point)
        rest = world[1] - world[0]
        return Vectors(tuple(names), body, point, rest, np.linalg.norm(rest, axis=1))

    def _limb(self, add, side: str, first: str, second: str, third: str, whole: str) -> float:
        """Adds a limb's upper part, the limb as a whole and an arm's lower part; returns its length when stretched."""
        base = self._parts["chest" if whole == "arm" else "pelvis"]
        lower, end = self._parts[f"{side}_{second}"], self._parts.get(f"{side}_{third}")
        knee_joint = self._knee(self._parts[f"{side}_{first}"], lower)
        # Between the hip and the knee it is one segment: the body above the knee, with what turns it along itself.
        upper = int(self._model.body_parentid[self._model.jnt_bodyid[knee_joint]])
        hips = [joint for joint in hinges_between(self._model, base, upper) if joint != knee_joint]
        if not hips:
            raise self._no_hinge(upper)
        axis, knee = self._data.xaxis[knee_joint], self._data.xanchor[knee_joint].copy()
        start = level_with(centre_of(self._data, hips, knee), knee, axis)
        tip_body, tip = lower, self._tip(lower, knee) if end is None else knee
        if end is not None:
            moved = self._ankle(lower, end, knee, float(np.linalg.norm(knee - start)))
            tip_body = int(self._model.body_parentid[self._model.jnt_bodyid[moved]])
            tip = self._data.xanchor[moved].copy()
        tip = level_with(tip, knee, axis)
        add(f"{side}_{first}", (upper, start), (upper, knee))
        add(f"{side}_{whole}", (upper, start), (tip_body, tip))
        bent = int(self._model.jnt_bodyid[knee_joint])
        if whole == "arm":
            add(f"{side}_{second}", (bent, knee), (tip_body, tip))
        # What a joint far from it carries along (a clavicle's), the beginning of the limb, is to stay where it is, but
        # only where the others are enough to point the limb anywhere.
        far = CARRIED * float(np.linalg.norm(knee - start))
        carry = [joint for joint in hips if self._lever(joint, start) > far]
        if carry and len(hips) - len(carry) >= BALL_HINGES:
            add(f"{side}_{first}_start", (base, self._data.xpos[base]), (upper, start))
        fold = folds(self._model, knee_joint, axis, knee - start, tip - knee)
        if whole == "arm" and fold and len(hips) >= BALL_HINGES:
            add(f"{side}_{PLANE}", (bent, knee), (bent, knee + fold * float(np.linalg.norm(knee - start)) * axis))
        lengths = float(np.linalg.norm(knee - start)), float(np.linalg.norm(tip - knee))
        for part, joint, length in zip((first, second), (hips[-1], knee_joint), lengths, strict=True):
            self.segments[f"{side}_{part}"] = Measured(joint, self._data.xaxis[joint].copy(), length)
        self.reach[f"{side}_{whole}"] = sum(lengths)
        return sum(lengths)

    def _lever(self, joint: int, point: Array) -> float:
        """How far a point (3,) is from a joint's axis, m."""
        return float(np.linalg.norm(np.cross(self._data.xaxis[joint], point - self._data.xanchor[joint])))

    def _knee(self, upper: int, lower: int) -> int:
        """The last hinge across the limb on the way from its upper segment to the body that its knee moves."""
        way = hinges_between(self._model, upper, lower)
        if not way:
            raise self._no_hinge(lower)
        start, tip = self._data.xpos[upper], self._tip(lower, self._data.xanchor[way[-1]])
        for joint in reversed(way):
            at, axis = self._data.xanchor[joint], self._data.xaxis[joint]
            if sine(axis, at - start) >= ACROSS and sine(axis, tip - at) >= ACROSS:
                return joint
        return way[0]

    def _ankle(self, lower: int, end: int, knee: Array, upper: float) -> int:
        """The first hinge across the limb on the way from its lower segment to its end."""
        way = hinges_between(self._model, lower, end)
        if not way:
            raise self._no_hinge(end)
        found = end_hinge(self._data, way, knee, upper)
        return way[0] if found is None else found

    def _no_hinge(self, body: int) -> FileFormatError:
        name = self._model.body(body).name
        return FileFormatError(f"{self._path}: parts: there is no hinge joint at body '{name}'; name the body it moves")

    def _tip(self, body: int, start: Array) -> Array:
        """The end of a limb without a hand: the point of its surface, or else the body, farthest from its joint."""
        mine = below(self._model, body)
        points = self.surface.part(np.array(mine)).positions(self._data)
        if not len(points):
            points = self._data.xpos[mine[1:]]
        if not len(points):
            raise FileFormatError(
                f"{self._path}: parts: body '{self._model.body(body).name}' has no solids that tell where it ends; "
                "give it one in the model (in a URDF a <collision> shape)"
            )
        direction = points.mean(axis=0) - start
        direction /= max(float(np.linalg.norm(direction)), 1e-9)
        return start + float(((points - start) @ direction).max()) * direction

    def _sole(self, side: str) -> tuple[Array, Array]:
        """Which way a foot points, level when it stands flat, and which way is up for it, at rest."""
        shank, foot = self._parts[f"{side}_shank"], self._parts[f"{side}_foot"]
        knee = self._data.xanchor[self._knee(self._parts[f"{side}_thigh"], shank)]
        ankle = self._data.xanchor[self._ankle(shank, foot, knee, 0.0)]
        up = knee - ankle
        up /= max(float(np.linalg.norm(up)), 1e-9)
        ahead = AHEAD - (AHEAD @ up) * up
        ahead /= np.linalg.norm(ahead)
        left = np.cross(up, ahead)
        mine = self.surface.part(np.array(below(self._model, foot)))
        points = mine.positions(self._data) - ankle
        if len(points):
            along, height = points @ ahead, points @ up - mine.radius
            front = along > 0.5 * (along.min() + along.max())
            if front.any() and (~front).any():
                toe, heel = np.argmin(np.where(front, height, np.inf)), np.argmin(np.where(front, np.inf, height))
                slope = float(np.arctan2(height[toe] - height[heel], along[toe] - along[heel]))
                if abs(slope) < STEEPEST_SOLE:
                    ahead = np.cos(slope) * ahead + np.sin(slope) * up
        return ahead, np.cross(ahead, left)

    def _sole_ends(self, side: str) -> Array:
        """Where heel and ball of a foot touch the floor at rest, shape (2, 3), m."""
        foot = self._parts[f"{side}_foot"]
        mine = self.surface.part(np.array(below(self._model, foot)))
        points = mine.positions(self._data)
        if not len(points):
            return np.tile(self._data.xpos[foot], (2, 1))
        ahead, up = self._sole(side)
        left = np.cross(up, ahead)
        along, height = points @ ahead, (points @ up - mine.radius).min()
        back, front = along.min(), along.max()
        middle = 0.5 * ((points @ left).min() + (points @ left).max())
        return np.array(
            [(back + share * (front - back)) * ahead + middle * left + height * up for share in (0.0, BALL)]
        )

    def _local(self, body: int, point: Array) -> Array:
        return rotate(conjugate(self._data.xquat[body]), point - self._data.xpos[body])

    def _joints_above(self, body: int) -> list[int]:
        """The joints between the root and a body, those of the body included."""
        found: list[int] = []
        while body:
            found += [int(j) for j in np.flatnonzero(self._model.jnt_bodyid == body)]
            body = int(self._model.body_parentid[body])
        return found

    def _body(self, part: str, body: str) -> int:
        if part not in PARTS:
            raise UnknownNameError(f"{self._path}: parts: {UnknownNameError.among('part', part, PARTS)}")
        names = [self._model.body(index).name for index in range(1, self._model.nbody)]
        if body not in names:
            raise UnknownNameError(f"{self._path}: parts.{part}: {UnknownNameError.among('body', body, names)}")
        return names.index(body) + 1


def limb_directions(limbs: RobotLimbs) -> Array:
    """Where a robot's limbs point, as LimbView says it of a human's, shape (14, 3); zero for those it does not have."""
    start, end = limbs.positions()
    vector = dict(zip(limbs.vectors.names, end - start, strict=True))
    chest = limbs.chest_rotation()
    found: dict[str, Array] = {}
    for side in SIDES:
        for whole, first, second in (("leg", "thigh", "shank"), ("arm", "upper_arm", "forearm")):
            if f"{side}_{whole}" in vector:
                frame = chest if whole == "arm" else np.eye(3)
                found[f"{side}_{first}"] = vector[f"{side}_{first}"] @ frame
                found[f"{side}_{second}"] = (vector[f"{side}_{whole}"] - vector[f"{side}_{first}"]) @ frame
        if f"{side}_foot_ahead" in vector:
            ahead, above = vector[f"{side}_foot_ahead"], vector[f"{side}_foot_up"]
            found[f"{side}_foot"] = np.cos(FOOT_SLOPE) * ahead - np.sin(FOOT_SLOPE) * above
    for axis in ("head_ahead", "head_left"):
        if axis in vector:
            found[axis] = vector[axis] @ chest
    found |= {"chest_ahead": chest[:, 0], "chest_left": chest[:, 1]}
    directions = np.array([found.get(name, np.zeros(3)) for name in LIMBS])
    return directions / np.maximum(np.linalg.norm(directions, axis=1), 1e-9)[:, None]
