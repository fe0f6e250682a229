"""Mesh files that MuJoCo does not read: COLLADA (.dae), text STL, and STL with very many triangles."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from controller.motion.rotations import Array, Indices, from_matrix, rotate
from motiondeck_base.errors import FileFormatError
from sim.models.formats.model_text import file_named


@dataclass(frozen=True)
class TriangleMesh:
    """The triangles of a mesh file."""

    points: Array  # shape (V, 3), in the file's axes
    faces: Indices  # three points a triangle, counter-clockwise, shape (F, 3)
    y_up: bool = False  # whether the file's y axis is up


_NOT_NEEDED = {"bind_material", "instance_camera", "instance_light"} | {
    f"library_{kind}" for kind in ("images", "effects", "materials", "cameras", "lights", "animations")
}


def read_collada(path: Path) -> TriangleMesh:
    """The triangles of a file; FileFormatError if it is no COLLADA file, or has none."""
    try:
        content = path.read_bytes()
        if b"<!DOCTYPE" in content:
            raise ValueError("it declares a document type")
        return _triangles(ElementTree.fromstring(content))
    except Exception as error:  # a damaged file can end in any error of pycollada
        raise FileFormatError(
            f"{path}: its triangles cannot be read ({error}); save it anew as an STL or OBJ and name that in the model"
        ) from None


def _triangles(root: ElementTree.Element) -> TriangleMesh:
    """All triangles of the scene, or without one of all geometries."""
    from collada import Collada  # few models need it, and it is slow to import
    from collada.triangleset import BoundTriangleSet, TriangleSet

    # Materials and pictures are often broken, and are not needed.
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag.rpartition("}")[2] in _NOT_NEEDED]:
            parent.remove(child)
    document = Collada(BytesIO(ElementTree.tostring(root)))
    scene = document.scene or next(iter(document.scenes), None)
    if scene is None:
        primitives = [primitive for geometry in document.geometries for primitive in geometry.primitives]
    else:
        primitives = [primitive for geometry in scene.objects("geometry") for primitive in geometry.primitives()]
    points: list[Array] = []
    faces: list[Indices] = []
    count = 0
    for primitive in primitives:
        if hasattr(primitive, "triangleset"):
            primitive = primitive.triangleset()
        if isinstance(primitive, TriangleSet | BoundTriangleSet):
            points.append(np.asarray(primitive.vertex, np.float64))
            faces.append(np.asarray(primitive.vertex_index, np.int64) + count)
            count += len(points[-1])
    if not faces:
        raise ValueError("there is no triangle in it")
    asset = document.assetInfo
    metre, y_up = (1.0, False) if asset is None else (asset.unitmeter or 1.0, asset.upaxis == "Y_UP")
    return TriangleMesh(np.concatenate(points) * metre, np.concatenate(faces), y_up)


READABLE = (".stl", ".obj", ".msh", ".dae")
SHELL = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # of a mesh that need not enclose a volume
_MOST = 200_000  # triangles of an STL file that MuJoCo reads
_THIN = 1e-3  # of the length of a flat mesh: how thick it is made
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # turns what has y up
_NO_VOLUME = re.compile(r"mesh volume is (?:too small|negative)[^:]*: (\S+)")
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))  # of a cube


MISSING = "(missing meshes)"  # a model's custom text: the files of meshes that boxes replace, a line each
_CUBE = np.full(3, 0.02)  # half a side of the box of a body without a known inertia, m


def find_meshes(spec: mujoco.MjSpec, folder: Path) -> None:
    """Corrects the case of letters in the names of mesh files in a folder; missing ones that only draw become boxes.

    The boxes have the inertia of their bodies; the model's text MISSING names the files.
    """
    missing: dict[str, Path] = {}
    for mesh in spec.meshes:
        named = folder / mesh.file
        found = file_named(named.absolute()) if mesh.file else named
        if not found.is_file() and mesh.file:
            missing[mesh.name] = named
        elif mesh.file and found != named.absolute():
            mesh.file = str(found)
    for geom in spec.geoms:
        if geom.meshname in missing and not geom.contype and not geom.conaffinity:
            _box(geom)
    boxed = missing.keys() - {geom.meshname for geom in spec.geoms}
    if boxed:
        spec.add_text(name=MISSING, data="\n".join(str(missing[name]) for name in sorted(boxed)))
    for name in boxed:
        spec.delete(spec.mesh(name))


def _box(geom: mujoco.MjsGeom) -> None:
    """Makes a geom a box with the mass and the inertia of its body, or a small cube in place."""
    body = geom.parent
    geom.meshname, geom.type, geom.size = "", mujoco.mjtGeom.mjGEOM_BOX, _CUBE
    if not body.explicitinertial or not body.mass > 0.0:
        return
    xx, yy, zz, xy, xz, yz = body.fullinertia.tolist()
    moments, turned = body.inertia, body.iquat
    if not np.isnan(xx):
        moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        turned = from_matrix(axes * np.linalg.det(axes))
    half = box_sides(moments, body.mass)
    if half.max() > 0.0:
        geom.pos, geom.quat, geom.size = body.ipos, turned, np.maximum(half, _THIN * half.max())


def box_sides(moments: Array, mass: float) -> Array:
    """Half the sides of an even box with principal moments of inertia (3,), kg m^2, and a mass, kg; shape (3,), m."""
    halves: Array = np.sqrt(np.maximum(1.5 * (moments.sum() - 2.0 * moments) / mass, 0.0))
    return halves


def read_solids(spec: mujoco.MjSpec, folder: Path) -> None:
    """Replaces meshes that MuJoCo cannot read by hulls, enough for contacts; FileFormatError for a broken one."""
    for name, read in read_meshes(spec, {mesh.name: folder / mesh.file for mesh in spec.meshes if mesh.file}).items():
        fill(spec.mesh(name), _hull(read.points))
        spec.mesh(name).file = ""


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of a spec; a mesh without volume has its mass on the surface."""
    while True:
        try:
            return spec.compile()
        except ValueError as error:
            named = _NO_VOLUME.search(str(error))
            mesh = spec.mesh(named[1]) if named else None
            if mesh is None or mesh.inertia == SHELL:
                raise
            mesh.inertia = SHELL


