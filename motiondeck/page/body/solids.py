"""The solids of a MuJoCo model as a few meshes that are drawn many times each, ready for a 3-D page.

A capsule is a mantle between two caps, because stretching a capsule would flatten its ends; so a humanoid of a hundred
primitives is a few batches: caps, mantles, spheres and boxes. A browser without a graphics card spends its time on
vertices, so nothing is drawn that the next solid hides, and shadows are coarser than what casts them.
"""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, multiply, rotate

Triangles = tuple[NDArray[np.float32], NDArray[np.uint32]]

CREASE = np.radians(40.0)  # where a surface turns by more than this from one triangle to the next is an edge, rad


def thinned(mesh: Triangles, most: int) -> Triangles:
    """A mesh of at most `most` triangles: vertices in one cell of a grid become their mean, in ever larger cells."""
    vertices, faces = mesh
    cells = 60
    while len(faces) > most and cells > 2:
        low = mesh[0].min(axis=0)
        size = max(float((mesh[0].max(axis=0) - low).max()), 1e-9) / cells
        grid = ((mesh[0] - low) / size).astype(np.int64) @ np.array([1, 1 << 10, 1 << 20])
        _, place, count = np.unique(grid, return_inverse=True, return_counts=True)
        sums = [np.bincount(place, mesh[0][:, axis], len(count)) for axis in range(3)]
        vertices = (np.stack(sums, axis=1) / count[:, None]).astype(np.float32)
        corners = place[mesh[1]]
        # Each begins with its lowest corner. Of those with the same front one is enough, of those without an area none.
        turned = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turned, axis=1).T
        _, first = np.unique((a * len(count) + b) * len(count) + c, return_index=True)
        first = np.sort(first)
        first = first[(a[first] != b[first]) & (b[first] != c[first]) & (c[first] != a[first])]
        faces = corners[first].astype(np.uint32)
        cells = int(cells / 1.25)
    return vertices, faces


def creased(mesh: Triangles) -> Triangles:
    """The same mesh with separate vertices on both sides of its edges."""
    # A page shades a corner by the mean direction of its triangles: so what is round looks round, what is sharp sharp.
    from trimesh import Trimesh  # 0.3 s; bodies of primitives need no edges
    from trimesh.graph import connected_component_labels

    corners = mesh[0][mesh[1]].reshape(-1, 3)
    place, number = np.unique(corners, axis=0, return_inverse=True)
    solid = Trimesh(place, number.reshape(-1, 3), process=False)
    even = solid.face_adjacency_angles < CREASE
    pairs, ends = solid.face_adjacency[even], solid.face_adjacency_edges[even]
    # The corner of each triangle of a pair at each end of their common side, shape (pairs, 2, 2).
    at = 3 * pairs[:, :, None] + (solid.faces[pairs][:, :, None] == ends[:, None, :, None]).argmax(axis=3)
    shared = connected_component_labels(at.swapaxes(1, 2).reshape(-1, 2), len(corners))
    vertices = np.empty((shared.max() + 1, 3), dtype=np.float32)
    vertices[shared] = corners
    return vertices, shared.reshape(-1, 3).astype(np.uint32)


LAST_VISIBLE_GROUP = 2
MOST_TRIANGLES, MOST_IN_SHADOW = 2500, 200  # of a mesh: some files have a hundred thousand


@dataclass(frozen=True)
class SolidBatch:
    """N copies of one mesh."""

    mesh: Triangles  # vertices (V, 3) and triangles (F, 3)
    shadow: Triangles  # the same solid with fewer triangles
    smooth: bool  # whether its surface is shaded across edges, where triangles share corners
    geom: NDArray[np.int64]  # the geom each copy belongs to, shape (N,)
    offset: Array  # where each copy is in the frame of its geom, shape (N, 3), m
    scale: Array  # the size of each copy along the axes of its geom, shape (N, 3)
    colour: NDArray[np.uint8]  # red, green, blue of each copy, shape (N, 3), 0 to 255
    opacity: float  # of all copies, 0 to 1


