# pyright: strict
"""Motion capture recordings: read from any supported format, written for other programs."""

from __future__ import annotations

from pathlib import Path

from controller.mocap.clip import Clip
from controller.mocap.formats.reading import read_clip
from controller.mocap.formats.writing import write_clip
from controller.mocap.skeleton import Skeleton

__all__ = ["Clip", "Skeleton", "read_recording", "save_recording"]


def read_recording(path: str | Path, skeleton: str | Path | None = None) -> Clip:
    """The clip in a recording: .amc, .bvh, .c3d, .clip (taught by hand) or .mat (Jaeger's patterns).

    Args:
        path: the file.
        skeleton: for .amc, the .asf file it belongs to; None takes the only one in the same folder.

    Raises:
        MotiondeckError: if the file cannot be read; one line that names the file, the place and the remedy.
    """
    return read_clip(path, skeleton)


def save_recording(clip: Clip, path: str | Path) -> None:
    """Writes a clip as .bvh (rotations) or .csv (joint positions, m).

    Raises:
        MotiondeckError: for another ending, or if the file cannot be written.
    """
    write_clip(clip, Path(path))
