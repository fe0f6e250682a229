"""How recordings are read: what overrides or completes a file, and a row of the list of formats.

A format is a module of the folder `formats` that defines its row FORMAT. Readers raise FileFormatError, naming the file
and where possible the line, if it cannot be read or is broken.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from controller.motion.clip import Clip, Markers
from controller.motion.up_axis import Up
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
"""Units of angles, rad."""


@dataclass(frozen=True)
class ReadingOptions:
    """How to read a recording; None detects a value from the file. FileFormatError if unit or axis is not possible."""

    skeleton: Path | None = None  # the .asf file of an .amc recording, or the body model (.npz) of an .npz
    # Unit of the file: of length, m, such as 0.01 for a file in cm; of joint angles, rad.
    unit: float | None = None
    up: Up | None = None  # vertical axis of the file
    # New names of joints, bones or markers, by the names in the file.
    rename: Mapping[str, str] = field(default_factory=dict[str, str])
    person: str | None = None  # which one of several people in the file
    # The rate at which it was recorded, Hz, or "auto" to find held and missing frames; None and "none" keep the file's.
    rate: float | Literal["auto", "none"] | None = None
    # The height of its floor, m, or "auto" to find it where feet stand; None and "none" keep the file's.
    ground: float | Literal["auto", "none"] | None = None
    upper_body: bool = False  # whether a body without legs gets some that rest

    def __post_init__(self) -> None:
        if self.unit is not None and not (isinstance(self.unit, int | float) and 1e-6 < self.unit < 1e3):
            raise FileFormatError(
                f"a unit of {self.unit} m is not possible: give the length of one unit of the file in m, such as 0.01"
            )
        for what, value in (("a rate", self.rate), ("a ground", self.ground)):
            if isinstance(value, str) and value not in ("auto", "none"):
                raise FileFormatError(f"{what} of '{value}' is not possible: give a number, auto or none")
        if isinstance(self.rate, float | int) and not 1.0 <= self.rate <= 10_000.0:
            raise FileFormatError(f"a rate of {self.rate:g} Hz is not possible: give the true rate of the recording")
        if self.up not in (None, "y", "z"):
            raise FileFormatError(f"the axis '{self.up}' cannot be up: give y or z")

    def renamed(self, names: tuple[str, ...], path: str | Path) -> tuple[str, ...]:
        """The names after `rename` (FileFormatError if one to be replaced is missing, or two would be equal)."""
        missing = [old for old in self.rename if old not in names]
        if missing:
            raise FileFormatError(f"{path}: nothing to rename is called '{missing[0]}' (there are: {listed(names)}).")
        new = tuple(self.rename.get(name, name) for name in names)
        twice = next((name for index, name in enumerate(new) if name in new[:index]), None)
        if twice is not None:
            raise FileFormatError(f"{path}: '{twice}' would be the name of two. Rename the other one too.")
        return new

    def refuse(self, path: str | Path) -> None:
        """Raises FileFormatError if a unit, axis or name is given, for a format that fixes all three."""
        if self.unit is not None or self.up is not None or self.rename:
            raise FileFormatError(f"{path}: a {Path(path).suffix} has fixed unit, axes and names: omit the options.")


AS_FOUND = ReadingOptions()
"""Everything is detected from the file."""
Reader = Callable[[str | Path, ReadingOptions], Clip | Markers]


@dataclass(frozen=True, kw_only=True)
class Format:
    """One row of the list of formats; docs/formats.toml says in words what each reads."""

    suffixes: tuple[str, ...]  # in lower case
    read: Reader  # returns the clip, or the markers that a body is then fitted to
    magic: bytes = b""  # first bytes of every such file, by which a wrong suffix is recognised; may be empty
    matches: Callable[[Path], bool] = lambda _: True  # false for other files with one of the suffixes
    general: bool = False  # reads, or refuses with the reason, what no other format of its suffixes matches
