"""The tree of a robot's bodies, the hinges along it, and its pelvis: a file may have the free root above a waist."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import IDENTITY, Array, conjugate, multiply
from sim.models.coupled_joints import followers


class Scratch(mujoco.MjData):
    """MuJoCo's state for computations that set qpos first, shared by deep copies: they would copy the model, 100 ms."""

    def __deepcopy__(self, memo: dict[int, object]) -> Scratch:
        return self


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
