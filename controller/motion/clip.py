"""Recordings: clips of a skeleton, markers to which one is fitted, what was decided about them, and how they are read.

A format is a module of the folder `formats` that defines its row FORMAT. Readers raise FileFormatError, naming the file
and where possible the line, if it cannot be read or is broken.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from controller.motion.rotations import Array, Flags, Indices, rotate
from controller.motion.skeleton import Pose, Posture, Skeleton, walk_path
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

Plays = Literal["loop", "once"]
"""Whether a motion repeats, or ends in a pose and holds it."""
Up = Literal["y", "z"]  # the vertical axis of a file
Step = Literal["people", "body", "unit", "up axis", "rate", "ground", "cuts", "kind", "ends"]
_UNITS = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inches", 0.0254 / 0.45: "inches / 0.45 (CMU's)", 0.3048: "feet"}
UNITS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "ft": 0.3048}
"""Names of units in marker files, m."""
ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
"""Units of angles, rad."""
TALL = 1.6  # m: from the lowest to the highest point on a standing person
FARTHEST = 1e4  # m: a point beyond is a broken number
MOST_NUMBERS = 30_000_000  # of a recording


@dataclass(frozen=True)
class Decision:
    """One step's decision about a recording."""

    step: Step
    decided: str  # in words
    evidence: str  # the figures that it rests on
    overrule: str  # the option or the key of a recipe that overrules it
    notable: bool = False  # something was changed or is doubtful, so that reports of many recordings show it

    def __str__(self) -> str:
        remedy = f"; otherwise: {self.overrule}" if self.overrule else ""
        return f"{self.step}: {self.decided} ({self.evidence}{remedy})"


def unit_name(unit: float) -> str:
    """The name of a unit of length in m."""
    return _UNITS.get(unit, f"{unit:g} m")


def unit_decision(unit: float, other: float | None, leg: float, given: float | None, fixed: float | None) -> Decision:
    """Of a file's unit, m, with a leg of `leg` m, `given` by option or `fixed` by the format; `other` fits too."""
    why = "as given" if given else "the format's" if fixed else f"a leg is then {leg:.2f} m long"
    if other is not None:
        why += f"; in {unit_name(other)} it is {leg * other / unit:.2f} m, which fits too"
    remedy = "--unit METRES" if other is None else f"--unit {other:.4g}"
    return Decision("unit", unit_name(unit), why, remedy, notable=other is not None)


def up_decision(up: str, given: str | None, fixed: str | None) -> Decision:
    """The decision about the vertical axis of a file."""
    why = "as given" if given else "the format's" if fixed else "the body stands along it and touches the ground"
    return Decision("up axis", up, why, "--up y or z")


