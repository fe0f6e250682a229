"""Limb directions: angles between a robot's limbs and trunk and the human's, in the world.

The landmarks are found independently of the matcher and of the points of inverse kinematics, because this checks them:
the knee (elbow) is the hinge that, turned through its range, changes the distance from the limb's beginning to its end
most. Of the robot file only one body of each limb, the pelvis and the chest are used; and between hinges that fold it
about as much, the body below the knee.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.kinematic_tree import below, hinges_at, hinges_between, path_to
from sim.models.limb_geometry import centre_of, end_hinge, level_with, start_of
from sim.models.surface import Surface
from sim.retargeting.human_limbs import LIMBS, UP

SEGMENTS = {"leg": ("thigh", "shank"), "arm": ("upper_arm", "forearm")}
MEAN_LIMIT, WORST_LIMIT = 15.0, 45.0  # largest angle of a limb on average over a recording, and in one frame, degrees
TURN, STEPS = 2.6, 11  # largest turn of a hinge either way, rad, and the number of steps through it
TIP = 0.1  # of a limb without an end hinge, as a share of its length
FOLDS_ALIKE = 0.6  # least fold of a limb, in that by the hinge that folds it most, by which it may be the knee
CLAVICLE = 0.03  # largest distance of its joint from the middle of the body, in heights of the robot


@dataclass(frozen=True)
class LimbSegment:
    """One rigid part of a limb."""

    name: str  # such as "r_thigh"
    joint: str  # the name of the limb's knee (elbow)
    axis: Array  # of that hinge, standing straight and facing x, shape (3,)
    body: int  # of the segment
    direction: Array  # unit vector from its beginning to its end in the frame of that body, shape (3,)
    length: float  # m
    trunk: int  # the body from which it is seen


class LimbDirections:
    """Directions of one robot's limbs; `standing` is the robot with joints at zero, facing x."""

    def __init__(self, model: mujoco.MjModel, parts: Mapping[str, str], root_rotation: Array) -> None:
        """Finds the landmarks; `root_rotation` is that of the root body that stands upright and faces x, shape (4,)."""
        self.model, self._data, self.standing = model, mujoco.MjData(model), mujoco.MjData(model)
        self._surface = Surface.of(model)
        self.standing.qpos[3:7] = root_rotation
        mujoco.mj_kinematics(model, self.standing)
        pelvis = model.body(parts["pelvis"]).id
        chest = model.body(parts["chest"]).id if "chest" in parts else pelvis
        trunks = {"leg": pelvis, "arm": chest}
        self._starts: dict[str, list[Array]] = {"arm": [], "leg": []}  # of limbs, standing, m
        self.limbs: list[list[LimbSegment]] = []
        # By limb ("r_arm") the bodies of its beginning and its end with these points in their frames.
        self._ends: dict[str, tuple[tuple[int, Array], tuple[int, Array]]] = {}
        for side in "rl":
            for limb, names in SEGMENTS.items():
                bodies = [model.body(parts[part]).id for name in names if (part := f"{side}_{name}") in parts]
                found = self._found(side, limb, bodies, trunks[limb]) if bodies else []
                self.limbs += [found] if found else []
        self.segments = [segment for limb in self.limbs for segment in limb]  # length K
        # The ends of the trunk's line, each in the frame of its body; without both arms it is the vertical.
        hips = np.mean(self._starts["leg"] or [self.standing.xpos[pelvis]], axis=0)
        shoulders = self._starts["arm"] if len(self._starts["arm"]) == 2 else [hips + UP]
        self._line = self._local(chest, np.mean(shoulders, axis=0)), self._local(pelvis, hips)

    def __call__(self, qpos: Array) -> Array:
        """The directions of the K segments seen from the trunk, shape (K, 3), for a robot at qpos (nq,)."""
        now, stood = self._turned(qpos), self.standing.xmat.reshape(-1, 3, 3)
        there = [stood[s.trunk] @ now[s.trunk].T @ now[s.body] @ s.direction for s in self.segments]
        return np.array(there).reshape(-1, 3)

    def reaches(self, qpos: Array) -> dict[str, Array]:
        """The way from beginning to end of each limb ("r_arm") in the world, shape (T, 3), m, for qpos (T, nq)."""
        # It does not depend on the knee or elbow.
        found = {name: np.empty((len(qpos), 3)) for name in self._ends}
        for frame, q in enumerate(qpos):
            turned = self._turned(q)
            for name, ends in self._ends.items():
                start, end = (self._data.xpos[body] + turned[body] @ point for body, point in ends)
                found[name][frame] = end - start
        return found

    def degrees(self, qpos: Array, limbs: Array) -> Array:
        """Angles to a human's limbs (T, 18, 3) for qpos (T, nq) by frame and segment, shape (T, K), degrees."""
        return degrees_between(np.array([self(q) for q in qpos]), self.goals(limbs, qpos))

    def trunk_errors(self, qpos: Array, limbs: Array) -> Array:
        """Angle of the line from hips to shoulders to the human's, shape (T,), degrees, for qpos (T, nq)."""
        ahead, left = (limbs[:, LIMBS.index(f"chest_{axis}")] for axis in ("ahead", "left"))
        lines = np.empty((len(qpos), 3))
        for frame, q in enumerate(qpos):
            turned = self._turned(q)
            upper, lower = (self._data.xpos[body] + turned[body] @ point for body, point in self._line)
            lines[frame] = (upper - lower) / np.linalg.norm(upper - lower)
        return degrees_between(lines, np.cross(ahead, left))

    def goals(self, limbs: Array, qpos: Array) -> Array:
        """A human's limbs (T, 18, 3), in the world, seen from the trunk of a robot at qpos (T, nq): shape (T, K, 3)."""
        rows = [LIMBS.index(segment.name) for segment in self.segments]
        trunks = [segment.trunk for segment in self.segments]
        stood, found = self.standing.xmat.reshape(-1, 3, 3)[trunks], np.empty((len(qpos), len(rows), 3))
        for frame, q in enumerate(qpos):
            seen = np.matmul(stood, self._turned(q)[trunks].transpose(0, 2, 1))
            found[frame] = np.matmul(seen, limbs[frame, rows, :, None])[..., 0]
        return found

    def _turned(self, qpos: Array) -> Array:
        """Places the bodies for qpos (nq,); their rotations, shape (N, 3, 3)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self._data)
        return self._data.xmat.reshape(-1, 3, 3)

    def _found(self, side: str, limb: str, parts: list[int], trunk: int) -> list[LimbSegment]:
        model, data, body = self.model, self.standing, parts[0]
        ends = [b for b in below(model, body) if hinges_at(model, b)] or [body]
        end = max(ends, key=lambda b: len(hinges_between(model, trunk, b)))
        if limb == "arm":
            end = self._palm(body, end)
        hinges = hinges_between(model, trunk, end)
        tall = float(np.ptp(self._surface.positions(data)[:, 2]))
        beside = [abs(data.xanchor[j, 1] - data.xpos[trunk, 1]) >= CLAVICLE * tall for j in hinges]
        hinges = hinges[beside.index(True) :] if any(beside) else hinges
        if len(hinges) < 2:
            return []
        tip = self._tip(end, data.xanchor[hinges[0]])
        first = int(model.body_parentid[model.jnt_bodyid[hinges[0]]])
        self._ends[f"{side}_{limb}"] = self._local(first, start_of(data, hinges, tip)), self._local(end, tip)
        fold = [self._fold(joint, hinges[:k], end, tip) for k, joint in enumerate(hinges) if k]
        # The robot file decides between hinges that fold the limb about as much.
        alike = [1 + k for k, change in enumerate(fold) if change >= FOLDS_ALIKE * max(fold)]
        middle = next((k for k in alike if model.jnt_bodyid[hinges[k]] in parts[1:]), 1 + int(np.argmax(fold)))
        joint = hinges[middle]
        knee, axis = data.xanchor[joint].copy(), data.xaxis[joint].copy()
        start = level_with(centre_of(data, hinges[:middle], knee), knee, axis)
        self._starts[limb].append(start)
        ankle = end_hinge(data, hinges[middle + 1 :], knee, float(np.linalg.norm(knee - start)))
        far = level_with(tip if ankle is None else data.xanchor[ankle], knee, axis)
        upper, lower = int(model.body_parentid[model.jnt_bodyid[joint]]), int(model.jnt_bodyid[joint])
        name = model.joint(joint).name
        found = []
        for part, on, way in zip(SEGMENTS[limb], (upper, lower), (knee - start, far - knee), strict=True):
            length = float(np.linalg.norm(way))
            if length > 1e-6:
                direction = data.xmat[on].reshape(3, 3).T @ way / length
                found.append(LimbSegment(f"{side}_{part}", name, axis, on, direction, length, trunk))
        return found

    def _local(self, body: int, point: Array) -> tuple[int, Array]:
        return body, self.standing.xmat[body].reshape(3, 3).T @ (point - self.standing.xpos[body])

    def _palm(self, upper: int, end: int) -> int:
        """The last body of an arm that a hinge moves, from its upper segment to where fingers part, or else its end."""
        path, palm = path_to(self.model, end), upper
        for body in path[path.index(upper) + 1 :]:
            palm = body if hinges_at(self.model, body) else palm
            children = np.flatnonzero(self.model.body_parentid == body).tolist()
            fingers = [one for one in children if any(hinges_at(self.model, b) for b in below(self.model, one))]
            if len(fingers) > 1:
                return palm
        return end

    def _fold(self, joint: int, above: list[int], end: int, tip: Array) -> float:
        """Change of the distance from a limb's beginning, by the hinges above, to its tip by a hinge, m."""
        model, data = self.model, mujoco.MjData(self.model)
        lower, upper = np.clip(model.jnt_range[joint], -TURN, TURN) if model.jnt_limited[joint] else (-TURN, TURN)
        # Half of a hand or foot counts, so that one that is long does not pass for a shank.
        middle = 0.5 * (tip + self.standing.xanchor[hinges_at(model, end)[-1]])
        _, local = self._local(end, middle)
        start, reach = start_of(self.standing, above, self.standing.xanchor[joint]), []
        for q in np.linspace(lower, upper, STEPS):
            data.qpos[:] = self.standing.qpos
            data.qpos[model.jnt_qposadr[joint]] = q
            mujoco.mj_kinematics(model, data)
            at = data.xpos[end] + data.xmat[end].reshape(3, 3) @ local
            reach.append(float(np.linalg.norm(at - start)))
        return float(np.ptp(reach))

    def _tip(self, end: int, start: Array) -> Array:
        """The middle of the farthest points: a single corner of a hand would turn the forearm."""
        points = self._surface.part(np.array(below(self.model, end))).positions(self.standing)
        if not len(points):
            return self.standing.xpos[end].copy()
        away = np.linalg.norm(points - start, axis=1)
        middle: Array = points[away > (1.0 - TIP) * away.max()].mean(axis=0)
        return middle


def degrees_between(a: Array, b: Array) -> Array:
    """The angles between unit vectors (..., 3), shape (...), degrees."""
    angles: Array = np.degrees(np.arccos(np.clip(np.einsum("...i,...i->...", a, b), -1.0, 1.0)))
    return angles


def beyond_limits(errors: Mapping[str, tuple[float, float]]) -> list[str]:
    """The segments beyond the limits: "l_forearm 17 degrees on average, 52 at worst"."""
    return [
        f"{name} {mean:.0f} degrees on average, {worst:.0f} at worst"
        for name, (mean, worst) in errors.items()
        if mean > MEAN_LIMIT or worst > WORST_LIMIT
    ]
