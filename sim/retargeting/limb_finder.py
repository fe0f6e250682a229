"""A robot's parts as its file names them, and its limbs as vectors between points of its bodies."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from controller.motion.rotations import Array, Indices, conjugate, rotate
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.kinematic_tree import below, hinges_between, joints_above
from sim.models.limb_geometry import ACROSS, centre_of, end_hinge, folds, level_with, sine
from sim.models.surface import Surface
from sim.retargeting.human_limbs import AHEAD, LEFT

SIDES = ("r", "l")
OF_A_SIDE = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")
PARTS = ("pelvis", "chest", "head", *(f"{side}_{part}" for side in SIDES for part in OF_A_SIDE))


def bodies_of_parts(path: Path, model: mujoco.MjModel, parts: Mapping[str, str]) -> dict[str, int]:
    """The body of each part of a robot file (`path`, for errors); without a waist the chest is the pelvis.

    UnknownNameError if there is no such part or body. FileFormatError if a necessary part is missing: a leg's, or, of a
    robot without legs, an arm's.
    """
    names = [model.body(index).name for index in range(1, model.nbody)]
    found: dict[str, int] = {}
    for part, body in parts.items():
        UnknownNameError.check("part", part, PARTS, f"{path}: parts: ")
        UnknownNameError.check("body", body, names, f"{path}: parts.{part}: ")
        found[part] = names.index(body) + 1
    limb = ("thigh", "shank") if not without_legs(found) else ("upper_arm", "forearm")
    for part in ("pelvis", *(f"{side}_{segment}" for side in SIDES for segment in limb)):
        if part not in found:
            raise FileFormatError(f"{path}: parts.{part} is missing: name the body that is its {part}")
    found.setdefault("chest", found["pelvis"])
    return found


def without_legs(parts: Collection[str]) -> bool:
    """Whether parts are those of an upper body: arms, and nothing of a leg."""
    legs = (f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot"))
    return any(part.endswith("upper_arm") for part in parts) and not any(leg in parts for leg in legs)


FEET = "feet"  # the last vector, from the right sole to the left one: keeps standing feet in place
TRUNK = "trunk"  # from the middle of the hips to that of the shoulders
HAND = "arm_hand"  # from the wrist to the middle of the hand
PLANE = "arm_plane"  # the normal of a bent arm's plane, such as "r_arm_plane": the elbow folds about it
BALL = 0.75  # of the length of a sole, from its heel
CARRIED = 0.5  # lengths of the limb above the knee or elbow
WRIST, SHORT = 0.4, 0.1  # of a forearm: how far from its end a wrist's hinges are; a shorter hand points nowhere
BALL_HINGES = 3  # turn a limb like a ball joint
STEEPEST_SOLE = 0.5  # largest slope of a sole at rest, rad


@dataclass(frozen=True)
class Vectors:
    """K vectors, each from a point of one body to a point of another (or the same)."""

    names: tuple[str, ...]  # such as "r_leg", length K
    # Bodies of start and end, shape (2, K), and their points in these frames, shape (2, K, 3), m.
    body: Indices
    point: Array
    rest: Array  # the vectors with all joints at zero, shape (K, 3), m
    length: Array  # shape (K,), m


@dataclass(frozen=True)
class Measured:
    """One segment of a limb: the hinge at its near end, its axis (3,) as the robot stands straight, its length, m."""

    joint: int
    axis: Array
    length: float


class LimbFinder:
    """Finds the limbs of a robot that stands straight, its pelvis facing x."""

    def __init__(
        self, path: Path, model: mujoco.MjModel, data: mujoco.MjData, parts: Mapping[str, int], surface: Surface
    ) -> None:
        self._path, self._model, self._data, self._parts, self._surface = path, model, data, parts, surface
        self.reach: dict[str, float] = {}  # length of the stretched legs and arms, by name ("r_leg"), m
        self.segments: dict[str, Measured] = {}  # thighs, shanks, upper arms and forearms by name ("r_thigh")
        # Heel and ball of each foot in its own frame, shape (2, 2, 3), m; empty without two feet.
        self.sole_ends = np.empty((0, 2, 3))
        self._starts: dict[str, Array] = {}  # of limbs by name ("r_leg"), m
        self._vectors: list[tuple[str, tuple[int, int], tuple[Array, Array]]] = []  # name, bodies and local points

    def find(self) -> Vectors:
        """All vectors; FileFormatError if a limb lacks a necessary joint, or its end is unknown."""
        for side in SIDES:
            if f"{side}_thigh" in self._parts:
                self._limb(side, "thigh", "shank", "foot", "leg")
            if f"{side}_upper_arm" in self._parts and f"{side}_forearm" in self._parts:
                self._limb(side, "upper_arm", "forearm", "hand", "arm")
        size = 0.3 * max(self.reach.get(f"{side}_leg", self.reach.get(f"{side}_arm", 0.0)) for side in SIDES)
        for side in SIDES:
            if f"{side}_foot" in self._parts:
                foot = self._parts[f"{side}_foot"]
                for name, axis in zip(("ahead", "up"), self._sole(side), strict=True):
                    self._add_axis(f"{side}_foot_{name}", foot, size * axis)
        above = (set(joints_above(self._model, self._parts[part])) for part in ("chest", "pelvis"))
        waist = set.symmetric_difference(*above)
        for part in [part for part in ("head", "chest") if part in self._parts and (part == "head" or waist)]:
            for name, axis in (("ahead", AHEAD), ("left", LEFT)):
                self._add_axis(f"{part}_{name}", self._parts[part], size * axis)
        if len(self._starts) == 2 * len(SIDES):
            ends = (
                (self._parts[part], 0.5 * (self._starts[f"r_{limb}"] + self._starts[f"l_{limb}"]))
                for part, limb in (("pelvis", "leg"), ("chest", "arm"))
            )
            self._add(TRUNK, *ends)
        if all(f"{side}_foot" in self._parts for side in SIDES):
            soles = [self._sole_ends(side) for side in SIDES]
            feet = [self._parts[f"{side}_foot"] for side in SIDES]
            self.sole_ends = np.array([[self._local(b, p) for p in pair] for b, pair in zip(feet, soles, strict=True)])
            self._add(FEET, *((foot, pair.mean(axis=0)) for foot, pair in zip(feet, soles, strict=True)))
        names, ends, points = zip(*self._vectors, strict=True)
        body, point = np.array(ends, np.int64).T.copy(), np.array(points).transpose(1, 0, 2).copy()
        world = self._data.xpos[body] + rotate(self._data.xquat[body], point)
        rest = world[1] - world[0]
        return Vectors(names, body, point, rest, np.linalg.norm(rest, axis=1))

    def _add(self, name: str, start: tuple[int, Array], end: tuple[int, Array]) -> None:
        self._vectors.append((name, (start[0], end[0]), (self._local(*start), self._local(*end))))

    def _add_axis(self, name: str, body: int, axis: Array) -> None:
        at = self._data.xpos[body]
        self._add(name, (body, at), (body, at + axis))

    def _limb(self, side: str, first: str, second: str, third: str, whole: str) -> None:
        """Adds a limb's upper part, the whole limb and an arm's lower part, and its stretched length."""
        base = self._parts["chest" if whole == "arm" else "pelvis"]
        lower, end = self._parts[f"{side}_{second}"], self._parts.get(f"{side}_{third}")
        knee_joint = self._knee(self._parts[f"{side}_{first}"], lower)
        # The upper segment is the body above the knee, below the hinges that twist it.
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
        tip, self._starts[f"{side}_{whole}"] = level_with(tip, knee, axis), start
        self._add(f"{side}_{first}", (upper, start), (upper, knee))
        self._add(f"{side}_{whole}", (upper, start), (tip_body, tip))
        bent = int(self._model.jnt_bodyid[knee_joint])
        if whole == "arm":
            self._add(f"{side}_{second}", (bent, knee), (tip_body, tip))
            if end is not None:
                self._hand(side, end, tip, float(np.linalg.norm(tip - knee)))
        # A distant joint (a clavicle's) shall not carry the limb's start along, if the other joints point it anywhere.
        far = CARRIED * float(np.linalg.norm(knee - start))
        levers = np.cross(self._data.xaxis[hips], start - self._data.xanchor[hips])
        carry = [joint for joint, lever in zip(hips, levers, strict=True) if np.linalg.norm(lever) > far]
        if carry and len(hips) - len(carry) >= BALL_HINGES:
            self._add(f"{side}_{first}_start", (base, self._data.xpos[base]), (upper, start))
        fold = folds(self._model, knee_joint, axis, knee - start, tip - knee)
        if whole == "arm" and fold and len(hips) >= BALL_HINGES:
            self._add(f"{side}_{PLANE}", (bent, knee), (bent, knee + fold * float(np.linalg.norm(knee - start)) * axis))
        lengths = float(np.linalg.norm(knee - start)), float(np.linalg.norm(tip - knee))
        for part, joint, length in zip((first, second), (hips[-1], knee_joint), lengths, strict=True):
            self.segments[f"{side}_{part}"] = Measured(joint, self._data.xaxis[joint].copy(), length)
        self.reach[f"{side}_{whole}"] = sum(lengths)

    def _knee(self, upper: int, lower: int) -> int:
        """The last hinge across the limb from its upper segment to its knee's body; of several the widest range."""
        way = hinges_between(self._model, upper, lower)
        if not way:
            raise self._no_hinge(lower)
        start, tip = self._data.xpos[upper], self._tip(lower, self._data.xanchor[way[-1]])
        at, axis, back = self._data.xanchor, self._data.xaxis, reversed(way)
        across = [j for j in back if min(sine(axis[j], at[j] - start), sine(axis[j], tip - at[j])) >= ACROSS]
        body, ranges = self._model.jnt_bodyid, np.ptp(self._model.jnt_range, axis=1)
        ranges = np.where(self._model.jnt_limited, ranges, np.inf)
        return max((j for j in across if body[j] == body[across[0]]), key=lambda j: ranges[j], default=way[0])

    def _ankle(self, lower: int, end: int, knee: Array, upper: float) -> int:
        """The first hinge across the limb from its lower segment to its end."""
        way = hinges_between(self._model, lower, end)
        if not way:
            raise self._no_hinge(end)
        found = end_hinge(self._data, way, knee, upper)
        return way[0] if found is None else found

    def _hand(self, side: str, hand: int, wrist: Array, forearm: float) -> None:
        """Adds a hand beyond the last hinge of its wrist, if solids tell where it is, for a forearm of a length."""
        model, data, palm = self._model, self._data, hand
        while len(lower := np.flatnonzero((model.body_parentid == palm) & (model.body_jntnum > 0))) == 1:
            if np.linalg.norm(data.xanchor[model.body_jntadr[lower[0]]] - wrist) > WRIST * forearm:
                break
            palm = int(lower[0])
        points = self._surface.part(np.array(below(model, palm))).positions(data)
        if len(points) and np.linalg.norm(points.mean(axis=0) - wrist) > SHORT * forearm:
            self._add(f"{side}_{HAND}", (hand, wrist), (palm, points.mean(axis=0)))

    def _no_hinge(self, body: int) -> FileFormatError:
        name = self._model.body(body).name
        return FileFormatError(f"{self._path}: parts: there is no hinge joint at body '{name}'; name the body it moves")

    def _tip(self, body: int, start: Array) -> Array:
        """The end of a limb without a hand: the point of its surface, or body, farthest from its joint."""
        mine = below(self._model, body)
        points = self._surface.part(np.array(mine)).positions(self._data)
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
        """Axes of a flat foot at rest, ahead and up."""
        shank, foot = self._parts[f"{side}_shank"], self._parts[f"{side}_foot"]
        knee = self._data.xanchor[self._knee(self._parts[f"{side}_thigh"], shank)]
        ankle = self._data.xanchor[self._ankle(shank, foot, knee, 0.0)]
        up = knee - ankle
        up /= max(float(np.linalg.norm(up)), 1e-9)
        ahead = AHEAD - (AHEAD @ up) * up
        ahead /= np.linalg.norm(ahead)
        left = np.cross(up, ahead)
        mine = self._surface.part(np.array(below(self._model, foot)))
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
        """Heel and ball of a foot on the floor at rest, shape (2, 3), m."""
        foot = self._parts[f"{side}_foot"]
        mine = self._surface.part(np.array(below(self._model, foot)))
        points = mine.positions(self._data)
        if not len(points):
            return np.tile(self._data.xpos[foot], (2, 1))
        ahead, up = self._sole(side)
        left = np.cross(up, ahead)
        along, height = points @ ahead, (points @ up - mine.radius).min()
        back, front = along.min(), along.max()
        middle = 0.5 * ((points @ left).min() + (points @ left).max())
        ends = back, back + BALL * (front - back)
        return np.array([at * ahead + middle * left + height * up for at in ends])

    def _local(self, body: int, point: Array) -> Array:
        return rotate(conjugate(self._data.xquat[body]), point - self._data.xpos[body])
