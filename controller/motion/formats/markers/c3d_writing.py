"""A C3D file with points where it had none: everything else in it stays as it is, byte by byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.motion.formats.markers.c3d import DEC, read_layout, seen_points
from controller.motion.formats.markers.tracks import unit_of_size
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_bytes


def with_points(path: Path, position: Array) -> bytes:
    """The content of a C3D file with places for points that it says were not seen.

    They get the residual 0, which the format has for points that were not measured.

    Args:
        path: the file.
        position: shape (T, M, 3), m, in the file's own axes; NaN where there is no place either.

    Raises:
        FileFormatError: if the file cannot be read, or one of the places lies out of range of the numbers of the file.
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
            raise FileFormatError(
                f"{path}: a filled point lies beyond what the range of this file's whole numbers. Write a .csv instead."
            )
    stored = np.frombuffer(content, form.number, form.frames * form.width, form.at)
    frame, point = np.nonzero(new)
    at = frame[:, None] * form.width + 4 * point[:, None] + np.arange(4)
    stored[at] = _dec(words) if form.processor == DEC and form.scale < 0.0 else words
    return bytes(content)


def _dec(values: Array) -> Array:
    """Numbers such that their bytes are those of DEC's: an exponent that is two higher, and halves exchanged."""
    halves = (4.0 * values).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
    return np.ascontiguousarray(halves).view("<f4").reshape(values.shape)
