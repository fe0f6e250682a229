"""COLLADA files (.dae), which many URDFs name and MuJoCo cannot read: the triangles of the scene, in metres."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, about, normalise, to_matrix
from motiondeck_base.errors import FileFormatError


@dataclass(frozen=True)
class TriangleMesh:
    """The triangles of a mesh file."""

    points: Array  # shape (V, 3), in the file's axes
    faces: NDArray[np.int64]  # three points a triangle, counter-clockwise, shape (F, 3)
    y_up: bool = False  # whether the file's y axis is up


_DEEPEST = 50  # nodes inside each other


def read_collada(path: Path) -> TriangleMesh:
    """The triangles of a file; FileFormatError if it is no COLLADA file, or has none."""
    try:
        content = path.read_bytes()
        if b"<!DOCTYPE" in content:
            raise ValueError("it declares a document type")
        return _Document(ElementTree.fromstring(content)).triangles()
    except (OSError, ValueError, IndexError, KeyError, ElementTree.ParseError) as error:
        raise FileFormatError(
            f"{path}: its triangles cannot be read ({error}); save it anew as an STL or OBJ and name that in the model"
        ) from None


class _Document:
    def __init__(self, root: ElementTree.Element) -> None:
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
        self._root = root
        self._named = {f"#{name}": element for element in root.iter() if (name := element.get("id"))}

    def triangles(self) -> TriangleMesh:
        """All triangles of the scene, or without one of all geometries."""
        scene = self._root.find("library_visual_scenes/visual_scene")
        if scene is None:
            parts = [(np.eye(4), geometry) for geometry in self._root.iter("geometry")]
        else:
            parts = list(self._shown(scene, np.eye(4), _DEEPEST))
        points: list[Array] = []
        faces: list[NDArray[np.int64]] = []
        count = 0
        for place, geometry in parts:
            for corners, indices in self._primitives(geometry):
                points.append(corners @ place[:3, :3].T + place[:3, 3])
                faces.append(indices + count)
                count += len(corners)
        if not faces:
            raise ValueError("there is no triangle in it")
        unit = self._root.find("asset/unit")
        metre = 1.0 if unit is None else float(unit.get("meter", "1"))
        up = self._root.findtext("asset/up_axis", "").strip()
        return TriangleMesh(np.concatenate(points) * metre, np.concatenate(faces), up == "Y_UP")

    def _shown(
        self, node: ElementTree.Element, place: Array, deeper: int
    ) -> Iterator[tuple[Array, ElementTree.Element]]:
        """The geometries below a node, and the matrix (4, 4) of each."""
        if not deeper:
            raise ValueError("its nodes contain each other")
        for part in node:
            if part.tag in _TRANSFORMS:
                place = place @ _TRANSFORMS[part.tag](_numbers(part))
        for part in node:
            match part.tag:
                case "node":
                    yield from self._shown(part, place, deeper - 1)
                case "instance_node":
                    yield from self._shown(self._named[part.get("url", "")], place, deeper - 1)
                case "instance_geometry":
                    yield place, self._named[part.get("url", "")]
                case _:
                    pass

    def _primitives(self, geometry: ElementTree.Element) -> Iterator[tuple[Array, NDArray[np.int64]]]:
        """The points and triangles of each list of polygons of a geometry."""
        for tag in ("triangles", "polylist", "polygons"):
            for primitive in geometry.iterfind(f"mesh/{tag}"):
                inputs = {i.get("semantic"): (int(i.get("offset", "0")), i) for i in primitive.iterfind("input")}
                at, vertices = inputs["VERTEX"]
                points = self._positions(vertices.get("source", ""))
                stride = 1 + max(offset for offset, _ in inputs.values())
                lists = [_numbers(p).astype(np.int64)[at::stride] for p in primitive.iterfind("p")]
                sizes = [len(one) for one in lists]
                if tag == "triangles":
                    sizes = [3] * (sum(sizes) // 3)
                elif (counts := primitive.find("vcount")) is not None:
                    sizes = _numbers(counts).astype(np.int64).tolist()
                corners = np.concatenate([*lists, np.zeros(0, np.int64)])
                faces = _fans(corners, np.array(sizes, np.int64))
                if len(faces):
                    if faces.min() < 0 or faces.max() >= len(points):
                        raise ValueError("a corner is none of its points")
                    yield points, faces

    def _positions(self, vertices: str) -> Array:
        position = next(i for i in self._named[vertices].iterfind("input") if i.get("semantic") == "POSITION")
        source = self._named[position.get("source", "")]
        numbers, accessor = source.find("float_array"), source.find("technique_common/accessor")
        if numbers is None:
            raise ValueError("its points are not numbers")
        stride = 3 if accessor is None else int(accessor.get("stride", "3"))
        return _numbers(numbers).reshape(-1, stride)[:, :3]


def _fans(corners: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles (F, 3) of polygons, listed one after another, by the number of their corners."""
    first = np.repeat(np.cumsum(sizes) - sizes, np.maximum(sizes - 2, 0))
    step = np.concatenate([*(np.arange(size - 2) for size in sizes.tolist()), np.zeros(0, np.int64)]).astype(np.int64)
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)


def _numbers(element: ElementTree.Element) -> Array:
    return np.array((element.text or "").split(), np.float64)


def _moved(offset: Array) -> Array:
    place = np.eye(4)
    place[:3, 3] = offset
    return place


def _turned(axis_angle: Array) -> Array:
    """About an axis by an angle in degrees."""
    place = np.eye(4)
    place[:3, :3] = to_matrix(about(normalise(axis_angle[:3]), np.radians(axis_angle[3])))
    return place


_TRANSFORMS = {
    "matrix": lambda numbers: numbers.reshape(4, 4),
    "translate": _moved,
    "rotate": _turned,
    "scale": lambda numbers: np.diag([*numbers, 1.0]),
}
