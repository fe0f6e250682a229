"""One way in for recordings: the reader is chosen by the file's name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from controller.mocap.clip import Clip
from controller.mocap.encodings.joint_angles import read_taught_clip
from controller.mocap.formats.amc import read_amc
from controller.mocap.formats.asf import read_asf
from controller.mocap.formats.bvh import read_bvh
from controller.mocap.formats.c3d import read_c3d
from controller.mocap.formats.jaeger_patterns import read_pattern
from controller.mocap.formats.marker_fit import fit_markers
from controller.mocap.rest_pose import Up
from motiondeck_base.errors import FileFormatError

RECORDINGS = frozenset({".amc", ".bvh", ".c3d", ".clip", ".mat"})
"""The endings of the files that `read_clip` reads, in small letters."""


def read_clip(
    path: str | Path,
    skeleton: str | Path | None = None,
    *,
    unit: float | None = None,
    up: Up | None = None,
    rename: Mapping[str, str] = MappingProxyType({}),
) -> Clip:
    """The clip in a recording.

    Args:
        path: an Acclaim recording (.amc), a Biovision one (.bvh), markers on a body (.c3d), what a rig was taught by
            hand (.clip) or one of Jaeger's MATLAB patterns (.mat); capitals do not matter.
        skeleton: for .amc, the .asf file it belongs to; None takes the only one in the same folder.
        unit: for .bvh, what one of its lengths is, m; None finds out.
        up: for .bvh, its axis that is up; None finds out.
        rename: for .amc and .bvh, other names for bones or joints, by the names in the file.

    Raises:
        FileFormatError: if the file is of another kind, its skeleton is not clear, or reading fails.
    """
    match Path(path).suffix.lower():
        case ".mat":
            return read_pattern(path)
        case ".bvh":
            return read_bvh(path, unit, up, rename)
        case ".c3d":
            return fit_markers(read_c3d(path), Path(path).stem).clip
        case ".amc":
            clip = read_amc(path, read_asf(skeleton or _only_skeleton_beside(path)))
            bones = tuple(rename.get(bone, bone) for bone in clip.skeleton.bones)
            return replace(clip, skeleton=replace(clip.skeleton, bones=bones)) if rename else clip
        case ".clip":
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
        try:
            there = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".asf")
        except OSError as error:
            raise FileFormatError(f"{folder}: cannot be read ({error.strerror or error}).") from None
        named = [p for p in there if recording.stem.startswith(p.stem)]
        if named:
            return max(named, key=lambda p: len(p.stem))
        if len(there) == 1:
            return there[0]
        if folder in (top, folder.parent):
            return None
        folder = folder.parent


def _only_skeleton_beside(path: str | Path) -> Path:
    """The one .asf file in the folder of a recording."""
    if not Path(path).exists():
        raise FileFormatError(f"{path}: there is no such file. Check the name.")
    try:
        found = sorted(other for other in Path(path).parent.iterdir() if other.suffix.lower() == ".asf")
    except OSError as error:
        raise FileFormatError(f"{path}: its folder cannot be read ({error.strerror}). Give the skeleton.") from error
    if len(found) != 1:
        names = f"{len(found)} .asf files ({', '.join(other.name for other in found)})" if found else "no .asf files"
        raise FileFormatError(f"{path}: there are {names} beside it. Give the skeleton it was recorded with.")
    return found[0]
