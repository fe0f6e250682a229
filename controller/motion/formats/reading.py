"""One way in for recordings: the reader is chosen by the file's name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from controller.motion.clip import Clip
from controller.motion.encodings.joint_angles import read_taught_clip
from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import read_asf
from controller.motion.formats.bvh import read_bvh
from controller.motion.formats.gltf import read_gltf
from controller.motion.formats.jaeger_patterns import read_pattern
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.markers.joint_points import joint_points
from controller.motion.formats.markers.jointed_body import jointed_body
from controller.motion.formats.markers.marker_fit import Fit, fit_markers, wears_full_set
from controller.motion.formats.markers.skin_markers import joints_under_skin
from controller.motion.formats.markers.tracks import Markers
from controller.motion.formats.markers.trc import read_trc
from controller.motion.formats.mvnx import read_mvnx
from controller.motion.formats.positions import is_table, read_positions
from controller.motion.formats.smpl import read_smpl
from controller.motion.reading_options import AS_FOUND, ReadingOptions
from controller.motion.up_axis import turned_up
from motiondeck_base.errors import FileFormatError

_TREES = {
    ".bvh": read_bvh,
    ".npz": read_smpl,
    ".mvnx": read_mvnx,
    **dict.fromkeys((".gltf", ".glb", ".vrm", ".vrma"), read_gltf),
}
_TABLES = {".c3d": read_c3d, ".trc": read_trc, ".csv": read_positions}
RECORDINGS = frozenset({".amc", ".mat", ".clip", *_TREES, *_TABLES})
"""The endings of the files that `read_clip` reads, in small letters."""
_PACKED = "packed. Unpack it, and give the recordings in it."
_INSTEAD = {
    ".asf": "a skeleton, not a motion. Give a recording that belongs to it (.amc).",
    ".fbx": "a closed format that is not read. Convert it with FBX2glTF (to .glb), or in Blender: import it, then "
    "File > Export > glTF 2.0 or Motion Capture (.bvh).",
    ".pkl": "holds Python objects, which are never loaded. Save its arrays as .npz: poses, trans, mocap_framerate.",
    ".blend": "Blender's own format. Export it there: File > Export > glTF 2.0 or Motion Capture (.bvh).",
    **dict.fromkeys((".zip", ".gz", ".xz", ".7z", ".rar", ".tar"), _PACKED),
    **dict.fromkeys(
        (".usd", ".usda", ".usdc", ".usdz", ".dae", ".abc"),
        "not read. Convert it in Blender: import it, then File > Export > glTF 2.0.",
    ),
    ".vmd": "MikuMikuDance's own format. Import it in Blender (MMD Tools) on its model, then File > Export > glTF 2.0.",
    ".bip": "3ds Max's own format. Load it on its biped, export FBX, and convert that with FBX2glTF (to .glb).",
    ".tak": "Motive's own format. Export it there as .c3d, .bvh or .trc.",
    ".mvn": "Xsens's own format. Export it there as .mvnx.",
    ".qtm": "Qualisys's own format. Export it there as .c3d.",
    ".tsv": "a table of Qualisys or others. Export the recording as .c3d or .trc.",
    **dict.fromkeys((".mot", ".sto"), "OpenSim's angles, which need its model. Give the markers (.trc or .c3d)."),
}
_MOSTLY_OTHERS = {".asf", ".dae", ".abc", ".tsv", ".mot", ".sto", ".qtm"}  # lie beside recordings: meshes, tables
CONVERTIBLE = frozenset(_INSTEAD) - _MOSTLY_OTHERS
"""The endings of recordings that `read_clip` refuses with the way to unpack or convert them, in small letters."""


@dataclass(frozen=True, eq=False)
class FittedClip:
    """A clip, and the fit to its markers where it came from markers on the skin."""

    clip: Clip
    fit: Fit | None


def read_clip(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The clip in a recording.

    Args:
        path: Acclaim (.amc), Biovision (.bvh), bodies of the SMPL family (.npz), Xsens (.mvnx), glTF and VRM (.gltf,
            .glb, .vrm, .vrma), markers or points in joints (.c3d, .trc), our own positions (.csv), what a rig was
            taught by hand (.clip) or one of Jaeger's MATLAB patterns (.mat); capitals do not matter.
        options: what overrules the file. Without a skeleton, an .amc takes the .asf that `skeleton_of` finds in its
            folder or the one above, and an .npz average proportions.

    Raises:
        FileFormatError: if the file is of another kind, its skeleton is not clear, or reading fails.
    """
    return read_fitted(path, options).clip


def read_fitted(path: str | Path, options: ReadingOptions = AS_FOUND) -> FittedClip:
    """As `read_clip`, which see, and how well the clip explains its markers."""
    suffix = Path(path).suffix.lower()
    if suffix in _TREES:
        return FittedClip(_TREES[suffix](path, options), None)
    if suffix in _TABLES:
        found = _TABLES[suffix](path, options)
        return FittedClip(found, None) if isinstance(found, Clip) else _of_markers(found, Path(path).stem)
    if suffix == ".amc":
        return FittedClip(_acclaim(path, options), None)
    if suffix in (".mat", ".clip"):
        _nothing_to_overrule(path, options)
        return FittedClip(read_pattern(path) if suffix == ".mat" else read_taught_clip(path), None)
    if suffix in _INSTEAD:
        raise FileFormatError(f"{path}: {_INSTEAD[suffix]}")
    ending = f"'{suffix}' files are not read" if suffix else "a recording is known by its ending, and this has none"
    raise FileFormatError(f"{path}: {ending}. Give one of {', '.join(sorted(RECORDINGS))}.")


def recordings_below(folder: Path) -> list[Path]:
    """The recordings in a folder and the folders in it; of tables (.csv) those that hold positions."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.suffix.lower() in RECORDINGS and path.is_file() and (path.suffix.lower() != ".csv" or is_table(path))
    )


def _of_markers(markers: Markers, name: str) -> FittedClip:
    """A body fitted to a full set of markers on its skin, or drawn through its joints."""
    joints = joint_points(markers)
    if not joints and not wears_full_set(markers):
        joints = joints_under_skin(markers)
    if joints:
        return FittedClip(jointed_body(joints, markers, name), None)
    fit = fit_markers(markers, name)
    return FittedClip(fit.clip, fit)


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
        raise FileFormatError.missing(path)
    asf = options.skeleton or skeleton_of(recording, recording.parent.parent)
    if asf is None:
        found = _skeletons(recording.parent)
        names = f"{len(found)} .asf files ({', '.join(other.name for other in found)})" if found else "no .asf files"
        raise FileFormatError(
            f"{path}: there are {names} beside it. Give the skeleton that it was recorded with (--skeleton FILE.asf)."
        )
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
