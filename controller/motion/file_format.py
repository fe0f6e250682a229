"""A file format of recordings: a module of the folder `formats` that defines its row FORMAT.

Readers raise FileFormatError, naming the file and where possible the line, if it cannot be read or is broken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from controller.motion.clip import Clip
from controller.motion.markers import Markers
from controller.motion.reading_options import ReadingOptions

Reader = Callable[[str | Path, ReadingOptions], Clip | Markers]


@dataclass(frozen=True, kw_only=True)
class Format:
    """One row of the list of formats; docs/formats.toml says in words what each reads."""

    suffixes: tuple[str, ...]  # in lower case
    read: Reader  # returns the clip, or the markers that a body is then fitted to
    magic: bytes = b""  # first bytes of every such file, by which a wrong suffix is recognised; may be empty
    matches: Callable[[Path], bool] = lambda _: True  # false for other files with one of the suffixes
    general: bool = False  # reads, or refuses with the reason, what no other format of its suffixes matches