def batches(model: mujoco.MjModel, most: int = MOST_TRIANGLES) -> dict[str, SolidBatch]:
    """What is to be drawn of a model, by shape and opacity, each mesh with at most `most` triangles; no floors."""
    copies: dict[tuple[str, float], list[tuple[int, list[float], list[float]]]] = {}
    meshes = _primitives().copy()

    def add(shape: str, geom: int, scale: list[float], up: float = 0.0) -> None:
        opacity = round(float(_colour(model, geom)[3]), 2)
        copies.setdefault((shape, opacity), []).append((geom, [0.0, 0.0, up], scale))

    for geom in range(model.ngeom):
        if model.geom_group[geom] > LAST_VISIBLE_GROUP or _colour(model, geom)[3] == 0.0:
            continue
        a, b, c = (float(size) for size in model.geom_size[geom])
        match model.geom_type[geom]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                add("sphere", geom, [a, a, a])
            case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
                add("sphere", geom, [a, b, c])
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                add("cap up", geom, [a, a, a], up=b)
                add("cap down", geom, [a, a, a], up=-b)
                add("mantle", geom, [a, a, b])
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                add("cylinder", geom, [a, a, b])
            case mujoco.mjtGeom.mjGEOM_BOX:
                add("box", geom, [a, b, c])
            case mujoco.mjtGeom.mjGEOM_MESH:
                mesh = int(model.geom_dataid[geom])
                first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
                face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
                vertices = model.mesh_vert[first : first + count].astype(np.float32)
                drawn = vertices, model.mesh_face[face : face + faces].astype(np.uint32)
                meshes[f"mesh{mesh}"] = creased(thinned(drawn, most)), thinned(drawn, MOST_IN_SHADOW)
                add(f"mesh{mesh}", geom, [1.0, 1.0, 1.0])
    return {
        shape if opacity == 1.0 else f"{shape} {opacity:g}": SolidBatch(
            mesh=meshes[shape][0],
            shadow=meshes[shape][1],
            smooth=shape != "box",
            geom=np.array([geom for geom, _, _ in found]),
            offset=np.array([offset for _, offset, _ in found]),
            scale=np.array([scale for _, _, scale in found]),
            colour=np.array([np.round(255.0 * _colour(model, geom)[:3]) for geom, _, _ in found], dtype=np.uint8),
            opacity=opacity,
        )
        for (shape, opacity), found in copies.items()
    }


@cache
def _primitives() -> dict[str, tuple[Triangles, Triangles]]:
    """Meshes by shape, each with that of its shadow."""
    return {
        "sphere": (sphere(10, 18), sphere(4, 8)),
        "cap up": (cap(1.0, 3, 16), cap(1.0, 2, 8)),
        "cap down": (cap(-1.0, 3, 16), cap(-1.0, 2, 8)),
        "mantle": (mantle(16), mantle(8)),
        "cylinder": (cylinder(16), cylinder(8)),
        "box": (box(), box()),
    }


def poses(model: mujoco.MjModel, data: mujoco.MjData, geom: NDArray[np.int64], offset: Array) -> tuple[Array, Array]:
    """Where copies are that belong to geoms (N,), at offsets (N, 3), m: positions (N, 3), m, and quaternions (N, 4)."""
    orientation = multiply(data.xquat[model.geom_bodyid[geom]], model.geom_quat[geom])
    return data.geom_xpos[geom] + rotate(orientation, offset), orientation


def sphere(rings: int, segments: int) -> Triangles:
    """A sphere of radius 1."""
    polar = np.linspace(0.0, np.pi, rings + 1)
    return _surface(np.sin(polar), np.cos(polar), segments)


def cap(up: float, rings: int, segments: int) -> Triangles:
    """The upper (up = 1) or lower (-1) half of a sphere of radius 1, and one ring more."""
    # That ring lies within the mantle that the cap closes, and makes its shading go on smoothly there.
    polar = np.append(np.linspace(0.0, 0.5 * np.pi, rings + 1), 2.0 / 3.0 * np.pi)
    if up < 0.0:
        polar = np.pi - polar[::-1]
    return _surface(np.sin(polar), np.cos(polar), segments)


def mantle(segments: int) -> Triangles:
    """The mantle of a cylinder of radius 1 from z = -1 to 1, without lids."""
    return _surface(np.array([1.0, 1.0]), np.array([1.0, -1.0]), segments)


def cylinder(segments: int) -> Triangles:
    """The mantle of a cylinder of radius 1 from z = -1 to 1, with lids."""
    return creased(_surface(np.array([0.0, 1.0, 1.0, 0.0]), np.array([1.0, 1.0, -1.0, -1.0]), segments))


def box() -> Triangles:
    """A cube from -1 to 1; each side has its own corners, so that its edges stay sharp."""
    from trimesh.creation import box as cube

    solid = cube((2.0, 2.0, 2.0))
    return creased((solid.vertices.astype(np.float32), solid.faces.astype(np.uint32)))


def _surface(radius: Array, height: Array, segments: int) -> Triangles:
    """The surface that a line of (radius, height) points sweeps about z, seen from outside when it runs downwards."""
    from trimesh.creation import revolve  # with scipy it takes 0.3 s to import

    swept = revolve(np.column_stack([radius, height])[::-1], sections=segments)
    return swept.vertices.astype(np.float32), swept.faces.astype(np.uint32)


def _colour(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    material = int(model.geom_matid[geom])
    return model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
