# pyright: strict
"""Motion capture recordings: read from any supported format, written for other programs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from controller.motion.clip import Clip, ReadingOptions
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import write_clip
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import MotiondeckError

__all__ = ["Clip", "Skeleton", "read_recording", "save_recording"]


def read_recording(
    path: str | Path,
    skeleton: str | Path | None = None,
    *,
    unit: float | None = None,
    up: Literal["y", "z"] | None = None,
    rename: Mapping[str, str] | None = None,
) -> Clip:
    """The clip in a recording.

    The table in docs/clips.md lists the formats. MotiondeckError if the file cannot be read; one line that names the
    file, the place and the remedy.

    Args:
        skeleton: for .amc, the .asf file it belongs to (None looks in the same folder and the one above); for .npz,
            the body model (None takes average proportions).
        unit: length of one unit of the file, m, such as 0.01; None detects it.
        up: the axis of the file that is up; None detects it.
        rename: other names for joints, bones or markers, by the names in the file.
    """
    return read_clip(path, ReadingOptions(None if skeleton is None else Path(skeleton), unit, up, rename or {}))


def the_clip(given: object) -> Clip:
    """What was given for a clip, if it is one. MotiondeckError for anything else, such as a recording's path."""
    if not isinstance(given, Clip):
        kind = f"{str(given)!r}" if isinstance(given, str | Path) else f"a {type(given).__name__}"
        raise MotiondeckError(f"{kind} is no clip. Read the recording first: motiondeck.read_recording(path)")
    return given


def save_recording(clip: Clip, path: str | Path) -> None:
    """Writes a clip as .bvh (rotations) or .csv (joint positions, m).

    MotiondeckError for another ending, or if the file cannot be written.
    """
    write_clip(the_clip(clip), Path(path))
