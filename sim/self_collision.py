"""Self-collision: how deep the bodies of a robot are in one another, whatever its model lets touch."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from controller.rotations import Array
from sim.stage import FLOOR

if TYPE_CHECKING:
    from sim.robot import Robot

OVERLAP = 0.003
"""Covers may touch; deeper than this, m, something gives way."""

# Bodies so many joints apart or less overlap at the joint itself.
_NEIGHBOURS = 2


class SelfCollision:
    """Measures overlaps between bodies that do not overlap in the rest pose and are not neighbours."""

    def __init__(self, robot: Robot) -> None:
        spec = robot.spec.copy()
        for geom in spec.geoms:
            solid = geom.name != FLOOR
            geom.contype = geom.conaffinity = int(solid)
        model = spec.compile()
        rest = model.qpos0.copy()
        robot.layout.place(robot.rest, rest)
        self._near = near_bodies(model, rest)
        for a, b in self._near:  # what is never asked need not be computed
            if model.body(a).name and model.body(b).name:
                spec.add_exclude(bodyname1=model.body(a).name, bodyname2=model.body(b).name)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def __call__(self, qpos: Array) -> tuple[float, str]:
        """The deepest overlap at qpos (nq,), m, and the two bodies: "r_forearm and head"."""
        touching = self.touching(qpos)
        if not touching:
            return 0.0, ""
        pair, depth = max(touching.items(), key=lambda item: item[1])
        return depth, self.called(*pair)

    def called(self, a: int, b: int) -> str:
        """Two bodies by their names."""
        return f"{self._model.body(a).name} and {self._model.body(b).name}"

    def touching(self, qpos: Array) -> dict[tuple[int, int], float]:
        """The bodies that overlap at qpos (nq,), and by how much, m."""
        self._data.qpos[:] = qpos
        depths = _overlaps(self._model, self._data)
        return {pair: depth for pair, depth in depths.items() if pair not in self._near}


def near_bodies(model: mujoco.MjModel, rest: Array) -> set[tuple[int, int]]:
    """The pairs of bodies that are neighbours or overlap at rest (nq,), as far as the model lets them touch."""
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
    return near | _overlaps(model, data).keys()


def _overlaps(model: mujoco.MjModel, data: mujoco.MjData) -> dict[tuple[int, int], float]:
    """How deep bodies are in one another where data has them, m, by pair."""
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