def read_meshes(spec: mujoco.MjSpec, files: Mapping[str, Path]) -> dict[str, TriangleMesh]:
    """The triangles of the mesh files that MuJoCo does not read, by the names of the meshes; errors as `read_solids`.

    Files with y up are turned if that brings the solids nearer to the centres of mass of their bodies: RViz does not
    turn them, and many robots were made to look right there.
    """
    found = {name: read for name, file in files.items() if (read := read_triangles(file)) is not None}
    away = np.zeros(2)
    for body in spec.bodies[1:]:
        for geom in body.geoms:
            read = found.get(geom.meshname)
            if read is None or not read.y_up or not body.explicitinertial:
                continue
            for k, points in enumerate((read.points, read.points @ _Y_UP.T)):
                scaled = points * spec.mesh(geom.meshname).scale
                middle = geom.pos + rotate(geom.quat, 0.5 * (scaled.min(axis=0) + scaled.max(axis=0)))
                away[k] += float(np.linalg.norm(middle - body.ipos))
    if away[1] < away[0]:
        found = {n: replace(r, points=r.points @ _Y_UP.T) if r.y_up else r for n, r in found.items()}
    return found


def fill(mesh: mujoco.MjsMesh, triangles: TriangleMesh) -> None:
    """Gives a mesh of a model its points and faces."""
    mesh.uservert, mesh.userface = triangles.points.ravel().tolist(), triangles.faces.ravel().tolist()


def read_triangles(path: Path) -> TriangleMesh | None:
    """The triangles of a mesh file; None if MuJoCo reads it or it is missing; FileFormatError for other files."""
    kind = path.suffix.lower()
    if not path.is_file():
        return None
    if kind == ".dae":
        return read_collada(path)
    if kind == ".stl":
        return _read_stl(path)
    if kind and kind not in READABLE:
        raise FileFormatError(f"{path}: a mesh of an unknown kind; convert it to STL, OBJ or DAE")
    return None


def _read_stl(path: Path) -> TriangleMesh | None:
    content = path.read_bytes()
    count = int.from_bytes(content[80:84], "little")
    if len(content) == 84 + _FACET.itemsize * count:
        if 0 < count <= _MOST:
            return None
        corners = np.frombuffer(content, _FACET, offset=84)["corners"].reshape(-1, 3).astype(np.float64)
    elif content[:5].lower() == b"solid":
        corners = np.array(_VERTEX.findall(content), dtype="S32").astype(np.float64).reshape(-1, 3)
    else:
        return None
    if len(corners) < 3 or len(corners) % 3:
        raise FileFormatError(f"{path}: there are no triangles in this STL file")
    return TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


def _hull(points: Array) -> TriangleMesh:
    """The convex hull of points (V, 3); a thin box where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError  # few models need it, and it is slow to import

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        low, high = points.min(axis=0), points.max(axis=0)
        size = np.maximum(high - low, max(_THIN * float((high - low).max()), 1e-6))
        hull = ConvexHull(0.5 * (low + high + CORNERS * size))
    kept = hull.vertices
    number = np.full(len(hull.points), -1)
    number[kept] = np.arange(len(kept))
    faces = number[hull.simplices]
    # Qhull lists corners either way round; the outside is where its equations say.
    a, b, c = (hull.points[hull.simplices[:, corner]] for corner in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return TriangleMesh(hull.points[kept], faces)
