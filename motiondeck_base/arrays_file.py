"""Named arrays with a JSON header in one safetensors file: whole or not there, checked when read, nothing executed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import shortened, what_it_is, write_file
from motiondeck_base.words import printable

LARGEST_BYTES = 2**30
_CODES = {"b1": "BOOL"} | {f"{kind}{size}": f"{kind.upper()}{8 * size}" for kind in "iuf" for size in (1, 2, 4, 8)}


@dataclass(frozen=True)
class Kind:
    """One kind of file."""

    name: str  # what a user calls it
    key: str  # where its header stands in the metadata
    version: int  # of its format
    made_by: str  # how one is made, for error messages
    older: tuple[int, ...] = ()  # versions that are read as well; all others are refused


def write_arrays(path: Path, kind: Kind, header: msgspec.Struct, arrays: dict[str, NDArray[Any]]) -> None:
    """Writes a temporary file and renames it, so that it is whole or not there; FileFormatError if it cannot be."""
    entries: dict[str, Any] = {"__metadata__": {kind.key: msgspec.json.encode(header).decode()}}
    rows, at = sorted(arrays.items(), key=lambda row: (-row[1].itemsize, row[0])), 0
    for name, array in rows:
        ends = [at, at := at + array.nbytes]
        entries[name] = {"dtype": _CODES[array.dtype.str[1:]], "shape": array.shape, "data_offsets": ends}
    head = msgspec.json.encode(entries)
    head += b" " * (-len(head) % 8)
    write_file(path, len(head).to_bytes(8, "little"), head, *(np.ascontiguousarray(array).data for _, array in rows))


def read_arrays(path: Path, kind: Kind) -> tuple[object, StoredArrays]:
    """The header as plain values, its version checked, and the arrays; a FileFormatError says what is wrong."""
    try:
        if not path.is_file():
            raise FileFormatError(f"{path}: there is no such file. Make one with {kind.made_by}.")
        if path.stat().st_size > LARGEST_BYTES:
            raise FileFormatError(f"{path}: larger than {LARGEST_BYTES >> 30} GiB, which is no {kind.name}")
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (SafetensorError, TypeError, ValueError, AttributeError) as error:
        if found := what_it_is(path, path.read_bytes()[:1024]):
            raise FileFormatError(f"{path}: {found}") from None
        raise FileFormatError(f"{path}: not a safetensors file, or a damaged one ({error})") from None
    if kind.key not in metadata:
        raise FileFormatError(f"{path}: a safetensors file, but not a {kind.name}. Make one with {kind.made_by}.")
    try:
        header = msgspec.json.decode(metadata[kind.key])
    except (msgspec.DecodeError, RecursionError):
        raise FileFormatError(f"{path}: its header is damaged") from None
    if found := _controls_in(header):
        raise FileFormatError(f"{path}: its header has control characters in '{printable(found)}'")
    version = header.get("version") if isinstance(header, dict) else None
    if version not in (kind.version, *kind.older):
        raise FileFormatError(
            f"{path}: format version {shortened(repr(version))}; this Motiondeck reads version {kind.version}. "
            f"Make it again with {kind.made_by}."
        )
    return header, StoredArrays(path, arrays)


def _controls_in(tree: object) -> str:
    """A text in a header that a terminal would obey; "" if there is none."""
    if isinstance(tree, str):
        return tree if printable(tree) != tree else ""
    parts = [*tree.keys(), *tree.values()] if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return next((found for part in parts if (found := _controls_in(part))), "")


class StoredArrays:
    """Arrays as they were read, taken out one by one, each checked for shape, type and finiteness."""

    def __init__(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        self.path = path
        self._arrays = arrays

    def __contains__(self, name: str) -> bool:
        return name in self._arrays

    def size(self, name: str, axis: int = 0) -> int:
        """The length along an axis of an array that must be there and not be empty."""
        array = self._arrays.get(name)
        if array is None or array.ndim <= axis or array.shape[axis] == 0:
            raise FileFormatError(f"{self.path}: array '{name}' is missing or empty")
        return int(array.shape[axis])

    def take(self, name: str, *shape: int, kind: type | tuple[type, ...] = np.float32) -> NDArray[Any]:
        """An array that must be of this shape and type, or of one of these types."""
        kinds = [np.dtype(one) for one in (kind if isinstance(kind, tuple) else (kind,))]
        array = self._arrays.pop(name, None)
        if array is None:
            raise FileFormatError(f"{self.path}: array '{name}' is missing")
        if array.shape != shape or array.dtype not in kinds:
            raise FileFormatError(
                f"{self.path}: array '{name}' is {array.dtype} of shape {array.shape}, "
                f"expected {' or '.join(map(str, kinds))} of shape {shape}"
            )
        if not np.isfinite(array).all():
            raise FileFormatError(f"{self.path}: array '{name}' holds a number that is not finite")
        return array

    def leave_out(self, at: str) -> None:
        """Drops the arrays whose names begin so: an older Motiondeck stored them, and nothing needs them now."""
        self._arrays = {name: array for name, array in self._arrays.items() if not name.startswith(at)}

    def finish(self) -> None:
        """Checks that nothing is left over."""
        if self._arrays:
            raise FileFormatError(f"{self.path}: holds array '{next(iter(self._arrays))}', which nothing needs")
