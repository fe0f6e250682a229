"""Overlaps: bodies of a model that penetrate each other, and the depth."""

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.kinematic_tree import path_to, posed

OVERLAP = 0.003  # depth up to which covers may touch, m

_NEIGHBOURS = 2  # joints between bodies that overlap at the joint itself


def near_bodies(model: mujoco.MjModel, rest: Array) -> set[tuple[int, int]]:
    """The pairs of bodies that are neighbours or overlap at rest (nq,), as far as the model lets them collide."""
    bodies = range(1, model.nbody)
    near = {(above, body) for body in bodies for above in path_to(model, body)[-1 - _NEIGHBOURS : -1]}
    # Brothers hang from the same place.
    for a in bodies:
        near |= {(a, b) for b in range(a + 1, model.nbody) if model.body_parentid[a] == model.body_parentid[b]}
    return near | overlaps(model, posed(model, rest)).keys()


def overlaps(model: mujoco.MjModel, data: mujoco.MjData) -> dict[tuple[int, int], float]:
    """Depth of overlaps in the pose of `data`, m, by pair."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    found: dict[tuple[int, int], float] = {}
    contact = data.contact
    bodies = model.geom_bodyid[contact.geom]
    for (a, b), distance in zip(np.sort(bodies, axis=1).tolist(), contact.dist.tolist(), strict=True):
        if distance < 0.0:
            found[a, b] = max(found.get((a, b), 0.0), -distance)
    return found
