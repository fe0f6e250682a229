"""Reads recordings of any format; the suffix of the file selects the format."""

import importlib
import pkgutil
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from controller.motion.clip import AS_FOUND, Clip, Format, Markers, ReadingOptions
from controller.motion.formats.markers.joint_points import joint_points, jointed_body
from controller.motion.formats.markers.marker_fit import Fit, fit_markers, wears_full_set
from controller.motion.formats.markers.skin_markers import joints_under_skin
from controller.motion.joint_tree import chosen_person
from controller.motion.take.steps import taken
from motiondeck_base.arrays_on_disk import on_disk, release
from motiondeck_base.errors import FileFormatError, MotiondeckError

_MODULES = [one.name for one in pkgutil.walk_packages([str(Path(__file__).parent)], "controller.motion.formats.")]
_FOUND = [getattr(importlib.import_module(name), "FORMAT", None) for name in _MODULES]
FORMATS: dict[str, list[Format]] = {}
"""The formats of recordings, by suffix in lower case; the last one is given files that none matches."""
for _row in sorted((row for row in _FOUND if isinstance(row, Format)), key=lambda row: (row.general, row.suffixes)):
    for _suffix in _row.suffixes:
        FORMATS.setdefault(_suffix, []).append(_row)
LARGE = 4_000_000  # bytes of rotations; larger ones lie in a file, and in memory as far as they are used
_REMEDIES: dict[str, str] = tomllib.loads(Path(__file__).with_name("unread.toml").read_text(encoding="utf-8"))
_UNREAD = {suffix: remedy for suffixes, remedy in _REMEDIES.items() for suffix in suffixes.split()}
_SELDOM_MOTION = {".asf", ".dae", ".abc", ".tsv", ".mot", ".sto", ".qtm", ".pt", ".pth", ".pickle", ".joblib"}
CONVERTIBLE = frozenset(_UNREAD) - _SELDOM_MOTION - FORMATS.keys()
"""Suffixes of recordings that `read_clip` refuses with a hint how to unpack or convert them."""


@dataclass(frozen=True, eq=False)
class FittedClip:
    """A clip, and the fit to its markers if it came from markers on the skin."""

    clip: Clip
    fit: Fit | None


def read_clip(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The clip in a recording of one of FORMATS; FileFormatError for another, an ambiguous skeleton, or a failure."""
    return read_fitted(path, options).clip


def read_fitted(path: str | Path, options: ReadingOptions = AS_FOUND) -> FittedClip:
    """As `read_clip`, with the fit to the markers."""
    found, fit = read_as_stored(path, options), None
    if isinstance(found, Markers):
        if len(people := _people_in(found)) > 1:
            name = chosen_person(path, people, options.person)
            found = _of_person(found, name, people[name])
        found, fit = _body_of_markers(found, Path(path).stem)
    if options.person is not None:
        found = replace(found, skeleton=replace(found.skeleton, name=f"{found.skeleton.name}-{options.person}"))
    found = _on_disk(found)
    return FittedClip(_on_disk(taken(found, options)), fit)


def _on_disk(clip: Clip) -> Clip:
    if clip.rotation.nbytes > LARGE:
        clip = replace(clip, root_position=on_disk(clip.root_position), rotation=on_disk(clip.rotation))
        release()
    return clip


def read_as_stored(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip | Markers:
    """What a recording holds, as `read_clip` reads it: points are not yet a body."""
    suffix = Path(path).suffix.lower()
    rows = FORMATS.get(suffix, [])
    shared = rows if len(rows) > 1 and Path(path).is_file() else []
    row = next((one for one in shared if one.matches(Path(path))), rows[-1] if rows else None)
    if row is None and suffix in _UNREAD:
        raise FileFormatError(f"{path}: {_UNREAD[suffix]}")
    if (other := _format_by_content(Path(path))) and other is not row:
        raise FileFormatError(f"{path}: begins as a {other.suffixes[0]} file. Rename it, or fetch it again.")
    if row is None:
        ending = f"'{suffix}' files are not read" if suffix else "a recording is known by its ending, and this has none"
        raise FileFormatError(f"{path}: {ending}. Give one of {', '.join(sorted(FORMATS))}.")
    return row.read(path, options)


def recordings_below(folder: Path) -> list[Path]:
    """The recordings in a folder and its subfolders; of tables and arrays those that hold a motion."""
    files = (path for path in folder.rglob("*") if path.suffix.lower() in FORMATS and path.is_file())
    return sorted(path for path in files if any(row.matches(path) for row in FORMATS[path.suffix.lower()]))


def recordings_in(paths: Iterable[Path], convertible: bool = False) -> list[Path]:
    """Files, and the recordings in folders and below, without repetitions; last those that must be converted, if asked.

    MotiondeckError if a path does not exist, or there is no recording.
    """
    paths = list(paths)
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += recordings_below(path)
            if convertible:
                found += sorted(one for one in path.rglob("*") if one.suffix.lower() in CONVERTIBLE and one.is_file())
        elif path.exists():
            found.append(path)
        else:
            raise MotiondeckError.missing(path, "file or folder")
    if not found:
        where = ", ".join(map(str, paths)) or "nothing was given"
        raise MotiondeckError(f"{where}: no recording found. Recordings end in {', '.join(sorted(FORMATS))}.")
    return list(dict.fromkeys(found))


def _format_by_content(path: Path) -> Format | None:
    """The format of a file by its first bytes; None also for a pipe, which can be read only once."""
    if not path.is_file():
        return None
    try:
        with path.open("rb") as file:
            beginning = file.read(64).lstrip()
    except (OSError, ValueError):
        return None  # the reader says why
    rows = chain.from_iterable(FORMATS.values())
    return next((row for row in rows if row.magic and beginning.startswith(row.magic)), None)


def _people_in(markers: Markers) -> dict[str, list[int]]:
    """The markers of each person whose labels begin alike, such as "Anna:LKNE" and "Ben:LKNE"."""
    found: dict[str, list[int]] = {}
    for between in (":", "_", "|", ".", "-", " "):
        begins = [label.partition(between)[0] if between in label else "" for label in markers.labels]
        for name in dict.fromkeys(filter(None, begins)):
            own = [index for index, begin in enumerate(begins) if begin == name]
            part = _of_person(markers, name, own)
            if joint_points(part) or wears_full_set(part) or joints_under_skin(part):
                found[name] = own
        if found:
            break
    return found


def _of_person(markers: Markers, name: str, own: list[int]) -> Markers:
    labels = tuple(markers.labels[index][len(name) + 1 :] for index in own)
    return replace(markers, labels=labels, position=markers.position[:, own])


def _body_of_markers(markers: Markers, name: str) -> tuple[Clip, Fit | None]:
    """A body fitted to a full set of markers on its skin, or drawn through its joints."""
    joints = joint_points(markers)
    if not joints and not wears_full_set(markers):
        joints = joints_under_skin(markers)
    if joints:
        return jointed_body(joints, markers, name), None
    fit = fit_markers(markers, name)
    return fit.clip, fit
