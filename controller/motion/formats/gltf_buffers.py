"""The contents of a glTF 2.0 file: its JSON as typed data, and the numbers in its buffers.

A .glb (or .vrm) is a header, a chunk of JSON and a chunk of bytes; a .gltf is the JSON alone, with its buffers beside
it or in it as base64. An accessor describes numbers in a buffer (specification, 3.6.2): type, count, stride, and those
replaced (sparse). Only files in the same folder are opened.
"""

from __future__ import annotations

import binascii
import struct
from pathlib import Path
from urllib.parse import unquote

import msgspec
import numpy as np

from controller.motion.rotations import Array, from_matrix
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_bytes, shortened

MOST_NODES = 10_000
MOST_NUMBERS = 100_000_000
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COMPRESSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class GltfNode(msgspec.Struct, rename="camel"):
    """A node of the tree, with its pose relative to its parent."""

    name: str = ""
    children: list[int] = []
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    matrix: tuple[float, ...] | None = None

    def pose(self) -> tuple[Array, Array, Array]:
        """Translation (3,), rotation (4,) with w last, and scale (3,)."""
        if self.matrix is None or len(self.matrix) != 16:
            return np.array(self.translation), np.array(self.rotation), np.array(self.scale)
        matrix = np.array(self.matrix).reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        turn = from_matrix(matrix[:3, :3] / np.where(scale > 0.0, scale, 1.0))
        return matrix[:3, 3], turn[[1, 2, 3, 0]], scale


class _Target(msgspec.Struct):
    path: str
    node: int | None = None


class _Channel(msgspec.Struct):
    sampler: int
    target: _Target


class Sampler(msgspec.Struct):
    """Keyframes: accessors of their times and values, and their interpolation."""

    input: int
    output: int
    interpolation: str = "LINEAR"


class Animation(msgspec.Struct):
    """Channels, each of which drives a property of a node by one of the samplers."""

    channels: list[_Channel] = []
    samplers: list[Sampler] = []


class _Skin(msgspec.Struct):
    joints: list[int] = []


class _Buffer(msgspec.Struct, rename="camel"):
    byte_length: int
    uri: str | None = None


class _View(msgspec.Struct, rename="camel"):
    buffer: int
    byte_length: int
    byte_offset: int = 0
    byte_stride: int | None = None


class _Values(msgspec.Struct, rename="camel"):
    buffer_view: int
    byte_offset: int = 0


class _Indices(_Values, rename="camel", kw_only=True):
    component_type: int


class _Sparse(msgspec.Struct):
    count: int
    indices: _Indices
    values: _Values


class _Accessor(msgspec.Struct, rename="camel"):
    component_type: int
    count: int
    type: str
    buffer_view: int | None = None
    byte_offset: int = 0
    normalized: bool = False
    sparse: _Sparse | None = None


class _About(msgspec.Struct):
    version: str = ""


class Asset(msgspec.Struct, rename="camel"):
    """The parts of a glTF file's JSON that a motion needs."""

    asset: _About
    nodes: list[GltfNode] = []
    skins: list[_Skin] = []
    animations: list[Animation] = []
    buffers: list[_Buffer] = []
    buffer_views: list[_View] = []
    accessors: list[_Accessor] = []
    extensions: dict[str, object] = {}
    extensions_required: list[str] = []

    def called(self, index: int) -> str:
        """A node, for a message."""
        return f"node {index} ('{shortened(self.nodes[index].name)}')"


def open_gltf(path: str | Path) -> tuple[Asset, Accessors]:
    """The contents of a glTF file (FileFormatError if it is broken)."""
    content = read_bytes(path)
    text, chunk = _chunks(path, content) if content[:4] == b"glTF" else (content, b"")
    try:
        asset = msgspec.json.decode(text, type=Asset)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path}: this is no glTF file ({error}). Is it the right one?") from None
    if not asset.asset.version.startswith("2."):
        version = shortened(asset.asset.version) or "unknown"
        raise FileFormatError(f"{path}: glTF of version {version} is not read. Export it as glTF 2.0.")
    packed = [name for name in asset.extensions_required if name in _COMPRESSIONS]
    if packed:
        raise FileFormatError(f"{path}: its numbers are packed ({packed[0]}). Export it without compression.")
    if len(asset.nodes) > MOST_NODES:
        raise FileFormatError(f"{path}: {len(asset.nodes)} nodes, which no body has. Export the body alone.")
    named = [child for node in asset.nodes for child in node.children]
    named += [joint for skin in asset.skins for joint in skin.joints]
    named += [c.target.node for animation in asset.animations for c in animation.channels if c.target.node is not None]
    wrong = next((node for node in named if not 0 <= node < len(asset.nodes)), None)
    if wrong is not None:
        raise FileFormatError(f"{path}: node {wrong} is named, but there are {len(asset.nodes)}. Export it again.")
    return asset, Accessors(path, asset, chunk)


