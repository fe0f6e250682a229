"""The solids of a MuJoCo model as a few meshes that are drawn many times each, ready for a 3-D page.

A capsule is a cylinder between two spheres, because stretching a capsule would flatten its ends; so a humanoid of a
hundred primitives is three batches: spheres, cylinders and boxes.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.rotations import Array, multiply, rotate
from sim.models.scenery import body_height

Triangles = tuple[NDArray[np.float32], NDArray[np.uint32]]

LAST_VISIBLE_GROUP = 2
# Spheres below this share of the body's height do with fewer triangles.
SMALL = 0.035


@dataclass(frozen=True)
class SolidBatch:
    """N copies of one mesh.

    Attributes:
        mesh: vertices (V, 3) and triangles (F, 3).
        smooth: whether its surface is round.
        geom: the geom each copy belongs to, shape (N,).
        offset: where each copy is in the frame of its geom, shape (N, 3), m.
        scale: the size of each copy along the axes of its geom, shape (N, 3).
        colour: red, green, blue of each copy, shape (N, 3), 0 to 255.
        opacity: of all copies, 0 to 1.
    """

    mesh: Triangles
    smooth: bool
    geom: NDArray[np.int64]
    offset: Array
    scale: Array
    colour: NDArray[np.uint8]
    opacity: float


def batches(model: mujoco.MjModel) -> dict[str, SolidBatch]:
    """What is to be drawn of a model, by shape and opacity; floors and other planes are left out."""
    copies: dict[tuple[str, float], list[tuple[int, list[float], list[float]]]] = {}
    meshes: dict[str, Triangles] = {
        "sphere": sphere(12, 20),
        "small sphere": sphere(8, 14),
        "cylinder": cylinder(20),
        "box": box(),
    }
    small = SMALL * body_height(model)

    def add(shape: str, geom: int, scale: list[float], up: float = 0.0) -> None:
        opacity = round(float(_colour(model, geom)[3]), 2)
        copies.setdefault((shape, opacity), []).append((geom, [0.0, 0.0, up], scale))

    for geom in range(model.ngeom):
        if model.geom_group[geom] > LAST_VISIBLE_GROUP or _colour(model, geom)[3] == 0.0:
            continue
        a, b, c = (float(size) for size in model.geom_size[geom])
        match model.geom_type[geom]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                add("sphere" if a > small else "small sphere", geom, [a, a, a])
            case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
                add("sphere" if max(a, b, c) > small else "small sphere", geom, [a, b, c])
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                add("small sphere", geom, [a, a, a], up=b)
                add("small sphere", geom, [a, a, a], up=-b)
                add("cylinder", geom, [a, a, b])
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                add("cylinder", geom, [a, a, b])
            case mujoco.mjtGeom.mjGEOM_BOX:
                add("box", geom, [a, b, c])
            case mujoco.mjtGeom.mjGEOM_MESH:
                mesh = int(model.geom_dataid[geom])
                first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
                face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
                name = f"mesh{mesh}"
                meshes[name] = (
                    model.mesh_vert[first : first + count].astype(np.float32),
                    model.mesh_face[face : face + faces].astype(np.uint32),
                )
                add(name, geom, [1.0, 1.0, 1.0])
    return {
        shape if opacity == 1.0 else f"{shape} {opacity:g}": SolidBatch(
            mesh=meshes[shape],
            smooth=shape in ("sphere", "small sphere", "cylinder"),
            geom=np.array([geom for geom, _, _ in found]),
            offset=np.array([offset for _, offset, _ in found]),
            scale=np.array([scale for _, _, scale in found]),
            colour=np.array([np.round(255.0 * _colour(model, geom)[:3]) for geom, _, _ in found], dtype=np.uint8),
            opacity=opacity,
        )
        for (shape, opacity), found in copies.items()
    }


def poses(model: mujoco.MjModel, data: mujoco.MjData, batch: SolidBatch) -> tuple[Array, Array]:
    """Where the copies of a batch are: positions (N, 3), m, and quaternions (N, 4)."""
    orientation = multiply(data.xquat[model.geom_bodyid[batch.geom]], model.geom_quat[batch.geom])
    return data.geom_xpos[batch.geom] + rotate(orientation, batch.offset), orientation


def sphere(rings: int, segments: int) -> Triangles:
    """A sphere of radius 1."""
    polar = np.linspace(0.0, np.pi, rings + 1)
    radius, height = np.sin(polar), np.cos(polar)
    return _surface(radius, height, segments)


def cylinder(segments: int) -> Triangles:
    """The mantle of a cylinder of radius 1 from z = -1 to 1, with lids."""
    vertices, faces = _surface(np.array([1.0, 1.0]), np.array([1.0, -1.0]), segments)
    lid, lid_faces = _surface(np.array([0.0, 1.0]), np.array([1.0, 1.0]), segments)
    floor, floor_faces = _surface(np.array([1.0, 0.0]), np.array([-1.0, -1.0]), segments)
    count = len(vertices)
    return (
        np.concatenate([vertices, lid, floor]),
        np.concatenate([faces, lid_faces + count, floor_faces + count + len(lid)]),
    )


def box() -> Triangles:
    """A cube from -1 to 1; each side has its own corners, so that its edges stay sharp."""
    vertices, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v, w = np.roll(np.eye(3), axis, axis=0)
            corners = [sign * u + a * v + b * w for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            order = [(0, 1, 2), (0, 2, 3)] if sign > 0 else [(0, 2, 1), (0, 3, 2)]
            faces += [[len(vertices) + i for i in triangle] for triangle in order]
            vertices += corners
    return np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32)


def _surface(radius: Array, height: Array, segments: int) -> Triangles:
    """The surface that a line of (radius, height) points sweeps about z, seen from outside when it runs downwards."""
    turn = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    vertices = np.concatenate(
        [np.column_stack([r * ring, np.full(segments, z)]) for r, z in zip(radius, height, strict=True)]
    )
    faces = []
    for level in range(len(radius) - 1):
        for here in range(segments):
            there = (here + 1) % segments
            a, b = level * segments + here, level * segments + there
            faces += [[a, a + segments, b + segments], [a, b + segments, b]]
    return vertices.astype(np.float32), np.array(faces, dtype=np.uint32)


def _colour(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    material = int(model.geom_matid[geom])
    return model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
