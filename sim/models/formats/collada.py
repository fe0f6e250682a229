"""COLLADA files (.dae), which many URDFs name and MuJoCo cannot read: the triangles of the scene, in metres."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from controller.motion.rotations import Array, Indices
from motiondeck_base.errors import FileFormatError


@dataclass(frozen=True)
class TriangleMesh:
    """The triangles of a mesh file."""

    points: Array  # shape (V, 3), in the file's axes
    faces: Indices  # three points a triangle, counter-clockwise, shape (F, 3)
    y_up: bool = False  # whether the file's y axis is up


_NOT_NEEDED = {f"library_{kind}" for kind in ("images", "effects", "materials", "cameras", "lights", "animations")} | {
    "bind_material",
    "instance_camera",
    "instance_light",
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