def _chunks(path: str | Path, content: bytes) -> tuple[bytes, bytes]:
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<I4s", content, at)
        found.setdefault(kind, content[at + 8 : at + 8 + length])
        at += 8 + length
    if at > len(content) or b"JSON" not in found:
        raise FileFormatError(f"{path}: the file is cut short. Fetch it again.")
    return found[b"JSON"], found.get(b"BIN\0", b"")


class Accessors:
    """The numbers of a glTF file, by accessor (FileFormatError where they are broken)."""

    def __init__(self, path: str | Path, asset: Asset, chunk: bytes) -> None:
        self._path, self._asset, self._chunk = path, asset, chunk
        self._buffers: dict[int, bytes] = {}

    def numbers(self, index: int, width: int) -> Array:
        """The numbers of an accessor, shape (count, width); normalised integers as -1 to 1."""
        if not 0 <= index < len(self._asset.accessors):
            raise self._broken(f"accessor {index} is named, but there are {len(self._asset.accessors)}")
        accessor = self._asset.accessors[index]
        if _WIDTHS.get(accessor.type) != width or accessor.component_type not in _KINDS:
            raise self._broken(f"accessor {index} holds {shortened(accessor.type)}, where {width} numbers are needed")
        if not 0 <= accessor.count <= MOST_NUMBERS // width:
            raise self._broken(f"accessor {index} counts {accessor.count}")
        number = np.dtype(_KINDS[accessor.component_type])
        if accessor.buffer_view is None:
            raw = np.zeros((accessor.count, width), number)
        else:
            raw = self._view(accessor.buffer_view, accessor.byte_offset, accessor.count, width, number)
        if accessor.sparse is not None:
            raw = raw.copy()
            sparse = accessor.sparse
            if sparse.indices.component_type not in _KINDS or not 0 <= sparse.count <= accessor.count:
                raise self._broken(f"accessor {index} is sparse in a way that is not possible")
            kind = np.dtype(_KINDS[sparse.indices.component_type])
            at = self._view(sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, 1, kind)[:, 0]
            if len(at) and (at.dtype.kind == "f" or int(at.max()) >= accessor.count):
                raise self._broken(f"accessor {index} replaces what it does not have")
            raw[at] = self._view(sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, width, number)
        values = raw.astype(np.float64)
        if accessor.normalized and number.kind in "iu":
            values = np.maximum(values / np.iinfo(number).max, -1.0)
        if not np.isfinite(values).all() or (len(values) and float(np.abs(values).max()) > 1e9):
            raise self._broken(f"accessor {index} holds a number that is not finite")
        return values

    def _view(self, index: int, offset: int, count: int, width: int, number: np.dtype[np.generic]) -> np.ndarray:
        if not 0 <= index < len(self._asset.buffer_views):
            raise self._broken(f"buffer view {index} is named, but there are {len(self._asset.buffer_views)}")
        view = self._asset.buffer_views[index]
        buffer = self._buffer(view.buffer)
        stride = view.byte_stride or width * number.itemsize
        begin = view.byte_offset + offset
        end = begin + (stride * (count - 1) + width * number.itemsize if count else 0)
        if min(begin, view.byte_offset, offset) < 0 or stride < width * number.itemsize:
            raise self._broken(f"buffer view {index} is broken")
        if end > min(len(buffer), view.byte_offset + view.byte_length):
            raise self._broken(f"buffer view {index} ends before its numbers")
        if count == 0:
            return np.zeros((0, width), number)
        return np.ndarray((count, width), number, buffer, begin, (stride, number.itemsize))

    def _buffer(self, index: int) -> bytes:
        if not 0 <= index < len(self._asset.buffers):
            raise self._broken(f"buffer {index} is named, but there are {len(self._asset.buffers)}")
        if index not in self._buffers:
            uri = self._asset.buffers[index].uri
            self._buffers[index] = self._chunk if uri is None else self._fetched(uri)
        return self._buffers[index]

    def _fetched(self, uri: str) -> bytes:
        head, comma, data = uri.partition(",")
        if uri.startswith("data:"):
            if not comma or "base64" not in head:
                return b""
            try:
                return binascii.a2b_base64(data.encode("ascii"), strict_mode=True)
            except (ValueError, UnicodeEncodeError):
                raise self._broken("a buffer is no base64") from None
        name = unquote(uri)
        if Path(name).name != name or "\0" in name or name in ("", ".", ".."):
            raise self._broken(f"a buffer lies elsewhere ('{shortened(uri)}'); it is opened in the same folder only")
        return read_bytes(Path(self._path).parent / name)

    def _broken(self, problem: str) -> FileFormatError:
        return FileFormatError(f"{self._path}: {problem}. Export it again.")
