"""The 15 patterns of H. Jaeger's conceptor demo, on which Deliallisi 2017 trained: MATLAB files of CMU motions.

The file of pattern X holds `nnRawDataX`, 61 channels a frame at 120 Hz (those of `bone_directions`, in mm and per
frame), and `segLengthsX`, the lengths of the 19 bones in mm. Channels 5 and 17, counted from 1, are zero by
construction; the files have rounding errors there.

A MAT file of version 5 to 7 (MAT-File Level 5 format, MathWorks) is a header of 128 bytes and elements: kind, size,
content. An element of kind 14 is a variable, whose own elements are flags with its class, its shape, its name, its
numbers. One of kind 15 is another element, compressed. scipy reads more of this format, but a damaged file can crash
the interpreter in it. Here cells, structs, objects and the rest are listed and never loaded.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions, walked_clip
from controller.motion.encodings.bone_directions import FIRST_BONE, FORWARD, HEIGHT, LEFT, TURN_RATE, BoneDirections
from controller.motion.rotations import Array
from controller.motion.skeleton import JAEGER_BONES, thesis_skeleton
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed, read_bytes

RATE = 120.0  # Hz, from the scripts that made the patterns; not in the files
MILLIMETRE = 0.001  # m
LARGEST = 16 * 2**20  # bytes
LARGEST_UNPACKED = 64 * 2**20  # bytes: a hostile file of one megabyte may unpack to a gigabyte
MATRIX, COMPRESSED = 14, 15
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
CLASSES = ("?", "cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8")
COMPLEX = 0x0800


@dataclass(frozen=True)
class Variable:
    """One variable of a MAT file, with its numbers if it is one of real doubles."""

    kind: str  # MATLAB's name for its class, "complex" for complex doubles, "other" for the rarer classes
    shape: tuple[int, ...]
    values: Array | None


def read_pattern(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in one of Jaeger's pattern files, on a skeleton with that file's bone lengths.

    All frames of the file are kept: nnRawWaltz.mat holds its 450 twice. Encoding the clip with BoneDirections gives the
    file's channels in m, rad and s, except for the velocities of the first frame.
    """
    options.refuse(path)
    pattern, data, lengths = _fields(path)
    if not (np.isfinite(data).all() and np.isfinite(lengths).all()):
        raise FileFormatError(f"{path}: holds a number that is not finite. Fetch the file again.")
    if not np.all((lengths > 0.0) & (lengths < 1e6)):
        raise FileFormatError(f"{path}: segLengths{pattern} holds a length that no bone in mm has. Fetch it again.")
    if np.any(np.abs(data[:, :FIRST_BONE]) > 1e6):
        raise FileFormatError(f"{path}: nnRawData{pattern} moves further than 1 km. Fetch the file again.")
    encoding = BoneDirections(thesis_skeleton(lengths * MILLIMETRE, pattern))
    channels = data.copy()
    channels[:, encoding.silent] = 0.0
    norms = np.linalg.norm(channels[:, FIRST_BONE:].reshape(len(channels), -1, 3), axis=-1)
    if np.any(np.abs(norms - 1.0) > 1e-6):
        frame, bone = np.argwhere(np.abs(norms - 1.0) > 1e-6)[0]
        raise FileFormatError(
            f"{path}: nnRawData{pattern}, frame {frame + 1}: the direction of bone '{JAEGER_BONES[bone]}' is no unit "
            f"vector (its length is {norms[frame, bone]:.6g}). Give the raw pattern, not a normalised one."
        )
    channels[:, HEIGHT] *= MILLIMETRE
    channels[:, TURN_RATE] *= RATE
    channels[:, FORWARD : LEFT + 1] *= MILLIMETRE * RATE
    return walked_clip(pattern, encoding.skeleton, encoding.decode(channels), RATE, Path(path).name)


