"""C3D recordings of markers (the format's user guide, c3d.org).

A file is blocks of 512 bytes: a header, parameters in groups (POINT, TRIAL, ...), then the frames, each with x, y, z
and a residual for every point, and analog samples, which are skipped. Numbers are Intel's, DEC's (VAX) or MIPS's;
points are int16 times a scale, or float32 if that scale is negative. A point with a negative residual, or exactly at
the origin, was not seen. (A public reader can crash the process on a damaged file.)
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import AS_FOUND, FARTHEST, UNITS, Format, Markers, ReadingOptions, unit_of_size
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_bytes, shortened

BLOCK = 512
DEC = 85
ORDERS = {84: "<", DEC: "<", 86: ">"}  # of the bytes of Intel's, DEC's and MIPS's numbers
TYPES = {-1: "S1", 1: "u1", 2: "i2", 4: "f4"}

Parameters: TypeAlias = dict[str, NDArray[np.generic]]  # values of "POINT:RATE" and so on, an entry a row


@dataclass(frozen=True, eq=False)
class C3dLayout:
    """Location and meaning of the numbers in a C3D file."""

    processor: int  # one of ORDERS
    parameters: Parameters
    at: int  # the first byte of the points
    frames: int
    points: int
    width: int  # count of the numbers in a frame (4 a point, then analog ones)
    scale: float  # of whole numbers; negative for floating-point numbers
    rate: float  # Hz
    unit: float | None  # m; None if the file names no known one

    @property
    def number(self) -> np.dtype[np.generic]:
        """The stored type; floating-point numbers of a DEC also need `_floats`."""
        return np.dtype(ORDERS[self.processor] + ("f4" if self.scale < 0.0 else "i2"))

    @property
    def step(self) -> float:
        """A stored 1 in the file's unit."""
        return 1.0 if self.scale < 0.0 else self.scale


def read_layout(path: str | Path, content: bytes) -> C3dLayout:
    """The layout of a C3D file (FileFormatError if it is broken or holds no points)."""
    if len(content) < 2 * BLOCK or content[1] != 0x50:
        raise FileFormatError(f"{path}: this is no C3D file. Is it the right one?")
    start = (content[0] - 1) * BLOCK
    if not BLOCK <= start <= len(content) - 4:
        raise FileFormatError(f"{path}: its parameters are not in the file. It is cut short: fetch it again.")
    processor = content[start + 3]
    if processor not in ORDERS:
        raise FileFormatError(f"{path}: it was written by an unknown kind of machine ({processor}). Fetch it again.")
    parameters = _parameters(path, content, start + 4, processor)

    header = np.frombuffer(content[:24], ORDERS[processor] + "u2")
    points = _whole(parameters, "POINT:USED", int(header[1]))
    analog = int(header[2])
    scale, rate = _floats(content[12:16] + content[20:24], processor)
    scale = _number(parameters, "POINT:SCALE", scale)
    rate = _number(parameters, "POINT:RATE", rate)
    at = (_whole(parameters, "POINT:DATA_START", int(header[8])) - 1) * BLOCK
    if points == 0:
        raise FileFormatError(f"{path}: there are no points in this file. Give one with markers.")
    if not (np.isfinite(rate) and 0.0 < rate < 1e5):
        raise FileFormatError(f"{path}: a rate of {rate:g} frames per second is not possible. Fetch it again.")
    width = 4 * points + analog
    size = width * (4 if scale < 0.0 else 2)
    frames = _frames(parameters, int(header[3]), int(header[4]))
    there = (len(content) - at) // size if at >= BLOCK else 0
    if not 0 < frames <= there:
        raise FileFormatError(
            f"{path}: {frames} frames of {points} points are announced, {max(there, 0)} are there. Fetch it again."
        )
    unit = UNITS.get(_text(parameters, "POINT:UNITS").lower().rstrip("."))
    return C3dLayout(processor, parameters, at, frames, points, width, scale, rate, unit)


def read_c3d(path: str | Path, options: ReadingOptions = AS_FOUND) -> Markers:
    """The points in a C3D file."""
    content = read_bytes(path)
    form = read_layout(path, content)
    position = seen_points(content, form)
    with np.errstate(all="ignore"):
        position *= options.unit or form.unit or unit_of_size(position)
        position[~(np.abs(position).max(axis=-1) < FARTHEST)] = np.nan
    if np.isnan(position).all():
        raise FileFormatError(f"{path}: no point was ever seen in this file. Give another recording.")
    up = _text(form.parameters, "POINT:Y_SCREEN").lower().lstrip("+")
    labels = _labels(form.parameters, form.points)
    labels = options.renamed(labels, path) if options.rename else labels
    up = options.up or (up if up in ("x", "y", "z") else None)
    return Markers(labels, form.rate, position, up, Path(path).name)


def seen_points(content: bytes, form: C3dLayout) -> Array:
    """Positions of the points, shape (T, M, 3), in the file's axes and unit; NaN where one was not seen."""
    raw = content[form.at : form.at + form.frames * form.width * form.number.itemsize]
    words = _floats(raw, form.processor) if form.scale < 0.0 else np.frombuffer(raw, form.number).astype(np.float64)
    place = words.reshape(form.frames, form.width)[:, : 4 * form.points].reshape(form.frames, form.points, 4)
    with np.errstate(all="ignore"):  # a broken number is a point not seen
        position = place[..., :3] * form.step
        position[~(place[..., 3] >= 0.0) | (position == 0.0).all(axis=-1)] = np.nan
    return position


