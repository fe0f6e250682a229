"""The tree of a robot's bodies, its hinges and joints that follow others, and its pelvis, perhaps below a waist."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import mujoco
import numpy as np

from controller.motion.canonical.clip_edits import twin_of
from controller.motion.rotations import IDENTITY, Array, Indices, conjugate, multiply
from motiondeck_base.errors import FileFormatError


@dataclass(frozen=True)
class LedJoints:
    """F joints that follow others."""

    follower: Indices  # joints, shape (F,)
    leader: Indices  # the joint that each follows
    curve: Array  # the coefficients of the followers' positions as polynomials of their leaders', shape (F, 5)

    @classmethod
    def of(cls, led: Mapping[int, tuple[int, Array]]) -> Self:
        """The followers of a mapping to their leaders and polynomials."""
        leaders = np.array([leader for leader, _ in led.values()], np.int64)
        return cls(np.array([*led], np.int64), leaders, np.array([curve for _, curve in led.values()]).reshape(-1, 5))

    def followed(self, leaders: Array) -> Array:
        """Positions of the followers for leaders at (F,), shape (F,)."""
        (a, b, c, d, e), x = self.curve.T, leaders
        return a + x * (b + x * (c + x * (d + x * e)))

    def slope(self, leaders: Array) -> Array:
        """Derivatives of the followers by their leaders at (F,), shape (F,)."""
        (_, b, c, d, e), x = self.curve.T, leaders
        return b + x * (2.0 * c + x * (3.0 * d + x * 4.0 * e))


def led_joints(model: mujoco.MjModel) -> tuple[LedJoints, ...]:
    """The followers in the order of placing: after their leaders."""
    waiting, layers = followers(model), []
    while waiting:
        now = {one: led for one, led in waiting.items() if led[0] == one or led[0] not in waiting}
        now = now or waiting  # a cycle
        layers.append(LedJoints.of(now))
        waiting = {one: led for one, led in waiting.items() if one not in now}
    return tuple(layers)


def followers(model: mujoco.MjModel) -> dict[int, tuple[int, np.ndarray]]:
    """Joints with an active equality constraint: joint -> (leader, the five coefficients of its polynomial)."""
    # A joint that is held leads itself, by a constant.
    coupled = {}
    for equality in np.flatnonzero((model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 != 0)):
        follower, leader = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
        # MuJoCo's positions count from qpos0 here: y - y0 = p(x - x0).
        curve, start = model.eq_data[equality, :5], model.qpos0[model.jnt_qposadr[follower]]
        polynomial = np.zeros(5)
        if leader < 0:
            leader, polynomial[0] = follower, start + curve[0]
        else:
            from numpy.polynomial import Polynomial  # few models need it, and it is slow to import

            moved = Polynomial(curve)(Polynomial([-model.qpos0[model.jnt_qposadr[leader]], 1.0])).coef
            polynomial[: len(moved)] = moved
            polynomial[0] += start
        coupled[follower] = (leader, polynomial)
    return coupled


class Scratch(mujoco.MjData):
    """MuJoCo's state for computations that set qpos first, shared by deep copies: they would copy the model, 100 ms."""

    def __deepcopy__(self, memo: dict[int, object]) -> Scratch:
        return self


def posed(model: mujoco.MjModel, qpos: Array | None = None) -> mujoco.MjData:
    """MuJoCo's state with the kinematics of a pose (nq,), by default the initial one."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data


def path_to(model: mujoco.MjModel, body: int) -> list[int]:
    """The bodies from the root to a body, both included."""
    path = [body]
    while model.body_parentid[path[0]]:
        path.insert(0, int(model.body_parentid[path[0]]))
    return path


def below(model: mujoco.MjModel, body: int) -> list[int]:
    """A body and all below it."""
    found = [body]
    for other in range(body + 1, model.nbody):
        if int(model.body_parentid[other]) in found:
            found.append(other)
    return found


def hinges_at(model: mujoco.MjModel, body: int) -> list[int]:
    """The hinges between a body and its parent, in order, without followers of another one of them (as in a knee)."""
    joints = np.flatnonzero(model.jnt_bodyid == body).tolist()
    hinges = [joint for joint in joints if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE]
    if len(hinges) > 1 and model.neq:
        led = followers(model)
        hinges = [joint for joint in hinges if joint not in led or led[joint][0] not in hinges]
    return hinges


def hinges_between(model: mujoco.MjModel, above: int, body: int) -> list[int]:
    """The hinges from one body down to another, without those of the first one, in order."""
    path = path_to(model, body)
    first = path.index(above) + 1 if above in path else 0
    return [joint for on_way in path[first:] for joint in hinges_at(model, on_way)]


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints between the root and a body, those of the body included."""
    return np.flatnonzero(np.isin(model.jnt_bodyid, path_to(model, body))).tolist()


class UprightPelvis:
    """Turns the root of a robot so that its pelvis has a rotation.

    The pelvis is `below_a_waist` if hinges turn it against the root, and then stands `above_root`, m, else at 0.
    """

    def __init__(self, model: mujoco.MjModel, pelvis: int, root_rotation: Array) -> None:
        """Args: the robot; its pelvis; the rotation (4,) of the root body that stands upright and faces x."""
        self._model, self._pelvis, self._root = model, pelvis, root_rotation
        root = int(model.jnt_bodyid[0])
        self.below_a_waist = pelvis != root and bool(hinges_between(model, root, pelvis))
        data = mujoco.MjData(model)
        data.qpos[3:7] = root_rotation
        mujoco.mj_kinematics(model, data)
        self._standing = data.xquat[pelvis].copy()
        self.above_root = float(data.xpos[pelvis, 2] - data.xpos[root, 2]) if self.below_a_waist else 0.0

    def place(self, data: mujoco.MjData, turned: Array = IDENTITY) -> None:
        """Computes the kinematics with the pelvis turned (4,) from upright; joints stay."""
        data.qpos[3:7] = multiply(turned, self._root)
        mujoco.mj_kinematics(self._model, data)
        if self.below_a_waist:
            now = data.xquat[self._pelvis]
            data.qpos[3:7] = multiply(multiply(multiply(turned, self._standing), conjugate(now)), data.qpos[3:7])
            mujoco.mj_kinematics(self._model, data)


_ALONG = 0.95  # least cosine between an axis and the mirrored axis of its twin


def mirror_signs(path: Path) -> dict[str, int]:
    """The sign of each joint by name, where its axis in the zero pose is the mirrored one of its twin, or against it.

    A mirror across the plane y = 0 takes the axis (x, y, z) of a turn to (-x, y, -z). FileFormatError if there is no
    such model.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise FileFormatError(f"{path}: cannot be read as a model: {' '.join(str(error).split())[:200]}") from None
    data = posed(model)
    hinges = [number for number in range(model.njnt) if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_HINGE]
    axes = {model.joint(number).name: data.xaxis[number] for number in hinges}
    along = {name: float(way @ (axes.get(twin_of(name), 0.0 * way) * [-1.0, 1.0, -1.0])) for name, way in axes.items()}
    return {name: int(np.sign(cosine)) for name, cosine in along.items() if abs(cosine) > _ALONG}