@dataclass(frozen=True, eq=False)
class Clip:
    """One recorded motion at a constant rate: T frames of a skeleton with B bones.

    FileFormatError if shapes disagree, a number is not finite, the rate is not positive, or there are no frames.
    """

    name: str
    skeleton: Skeleton
    rate: float  # frames per second, Hz
    root_position: Array  # shape (T, 3), m; z up
    rotation: Array  # the world rotation of the root and of each bone, shape (T, 1 + B, 4)
    source: str = ""  # file name, for provenance
    decisions: tuple[Decision, ...] = ()  # what was decided while it was read
    plays: Plays | None = None  # how it plays, where its file says so

    def __post_init__(self) -> None:
        frames = len(self.root_position)
        expected = ((frames, 3), (frames, 1 + len(self.skeleton), 4))
        if frames == 0 or (self.root_position.shape, self.rotation.shape) != expected:
            raise FileFormatError(
                f"clip '{self.name}': arrays of shape {self.root_position.shape} and {self.rotation.shape} "
                f"do not hold frames of {len(self.skeleton)} bones"
            )
        if not (np.isfinite(self.rate) and self.rate > 0.0):
            raise FileFormatError(f"clip '{self.name}': a rate of {self.rate} frames per second is not possible")
        if not (np.isfinite(self.root_position).all() and np.isfinite(self.rotation).all()):
            raise FileFormatError(f"clip '{self.name}' holds a number that is not finite")

    def __len__(self) -> int:
        return len(self.root_position)

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the end of the last."""
        return len(self) / self.rate

    def joints(self) -> Array:
        """Joint positions, the root first, shape (T, 1 + B, 3), m."""
        return self.skeleton.joints(self.root_position, self.rotation)

    def heading(self) -> Array:
        """The heading of the root, shape (T,), rad: its forward axis, projected onto the floor."""
        forward = rotate(self.rotation[:, 0], np.array([1.0, 0.0, 0.0]))
        return np.arctan2(forward[:, 1], forward[:, 0])


@dataclass(frozen=True, eq=False)
class Markers:
    """T frames of M points."""

    labels: tuple[str, ...]
    rate: float  # Hz
    position: Array  # (T, M, 3), m, in the axes of the file; NaN where a point was not seen
    up: str | None  # vertical axis of the file, "x", "y" or "z"; None if unknown
    source: str  # name of the file


def unit_of_size(position: Array) -> float:
    """The unit, m, mm or cm, in which points (T, M, 3), NaN where not seen, have the size of a person."""
    # Judged by the median frame; millimetres if no two points were seen.
    there = np.isfinite(position)
    highest = np.where(there, position, -np.inf).max(axis=1)
    lowest = np.where(there, position, np.inf).min(axis=1)
    size = (highest - lowest).max(axis=-1)
    size = size[np.isfinite(size) & (size > 0.0)]
    if len(size) == 0:
        return UNITS["mm"]
    return min((UNITS[unit] for unit in ("mm", "cm", "m")), key=lambda unit: abs(np.log(np.median(size) * unit / TALL)))


def bridged(track: Array) -> Array:
    """A track (T, C), seen at least once, with its gaps interpolated linearly."""
    there = np.flatnonzero(~np.isnan(track[:, 0]))
    return track if len(there) == len(track) else between_rows(track[there], there, np.arange(len(track)))


def between_rows(rows: Array, known: Array | Indices, at: Array | Indices) -> Array:
    """Rows (K, C) that are known at rising times (K,), interpolated linearly at times (T,), shape (T, C)."""
    return np.stack([np.interp(at, known, column) for column in rows.T], axis=-1)


CUBIC: Array = 0.5 * np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]], dtype=np.float64)
"""Catmull-Rom, slopes (p2 - p0) / 2 at p1 and (p3 - p1) / 2 at p2: rows have weights of p0 .. p3 for 1, u, u^2, u^3."""


def nearest(place: float) -> int:
    """The nearest whole number; the next one also just below halfway, so that rounding errors choose nothing."""
    return math.floor(place + 0.50013)


def between_frames(frames: Array, at: Array) -> Array:
    """Frames (T, C), interpolated by CUBIC at times (S,), counted in frames; constant beyond both ends."""
    low = np.floor(at)
    near = (low[:, None] + np.arange(-1.0, 3.0)).clip(0, len(frames) - 1).astype(np.int64)
    weights = (at - low)[:, None] ** np.arange(4.0) @ CUBIC
    return np.matmul(weights[:, None], frames[near])[:, 0]


def runs(flags: Flags) -> list[tuple[int, int]]:
    """The runs (first, end) of set flags (K,)."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(first), int(end)) for first, end in change.reshape(-1, 2)]


def poses_of(clip: Clip) -> Iterator[Pose]:
    """The frames of a clip; the heading is in the rotation of the root."""
    heading = np.zeros(())
    return (Pose(place, heading, turn) for place, turn in zip(clip.root_position, clip.rotation, strict=True))


def walked_clip(name: str, skeleton: Skeleton, posture: Posture, rate: float, source: str = "") -> Clip:
    """The clip of postures at a rate, Hz, that starts at the origin."""
    pose = walk_path(posture, 1.0 / rate)
    return Clip(name, skeleton, rate, pose.root_position, pose.rotation, source)


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
