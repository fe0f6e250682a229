"""Surface of a robot: a few hundred balls as its skin, and its exact lowest point."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, rotate
from sim.models.formats.mesh_files import CORNERS, box_sides

# Corners, edges and sides of a cube: directions of a mesh's farthest vertices.
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
# Evenly on a sphere.
_HIGH = 1.0 - np.arange(1.0, 400.0, 2.0) / 200.0
_ROUND = np.stack([*(np.sqrt(1.0 - _HIGH**2) * f(2.4 * np.arange(200.0)) for f in (np.cos, np.sin)), _HIGH], axis=1)
_RING = np.array([(np.cos(a), np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)])

FARTHER = 2.0  # reach of solids that do not collide, in that of those that do, from which they count
# In distances of a body's centre of mass from its joint: least reach of its solids (a rod's is 2), and half the longest
# side of the box of an inertia that tells how far it reaches (1 for a rod; many files have any numbers there).
BEYOND, LONG = 1.0, (0.5, 1.3)
AWAY, LIGHT = 0.005, 0.01  # least such distance, m, and mass, kg, that tell how far a body reaches


@dataclass(frozen=True)
class Surface:
    """N balls, each fixed to a body."""

    body: NDArray[np.int64]  # shape (N,)
    centre: Array  # in the frame of the body, shape (N, 3), m
    radius: Array  # shape (N,), m

    @classmethod
    def touching(cls, model: mujoco.MjModel) -> Surface:
        """What of all moving bodies can touch the floor: their colliding solids, if any, else all."""
        return cls._joined(_touching_balls(model))

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Surface:
        """The skin of all moving bodies: how far they reach."""
        # The other solids of a body count too where they reach much farther, or its colliding ones end at its centre of
        # mass or before, seen from its joint, as a bumper at an elbow does; and where those end there as well, the box
        # of its inertia.
        balls, touching = _touching_balls(model), solids(model)
        for body in np.flatnonzero(model.body_weldid != 0).tolist():
            others = np.setdiff1d(np.flatnonzero(model.geom_bodyid == body), touching)
            joint = _joint(model, body)
            far = max((float(np.linalg.norm(at - joint)) + radius for at, radius in balls[body]), default=0.0)
            away = np.linalg.norm(model.geom_pos[others] - joint, axis=1) + model.geom_rbound[others]
            if _ends_early(model, body, balls[body]) or away.max(initial=0.0) > FARTHER * far:
                balls[body] += [ball for geom in others for ball in _skin(model, int(geom))]
            if _ends_early(model, body, balls[body]):
                # None of a box that is much longer or shorter than a rod.
                halves = box_sides(model.body_inertia[body], float(model.body_mass[body]))
                if LONG[0] <= halves.max() / np.linalg.norm(model.body_ipos[body] - joint) <= LONG[1]:
                    corners = model.body_ipos[body] + rotate(model.body_iquat[body], CORNERS * halves)
                    balls[body] += [(corner, 0.0) for corner in corners]
        return cls._joined(balls)

    @classmethod
    def _joined(cls, balls: dict[int, list[tuple[Array, float]]]) -> Surface:
        found = [(body, point, radius) for body, mine in balls.items() for point, radius in mine]
        bodies, centres, radii = zip(*found, strict=True) if found else ((), (), ())
        return cls(np.array(bodies, np.int64), np.array(centres).reshape(-1, 3), np.array(radii, np.float64))

    def part(self, bodies: NDArray[np.int64]) -> Surface:
        """The balls of some bodies."""
        mine = np.isin(self.body, bodies)
        return Surface(self.body[mine], self.centre[mine], self.radius[mine])

    def positions(self, data: mujoco.MjData) -> Array:
        """Positions of the centres, shape (N, 3), m."""
        # By MuJoCo's matrices: quaternions would take 1.5 times as long.
        turned = np.matmul(data.xmat[self.body].reshape(-1, 3, 3), self.centre[:, :, None])
        return data.xpos[self.body] + turned[:, :, 0]


def _touching_balls(model: mujoco.MjModel) -> dict[int, list[tuple[Array, float]]]:
    balls: dict[int, list[tuple[Array, float]]] = {body: [] for body in range(model.nbody)}
    for geom in solids(model):
        balls[int(model.geom_bodyid[geom])] += _skin(model, int(geom))
    return balls


def _skin(model: mujoco.MjModel, geom: int) -> list[tuple[Array, float]]:
    """The balls of a solid in its body."""
    points, radius = _balls(model, geom)
    return [(point, radius) for point in model.geom_pos[geom] + rotate(model.geom_quat[geom], points)]


def _joint(model: mujoco.MjModel, body: int) -> Array:
    """The place (3,) of a body's first joint in its frame, m; its origin without one."""
    return model.jnt_pos[model.body_jntadr[body]] if model.body_jntnum[body] else np.zeros(3)


