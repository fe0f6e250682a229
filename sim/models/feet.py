"""Feet: flat soles of a robot, found from its shape in the rest pose, without names."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, cross
from sim.models.kinematic_tree import posed
from sim.models.surface import outline, reach, solids

# Largest height of a foot's joint, and of its lowest point, in heights of the robot: the ankle of a person is at 0.04,
# that of a small humanoid at 0.09, knees are at 0.27.
ANKLE, GROUND = 0.15, 0.03
# Largest slope of a flat sole, angle between its parts, rad, and its least share of the foot's shadow on the floor.
STEEP, LEVEL, FLAT = 0.7, 0.05, 0.25

_BOX, _MESH = int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_MESH)


@dataclass(frozen=True)
class Foot:
    """One foot, in the frame of its body."""

    body: str  # its name
    axes: Array  # columns ahead, left and up of the flat sole, shape (3, 3)
    corners: Array  # of the rectangle it stands on, shape (4, 3), m, in order
    round: bool  # whether it has rounded solids only, which touch a floor in a few points

    @property
    def sole(self) -> Array:
        """The middle of the sole, shape (3,), m."""
        return self.corners.mean(axis=0)

    @property
    def area(self) -> float:
        """Of that rectangle, m^2."""
        return float(np.prod(np.linalg.norm(np.diff(self.corners[:3], axis=0), axis=1)))


def find_feet(model: mujoco.MjModel, qpos: Array) -> tuple[Foot, ...]:
    """The feet of a robot that stands upright at qpos (nq,); none where nothing resembles a foot."""
    data = posed(model, qpos)
    down = np.array([0.0, 0.0, -1.0])
    lowest = np.full(model.nbody, np.inf)
    top = -np.inf
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if model.body_weldid[body] == 0:
            continue
        axes, z = data.geom_xmat[geom].reshape(3, 3), float(data.geom_xpos[geom, 2])
        lowest[body] = min(lowest[body], z - float(reach(model, geom, down @ axes)))
        top = max(top, z + float(reach(model, geom, -down @ axes)))
    ground = float(lowest.min())
    height = top - ground
    # The foot is the body with the largest sole among ankle link, sole and toes.
    found: dict[int, Foot] = {}
    chain: dict[int, int] = {}
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        if lowest[body] == np.inf and parent in chain:
            chain[body] = chain[parent]  # a link without solids
        elif lowest[body] < ground + GROUND * height and data.xpos[body, 2] < ground + ANKLE * height:
            first = chain[body] = chain.get(parent, body)
            foot = _foot(model, data, body)
            if first not in found or foot.area > found[first].area:
                found[first] = foot
    return tuple(found.values())


def _foot(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> Foot:
    """The foot of a body: its flat lower side, or that of the broadest rounded solid."""
    geoms = solids(model)
    geoms = geoms[model.geom_bodyid[geoms] == body]
    in_body = data.xmat[body].reshape(3, 3)
    side = _flat_side(model, geoms, -in_body[2])
    up = _broadest(model, data, geoms, in_body) if side is None else side[0]
    forward = in_body.T @ np.array([1.0, 0.0, 0.0])
    ahead = forward - (forward @ up) * up
    ahead /= np.linalg.norm(ahead)
    axes = np.stack([ahead, cross(up, ahead), up], axis=1)
    rounded = not np.isin(model.geom_type[geoms], (_BOX, _MESH)).any()
    if side is None or rounded:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for geom in geoms:
            ways = axes.T @ (in_body.T @ data.geom_xmat[geom].reshape(3, 3))
            centre = axes.T @ (in_body.T @ (data.geom_xpos[geom] - data.xpos[body]))
            low = np.minimum(low, centre - reach(model, int(geom), -ways))
            high = np.maximum(high, centre + reach(model, int(geom), ways))
    else:
        low, high = (side[1] @ axes).min(axis=0), (side[1] @ axes).max(axis=0)
    (back, right, bottom), (front, left, _) = low, high
    ring = ((back, right), (front, right), (front, left), (back, left))
    corners = np.array([[x, y, bottom] for x, y in ring], dtype=np.float64)
    return Foot(model.body(body).name, axes, corners @ axes.T, rounded)


def _flat_side(model: mujoco.MjModel, geoms: NDArray[np.intp], down: Array) -> tuple[Array, Array] | None:
    """The largest side of the hull of solids that faces down (3,): its upward normal (3,) and corners (N, 3)."""
    # None for a rounded foot, whose flat side is small beside the hull.
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    points = np.concatenate([outline(model, int(geom)) for geom in geoms])
    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    corners, normals = points[hull.simplices], hull.equations[:, :3]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    level = (normals @ normals.T > np.cos(LEVEL)) & (normals @ down > np.cos(STEEP))[:, None]
    area = level @ areas
    most = int(np.argmax(area))
    shadow = float((areas * np.abs(normals @ normals[most])).sum()) / 2.0
    if area[most] < FLAT * shadow:
        return None
    mean = areas[level[most]] @ normals[level[most]]
    return -mean / np.linalg.norm(mean), corners[level[most]].reshape(-1, 3)


def _broadest(model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.intp], in_body: Array) -> Array:
    """The most vertical axis of the broadest solid, upwards, shape (3,)."""

    def footprint(geom: int) -> tuple[float, Array]:
        axes = in_body.T @ data.geom_xmat[geom].reshape(3, 3)
        up = int(np.argmax(np.abs(in_body[2] @ axes)))
        spans = np.array([float(reach(model, geom, np.eye(3)[axis])) for axis in range(3)])
        # A ball has no axis.
        return float(np.delete(spans, up).prod()) * (1.0 if np.ptp(spans) > 1e-6 else 0.0), axes[:, up]

    up: Array = max((footprint(int(geom)) for geom in geoms), key=lambda pair: pair[0])[1]
    return up if in_body[2] @ up > 0.0 else -up