def _parameters(path: str | Path, content: bytes, at: int, processor: int) -> Parameters:
    groups: dict[int, str] = {}
    found: dict[tuple[int, str], NDArray[np.generic]] = {}
    try:
        while content[at] != 0:
            length = abs(int.from_bytes(content[at : at + 1], signed=True))
            group = int.from_bytes(content[at + 1 : at + 2], signed=True)
            name = content[at + 2 : at + 2 + length].decode("latin-1").upper()
            at += 2 + length
            offset = int(np.frombuffer(content[at : at + 2], ORDERS[processor] + "u2")[0])
            if group < 0:
                groups[-group] = name
            else:
                found[group, name] = _values(content, at + 2, processor)
            if offset == 0:
                break
            at += offset
    except (IndexError, ValueError) as error:
        raise FileFormatError(f"{path}: its parameters are damaged ({error}). Fetch the file again.") from error
    return {f"{groups[group]}:{name}": values for (group, name), values in found.items() if group in groups}


def _values(content: bytes, at: int, processor: int) -> NDArray[np.generic]:
    """The values of the parameter whose type is at an offset."""
    kind = int.from_bytes(content[at : at + 1], signed=True)
    shape = list(content[at + 2 : at + 2 + content[at + 1]])
    if kind not in TYPES or len(shape) != content[at + 1]:
        raise ValueError(f"a parameter of kind {kind}")
    if kind == -1:
        # Characters come in rows: the first dimension is how long each text is.
        width, *shape = shape or [1]
        if width == 0:
            return np.zeros(0, "S1")
        element = np.dtype(f"S{width}")
    else:
        element = np.dtype(ORDERS[processor] + TYPES[kind])
    size = int(np.prod(shape, dtype=np.int64)) * element.itemsize
    at += 2 + content[at + 1]
    raw = content[at : at + size]
    if len(raw) < size:
        raise ValueError("a parameter ends after the file")
    if kind == 4:
        return _floats(raw, processor)
    return np.frombuffer(raw, element)


def _floats(raw: bytes, processor: int) -> Array:
    if processor != DEC:
        return np.frombuffer(raw, ORDERS[processor] + "f4").astype(np.float64)
    # DEC's have their halves exchanged, and an exponent that is two higher.
    halves = np.frombuffer(raw, "<u2").reshape(-1, 2)[:, ::-1]
    with np.errstate(all="ignore"):
        return np.ascontiguousarray(halves).view("<f4").ravel().astype(np.float64) / 4.0


def _number(parameters: Parameters, name: str, otherwise: float) -> float:
    values = parameters.get(name)
    return otherwise if values is None or values.size == 0 or values.dtype.kind == "S" else float(values.ravel()[0])


def _whole(parameters: Parameters, name: str, otherwise: int) -> int:
    """A count, which may be stored as int16 though it is never negative."""
    value = _number(parameters, name, otherwise)
    return int(value) % 65536 if np.isfinite(value) else otherwise


def _frames(parameters: Parameters, first: int, last: int) -> int:
    """The number of frames: the header counts to 65535, TRIAL further."""
    ends = [parameters.get(f"TRIAL:ACTUAL_{end}_FIELD") for end in ("START", "END")]
    if all(end is not None and end.dtype.kind == "i" and end.size == 2 for end in ends):
        start, end = (int(e[0]) % 65536 + 65536 * (int(e[1]) % 65536) for e in ends if e is not None)
        if end >= start and end > 65535:
            return end - start + 1
    return last - first + 1


def _text(parameters: Parameters, name: str) -> str:
    values = parameters.get(name)
    if values is None or values.size == 0 or values.dtype.kind != "S":
        return ""
    return bytes(values.ravel()[0]).decode("latin-1").strip()


def _labels(parameters: Parameters, points: int) -> tuple[str, ...]:
    """One label a point; files with more than 255 points continue in LABELS2, and some label only the first 255."""
    labels: list[str] = []
    for name in ("POINT:LABELS", *(f"POINT:LABELS{number}" for number in range(2, 10))):
        values = parameters.get(name)
        if values is not None and values.dtype.kind == "S":
            labels += [shortened(bytes(value).decode("latin-1").strip()) for value in values.ravel()]
    return tuple([*labels, *(f"*{number}" for number in range(len(labels) + 1, points + 1))][:points])


def with_points(path: Path, position: Array) -> bytes:
    """The content of a C3D file with positions for its unseen points; all other bytes stay.

    They get the residual 0, the format's mark for points that were not measured. Positions have the shape (T, M, 3),
    m, and the axes of the file; NaN for points that stay open. FileFormatError if the file cannot be read, or a
    position is out of range of the numbers of the file.
    """
    content = bytearray(read_bytes(path))
    form = read_layout(path, bytes(content))
    seen = seen_points(bytes(content), form)
    new = np.isnan(seen[..., 0]) & np.isfinite(position).all(axis=-1)
    unit = form.unit or unit_of_size(seen)
    words = np.concatenate([position[new] / (unit * form.step), np.zeros((int(new.sum()), 1))], axis=-1)
    if form.scale >= 0.0:
        words = np.round(words)
        if np.abs(words).max(initial=0.0) > np.iinfo(np.int16).max:
            raise FileFormatError(f"{path}: a filled point is beyond this file's whole numbers. Write a .csv instead.")
    stored = np.frombuffer(content, form.number, form.frames * form.width, form.at)
    frame, point = np.nonzero(new)
    at = frame[:, None] * form.width + 4 * point[:, None] + np.arange(4)
    stored[at] = _dec(words) if form.processor == DEC and form.scale < 0.0 else words
    return bytes(content)


def _dec(values: Array) -> Array:
    """Numbers with the bytes of DEC's: an exponent that is two higher, and halves exchanged."""
    halves = (4.0 * values).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").reshape(values.shape)


FORMAT = Format(suffixes=(".c3d",), read=read_c3d)
