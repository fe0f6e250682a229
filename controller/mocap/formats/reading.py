"""One way in for recordings: the reader is chosen by the file's name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from controller.mocap.clip import Clip
from controller.mocap.encodings.joint_angles import read_taught_clip
from controller.mocap.formats.acclaim.amc import read_amc
from controller.mocap.formats.acclaim.asf import read_asf
from controller.mocap.formats.bvh import read_bvh
from controller.mocap.formats.jaeger_patterns import read_pattern
from controller.mocap.formats.markers.c3d import read_c3d
from controller.mocap.formats.markers.marker_fit import fit_markers
from controller.mocap.reading_options import AS_FOUND, ReadingOptions
from controller.mocap.rest_pose import turned_up
from motiondeck_base.errors import FileFormatError

RECORDINGS = frozenset({".amc", ".bvh", ".c3d", ".clip", ".mat"})
"""The endings of the files that `read_clip` reads, in small letters."""


def read_clip(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The clip in a recording.

    Args:
        path: an Acclaim recording (.amc), a Biovision one (.bvh), markers on a body (.c3d), what a rig was taught by
            hand (.clip) or one of Jaeger's MATLAB patterns (.mat); capitals do not matter.
        options: what overrules the file. Without a skeleton, an .amc takes the .asf that `skeleton_of` finds in its
            folder or the one above.

    Raises:
        FileFormatError: if the file is of another kind, its skeleton is not clear, or reading fails.
    """
    match Path(path).suffix.lower():
        case ".bvh":
            return read_bvh(path, options)
        case ".c3d":
            return fit_markers(read_c3d(path, options), Path(path).stem).clip
        case ".amc":
            return _acclaim(path, options)
        case ".mat":
            _nothing_to_overrule(path, options)
            return read_pattern(path)
        case ".clip":
            _nothing_to_overrule(path, options)
            return read_taught_clip(path)
        case ".asf":
            raise FileFormatError(f"{path}: a skeleton, not a motion. Give a recording that belongs to it (.amc).")
        case ".fbx":
            raise FileFormatError(
                f"{path}: .fbx is a closed format that is not read. Export it from Blender (File > Export > Motion "
                "Capture) as .bvh, and read that."
            )
        case suffix:
            raise FileFormatError(
                f"{path}: no reader for '{suffix}' files. Supported are .amc (Acclaim, with its .asf), .bvh "
                "(Biovision), .c3d (markers), .clip (taught by hand) and .mat (Jaeger's patterns)."
            )


def skeleton_of(recording: Path, top: Path) -> Path | None:
    """The .asf file of a recording, looked for from its folder up to `top`; None where there is none or no need."""
    if recording.suffix.lower() != ".amc":
        return None
    folder = recording.parent
    while True:
        there = _skeletons(folder)
        named = [p for p in there if recording.stem.startswith(p.stem)]
        if named:
            return max(named, key=lambda p: len(p.stem))
        if len(there) == 1:
            return there[0]
        if folder in (top, folder.parent):
            return None
        folder = folder.parent


def _acclaim(path: str | Path, options: ReadingOptions) -> Clip:
    """An .amc with its own or the given skeleton."""
    recording = Path(path)
    if not options.skeleton and not recording.exists():
        raise FileFormatError(f"{path}: there is no such file. Check the name.")
    asf = options.skeleton or skeleton_of(recording, recording.parent.parent)
    if asf is None:
        found = _skeletons(recording.parent)
        names = f"{len(found)} .asf files ({', '.join(other.name for other in found)})" if found else "no .asf files"
        raise FileFormatError(f"{path}: there are {names} beside it. Give the skeleton it was recorded with.")
    skeleton = read_asf(asf, options.unit)
    clip = read_amc(path, skeleton)
    bones = options.renamed(clip.skeleton.bones, path)
    clip = replace(clip, skeleton=replace(clip.skeleton, bones=bones))
    return clip if options.up is None else turned_up(clip, "y", options.up)


def _skeletons(folder: Path) -> list[Path]:
    """The .asf files in a folder."""
    try:
        return sorted(p for p in folder.iterdir() if p.suffix.lower() == ".asf")
    except OSError as error:
        raise FileFormatError(f"{folder}: cannot be read ({error.strerror or error}). Give the skeleton.") from None


def _nothing_to_overrule(path: str | Path, options: ReadingOptions) -> None:
    """Raises FileFormatError for options that mean nothing to a file of this kind."""
    if options.unit is not None or options.up is not None or options.rename:
        raise FileFormatError(f"{path}: a {Path(path).suffix} has its unit, axes and names: leave the options away.")