def _fields(path: str | Path) -> tuple[str, Array, Array]:
    """The pattern's name, its data (T, 61) and its bone lengths (19,), in the units of the file."""
    there = read_mat(path)
    data_fields = (name for name in there if name.startswith("nnRawData") and name.isascii() and name.isidentifier())
    pattern = next(data_fields, "").removeprefix("nnRawData")
    found: list[Array] = []
    wanted = {f"nnRawData{pattern}": FIRST_BONE + 3 * len(JAEGER_BONES), f"segLengths{pattern}": len(JAEGER_BONES)}
    for name, columns in wanted.items():
        if name not in there:
            raise FileFormatError(
                f"{path}: there is no field '{name}' (there are: {listed(there) or 'none'}). "
                "Give one of Jaeger's nnRaw files, with fields nnRawData<name> and segLengths<name>."
            )
        field = there[name]
        rows = "frames" if name.startswith("nnRawData") else "1"
        fits = len(field.shape) == 2 and field.shape[1] == columns and (field.shape[0] == 1 or rows == "frames")
        if field.values is None or not fits or field.values.size == 0:
            shape = " x ".join(map(str, field.shape))
            raise FileFormatError(
                f"{path}: field '{name}' is {shape} of {field.kind}; expected {rows} x {columns} of double. "
                "Give one of Jaeger's nnRaw files."
            )
        found.append(field.values)
    data, lengths = found
    return pattern, data, lengths[0]


def read_mat(path: str | Path) -> dict[str, Variable]:
    """The variables of a MAT file by name; FileFormatError if it is of another format, damaged, or too large."""
    content = read_bytes(path, LARGEST)
    if content.startswith(b"MATLAB 7.3"):
        raise FileFormatError(f"{path}: this MAT file is in the 7.3 format. Save it in MATLAB with the option -v7.")
    if not content.startswith(b"MATLAB 5.0 MAT-file") or len(content) < 128:
        raise FileFormatError(f"{path}: this is not a MAT file of version 5. Save it in MATLAB with the option -v7.")
    order = ">" if content[126:128] == b"MI" else "<"
    variables: dict[str, Variable] = {}
    room = LARGEST_UNPACKED
    try:
        for kind, data in _elements(content[128:], order):
            if kind == COMPRESSED:
                data = zlib.decompressobj().decompress(data, room)
                room -= len(data)
                if room <= 0:
                    most = LARGEST_UNPACKED // 2**20
                    raise FileFormatError(f"{path}: unpacks to more than {most} MiB. Is it the right file?")
                kind, data = next(_elements(data, order))
            if kind == MATRIX:
                name, variable = _variable(data, order)
                variables[name] = variable
    except (ValueError, struct.error, zlib.error, StopIteration) as error:
        raise FileFormatError(f"{path}: this MAT file is damaged or cut short. Fetch it again.") from error
    return variables


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Kind and content of each element; ValueError if the last one is cut short."""
    place = 0
    while place < len(data):
        kind, size = struct.unpack_from(order + "II", data, place)
        start = place + 8
        if kind > 0xFFFF:  # a small element: size and kind share four bytes, and its content is the other four
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
        if start + size > len(data):
            raise ValueError("an element is cut short")
        yield kind, data[start : start + size]
        place = start + size
        if kind != COMPRESSED:  # the others are padded to multiples of eight bytes
            place += -place % 8


def _variable(data: bytes, order: str) -> tuple[str, Variable]:
    parts = _elements(data, order)
    (flags,) = struct.unpack_from(order + "I", next(parts)[1])
    number = flags & 0xFF
    kind = CLASSES[number] if number < len(CLASSES) else "other"
    if kind == "double" and flags & COMPLEX:
        kind = "complex"
    shape = tuple(np.frombuffer(next(parts)[1], order + "i4").tolist())
    name = next(parts)[1].decode("latin-1")
    if kind != "double":
        return name, Variable(kind, shape, None)
    stored, numbers = next(parts)
    if stored not in NUMBERS or min(shape, default=-1) < 0:
        raise ValueError("no numbers")
    values = np.frombuffer(numbers, order + NUMBERS[stored])
    if len(values) != math.prod(shape):
        raise ValueError("not as many numbers as the shape says")
    return name, Variable(kind, shape, values.astype(np.float64).reshape(shape, order="F"))


FORMAT = Format(suffixes=(".mat",), read=read_pattern, magic=b"MATLAB 5.0 MAT-file")
