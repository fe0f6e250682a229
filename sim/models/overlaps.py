"""Overlaps: bodies of a model that penetrate each other, and the depth."""

import mujoco
import numpy as np

from controller.motion.rotations import Array

OVERLAP = 0.003  # depth up to which covers may touch, m

_NEIGHBOURS = 2  # joints between bodies that overlap at the joint itself


def near_bodies(model: mujoco.MjModel, rest: Array) -> set[tuple[int, int]]:
    """The pairs of bodies that are neighbours or overlap at rest (nq,), as far as the model lets them collide."""
    near: set[tuple[int, int]] = set()
    for body in range(1, model.nbody):
        other = body
        for _ in range(_NEIGHBOURS):
            other = int(model.body_parentid[other])
            if other != 0:
                near.add((min(body, other), max(body, other)))
    # Brothers hang from the same place.
    for a in range(1, model.nbody):
        near |= {(a, b) for b in range(a + 1, model.nbody) if model.body_parentid[a] == model.body_parentid[b]}
    data = mujoco.MjData(model)
    data.qpos[:] = rest
    return near | overlaps(model, data).keys()


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
