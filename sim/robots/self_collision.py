"""Self-collision: how deep the bodies of a robot penetrate each other, whatever its model lets touch."""

from __future__ import annotations

import mujoco

from controller.motion.rotations import Array
from sim.models.overlaps import near_bodies, overlaps
from sim.models.scenery import FLOOR
from sim.robots.robot import Robot


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
        depths = overlaps(self._model, self._data)
        return {pair: depth for pair, depth in depths.items() if pair not in self._near}