def _ends_early(model: mujoco.MjModel, body: int, balls: list[tuple[Array, float]]) -> bool:
    joint, way = _joint(model, body), model.body_ipos[body] - _joint(model, body)
    away = float(np.linalg.norm(way))
    if away < AWAY or model.body_mass[body] < LIGHT:
        return False
    return max((float((at - joint) @ way) / away + radius for at, radius in balls), default=0.0) < BEYOND * away


class LowestPoint:
    """The exact lowest point of the solids of `Surface`; vertices of a mesh are tested if its box may be lowest."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Prepares the G solids of a model, each on its `body`, shape (G,)."""
        self._geoms = solids(model)
        self.body = model.geom_bodyid[self._geoms]
        shapes = [_shape(model, int(geom)) for geom in self._geoms]
        self._radius = np.array([shape[0] for shape in shapes])
        self._round, self._flat = (np.array([shape[k] for shape in shapes]).reshape(-1, 3) for k in (1, 2))
        self._centre = np.zeros((len(shapes), 3))
        self._meshes: dict[int, Array] = {}
        for row, (_, _, _, vertices) in enumerate(shapes):
            if len(vertices) > 1:
                low, high = vertices.min(axis=0), vertices.max(axis=0)
                self._centre[row], self._flat[row], self._meshes[row] = (low + high) / 2.0, (high - low) / 2.0, vertices
        # One column a solid.
        self._up = 9 * self._geoms + np.array([[6], [7], [8]])
        self._rounded = np.flatnonzero(self._round.any(axis=1))
        self._round = np.ascontiguousarray(self._round[self._rounded].T)
        self._flat, self._centre = np.ascontiguousarray(self._flat.T), np.ascontiguousarray(self._centre.T)

    def bounds(self, data: mujoco.MjData) -> Array:
        """Lower bounds of the solids' heights, shape (G,), m; exact except for meshes."""
        up = data.geom_xmat.reshape(-1).take(self._up)
        low = data.geom_xpos[:, 2].take(self._geoms)
        low -= self._radius
        low -= np.add.reduce(np.abs(up) * self._flat)
        if len(self._rounded):
            wide = up.take(self._rounded, axis=1) * self._round
            low[self._rounded] -= np.sqrt(np.add.reduce(wide * wide))
        if self._meshes:
            low += np.add.reduce(up * self._centre)
        return low

    def __call__(self, data: mujoco.MjData, bounds: Array | None = None) -> float:
        """Its height in a state with kinematics, m; `bounds` if they are known."""
        left = self.bounds(data).copy() if bounds is None else bounds.copy()
        lowest = np.inf
        while len(left):
            row = int(left.argmin())
            if not left[row] < lowest:
                break
            vertices = self._meshes.get(row)
            if vertices is None:
                return float(left[row])
            geom = self._geoms[row]
            own = float((vertices @ data.geom_xmat[geom, 6:]).min()) + float(data.geom_xpos[geom, 2])
            lowest, left[row] = min(lowest, own), np.inf
        return float(lowest)


