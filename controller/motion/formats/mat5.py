"""Real matrices of doubles from MAT files of version 5 to 7 (MAT-File Level 5 format, MathWorks).

scipy reads more of this format, but a damaged file can crash the interpreter in it. Here cells, structs, objects and
the rest are listed and never loaded.

A file is a header of 128 bytes and elements: kind, size, content. An element of kind 14 is a variable, whose own
elements are flags with its class, its shape, its name, its numbers. One of kind 15 is another element, compressed.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_bytes

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
                unpacker = zlib.decompressobj()
                data = unpacker.decompress(data, room)
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
