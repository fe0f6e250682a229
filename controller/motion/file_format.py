"""A file format of recordings: a module of the folder `formats` that defines its row FORMAT."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from controller.motion.clip import Clip
from controller.motion.markers import Markers
from controller.motion.reading_options import ReadingOptions

Reader = Callable[[str | Path, ReadingOptions], Clip | Markers]


@dataclass(frozen=True, kw_only=True)
class Format:
    """One row of the list of formats.

    Attributes:
        name: of the format and where such files come from, as in the table of docs/clips.md.
        suffixes: in lower case.
        read: returns the clip, or the markers that a body is then fitted to.
        supported, unsupported: contents of the files, for that table.
        magic: first bytes of every such file, by which a wrong suffix is recognised; may be empty.
        matches: whether a file with one of the suffixes is a recording, where other files share them.
    """

    name: str
    suffixes: tuple[str, ...]
    read: Reader
    supported: str
    unsupported: str = ""
    magic: bytes = b""
    matches: Callable[[Path], bool] = lambda _: True