def reach(model: mujoco.MjModel, geom: int, direction: Array) -> Array:
    """Extent of a geom from its middle in a direction (..., 3) of its axes, shape (...), m."""
    radius, rounded, flat, vertices = _shape(model, geom)
    far = radius + np.sqrt(np.square(direction * rounded).sum(axis=-1)) + np.abs(direction * flat).sum(axis=-1)
    return far + (direction @ vertices.T).max(axis=-1)


def outline(model: mujoco.MjModel, geom: int) -> Array:
    """Points with the convex hull of a geom, or around a rounded one, in its body, (N, 3), m."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        points = _outermost(model, int(model.geom_dataid[geom]))
    elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        points = _ROUND * model.geom_size[geom]
    else:
        centres, radius = _balls(model, geom)
        points = (centres[:, None] + radius * _ROUND[: len(_ROUND) if radius else 1]).reshape(-1, 3)
    return model.geom_pos[geom] + rotate(model.geom_quat[geom], points)


def solids(model: mujoco.MjModel) -> NDArray[np.intp]:
    """The geoms of all moving bodies: the colliding ones, if any, else all."""
    moving = model.body_weldid[model.geom_bodyid] != 0
    colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    has_colliding = np.zeros(model.nbody, dtype=bool)
    has_colliding[model.geom_bodyid[colliding]] = True
    return np.flatnonzero(moving & (colliding | ~has_colliding[model.geom_bodyid]))


def _shape(model: mujoco.MjModel, geom: int) -> tuple[float, Array, Array, Array]:
    """Radius r, half axes a and b (3,) and vertices v (V, 3): along d it reaches r + |a d| + sum |b d| + max v.d."""
    a, b, c = (float(size) for size in model.geom_size[geom])
    none, centre = np.zeros(3), np.zeros((1, 3))
    match int(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return a, none, none, centre
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return a, none, np.array([0.0, 0.0, b]), centre
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return 0.0, np.array([a, b, c]), none, centre
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return 0.0, np.array([a, a, 0.0]), np.array([0.0, 0.0, b]), centre
        case mujoco.mjtGeom.mjGEOM_MESH:
            return 0.0, none, none, _outermost(model, int(model.geom_dataid[geom]))
        case _:
            return 0.0, none, np.array([a, b, c]), centre


def _outermost(model: mujoco.MjModel, mesh: int) -> Array:
    """The vertices of a mesh, or of its convex hull where MuJoCo has it, shape (V, 3), m."""
    vertices, at = _vertices(model, mesh), model.mesh_graphadr[mesh]
    if at < 0:
        return vertices
    # Its graph: numbers of vertices and faces, addresses of edges, indices of vertices, ...
    count = int(model.mesh_graph[at])
    return vertices[model.mesh_graph[at + 2 + count : at + 2 + 2 * count]]


def _vertices(model: mujoco.MjModel, mesh: int) -> Array:
    first = model.mesh_vertadr[mesh]
    return model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)


def _balls(model: mujoco.MjModel, geom: int) -> tuple[Array, float]:
    """The balls of one solid in its own frame: centres (N, 3) and one radius."""
    a, b, c = (float(size) for size in model.geom_size[geom])
    match model.geom_type[geom]:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return np.zeros((1, 3)), a
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.array([[0.0, 0.0, b], [0.0, 0.0, -b]]), a
        case mujoco.mjtGeom.mjGEOM_BOX:
            return CORNERS * [a, b, c], 0.0
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1)[:, None] * [a, b, c], 0.0
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            rim = np.column_stack([a * _RING, np.zeros(len(_RING))])
            return np.concatenate([rim + np.array([0.0, 0.0, b]), rim - np.array([0.0, 0.0, b])]), 0.0
        case mujoco.mjtGeom.mjGEOM_MESH:
            vertices = _vertices(model, int(model.geom_dataid[geom]))
            return vertices[np.unique(np.argmax(vertices @ _DIRECTIONS.T, axis=0))], 0.0
    return np.zeros((0, 3)), 0.0
