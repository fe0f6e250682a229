"""The channels of the proposal of 2012: the angles of an .amc file, unchanged."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import as_float, read_lines


def recorded_angles(path: Path) -> Array:
    """The angles of an .amc file as they stand there, without the root's place: shape (T, 59) for CMU and HDM05, rad.

    They are neither wrapped nor made continuous; this is what the proposal of 2012 looks at. The file must already
    have been read without complaint.

    Raises:
        FileFormatError: if it is no .amc file.
    """
    if path.suffix.lower() != ".amc":
        raise FileFormatError(f"{path}: only .amc files hold angles.")
    frames: list[list[float]] = []
    unit = np.pi / 180.0
    for line in read_lines(path):
        words = line.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            unit = 1.0 if words and words[0].lower() == ":radians" else unit
        elif len(words) == 1 and words[0].isdecimal():
            frames.append([])
        else:
            values = words[4:] if words[0] == "root" else words[1:]
            frames[-1].extend(as_float(word) or 0.0 for word in values)
    return np.array(frames) * unit
