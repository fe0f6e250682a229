"""The tree of a robot's bodies: what hangs from what, and which hinges lie on the way."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.models.coupled_joints import followers


class Scratch(mujoco.MjData):
    """MuJoCo's state for sums that each begin with a qpos of their own: copies of what uses it share it.

    A deep copy of MjData copies the model too, 100 ms with meshes.
    """

    def __deepcopy__(self, memo: dict[int, object]) -> Scratch:
        return self


def path_to(model: mujoco.MjModel, body: int) -> list[int]:
    """The bodies from the root, which hangs from the world, to a body, both included."""
    path = [body]
    while model.body_parentid[path[0]]:
        path.insert(0, int(model.body_parentid[path[0]]))
    return path


def below(model: mujoco.MjModel, body: int) -> list[int]:
    """A body and all that hangs from it."""
    found = [body]
    for other in range(body + 1, model.nbody):
        if int(model.body_parentid[other]) in found:
            found.append(other)
    return found


def hinges_at(model: mujoco.MjModel, body: int) -> list[int]:
    """The hinges between a body and its parent, in order.

    Hinges that follow another one of the same body are left out: they belong to it, as in models of a human's knee,
    which rolls aside a little while it bends.
    """
    joints = np.flatnonzero(model.jnt_bodyid == body).tolist()
    hinges = [joint for joint in joints if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE]
    if len(hinges) > 1 and model.neq:
        led = followers(model)
        hinges = [joint for joint in hinges if joint not in led or led[joint][0] not in hinges]
    return hinges


def hinges_between(model: mujoco.MjModel, above: int, body: int) -> list[int]:
    """The hinges on the way from one body down to another, those of the first one left out, in order."""
    path = path_to(model, body)
    first = path.index(above) + 1 if above in path else 0
    return [joint for on_way in path[first:] for joint in hinges_at(model, on_way)]


def joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints between the root and a body, those of the body included."""
    return np.flatnonzero(np.isin(model.jnt_bodyid, path_to(model, body))).tolist()
