"""Self-collision: how deep the bodies of a robot are in one another, whatever its model lets touch."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np

from controller.rotations import Array
from sim.robot import Robot
from sim.stage import FLOOR

# Bodies so many joints apart or less overlap at the joint itself.
_NEIGHBOURS = 2


class SelfCollision:
    """Measures overlaps between bodies that do not overlap in the rest pose and are not neighbours."""

    def __init__(self, robot: Robot) -> None:
        spec = robot.spec.copy()
        for geom in spec.geoms:
            solid = geom.name != FLOOR
            geom.contype = geom.conaffinity = int(solid)
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._near = self._neighbours()
        robot.layout.place(robot.rest, self._data.qpos)
        for a, b in self._touching(self._data.qpos.copy()):
            self._near.add((a, b))

    def __call__(self, qpos: Array) -> tuple[float, str]:
        """The deepest overlap at qpos (nq,), m, and the two bodies: "r_forearm and head"."""
        touching = self._touching(qpos)
        if not touching:
            return 0.0, ""
        (a, b), depth = max(touching.items(), key=lambda item: item[1])
        return depth, f"{self._model.body(a).name} and {self._model.body(b).name}"

    def _touching(self, qpos: Array) -> dict[tuple[int, int], float]:
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        found: dict[tuple[int, int], float] = {}
        contact = data.contact
        bodies = model.geom_bodyid[contact.geom]
        for (a, b), distance in zip(np.sort(bodies, axis=1).tolist(), contact.dist.tolist(), strict=True):
            if (a, b) not in self._near and distance < 0.0:
                found[a, b] = max(found.get((a, b), 0.0), -distance)
        return found

    def _neighbours(self) -> set[tuple[int, int]]:
        model, near = self._model, set()
        for body in range(1, model.nbody):
            other = body
            for _ in range(_NEIGHBOURS):
                other = int(model.body_parentid[other])
                if other != 0:
                    near.add((min(body, other), max(body, other)))
        # Brothers hang from the same place.
        for a in range(1, model.nbody):
            for b in range(a + 1, model.nbody):
                if model.body_parentid[a] == model.body_parentid[b]:
                    near.add((a, b))
        return near
