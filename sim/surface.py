"""Surface: a robot's solids as a few hundred balls on its skin, so that its lowest point is quickly found."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.rotations import Array, rotate

# The corners, edges and sides of a cube: in these directions a mesh shows its farthest vertices.
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
_RING = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)])


@dataclass(frozen=True)
class Surface:
    """N balls, each fixed to a body.

    Attributes:
        body: which one, shape (N,).
        centre: in the frame of the body, shape (N, 3), m.
        radius: shape (N,), m.
    """

    body: NDArray[np.int64]
    centre: Array
    radius: Array

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Surface:
        """The skin of everything that moves; solids that collide stand for the others, where a body has some."""
        moving = model.body_weldid[model.geom_bodyid] != 0
        colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        has_colliding = np.zeros(model.nbody, dtype=bool)
        has_colliding[model.geom_bodyid[colliding]] = True
        found: list[tuple[int, Array, float]] = []
        for geom in np.flatnonzero(moving & (colliding | ~has_colliding[model.geom_bodyid])):
            body = int(model.geom_bodyid[geom])
            points, radius = _balls(model, int(geom))
            at = model.geom_pos[geom] + rotate(model.geom_quat[geom], points)
            found += [(body, point, radius) for point in at]
        bodies, centres, radii = zip(*found, strict=True) if found else ((), (), ())
        return cls(np.array(bodies, np.int64), np.array(centres).reshape(-1, 3), np.array(radii, np.float64))

    def part(self, bodies: NDArray[np.int64]) -> Surface:
        """What of it belongs to some bodies."""
        mine = np.isin(self.body, bodies)
        return Surface(self.body[mine], self.centre[mine], self.radius[mine])

    def positions(self, data: mujoco.MjData) -> Array:
        """Where the centres are, shape (N, 3), m."""
        return data.xpos[self.body] + rotate(data.xquat[self.body], self.centre)

    def heights(self, data: mujoco.MjData) -> Array:
        """How high the lowest point of each ball is, shape (N,), m."""
        third_row = data.xmat[self.body, 6:9]
        return data.xpos[self.body, 2] + np.einsum("ij,ij->i", third_row, self.centre) - self.radius


def _balls(model: mujoco.MjModel, geom: int) -> tuple[Array, float]:
    """The balls of one solid in its own frame: centres (N, 3) and one radius."""
    a, b, c = (float(size) for size in model.geom_size[geom])
    match model.geom_type[geom]:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return np.zeros((1, 3)), a
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.array([[0.0, 0.0, b], [0.0, 0.0, -b]]), a
        case mujoco.mjtGeom.mjGEOM_BOX:
            return _CORNERS * [a, b, c], 0.0
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1)[:, None] * [a, b, c], 0.0
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            rim = np.column_stack([a * _RING, np.zeros(len(_RING))])
            return np.concatenate([rim + np.array([0.0, 0.0, b]), rim - np.array([0.0, 0.0, b])]), 0.0
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first = model.mesh_vertadr[mesh]
            vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)
            return vertices[np.unique(np.argmax(vertices @ _DIRECTIONS.T, axis=0))], 0.0
    return np.zeros((0, 3)), 0.0
