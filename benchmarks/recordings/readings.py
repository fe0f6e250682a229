"""Recordings against an independent reading of their files.

For each source (a folder, an actor) it prints how many files were read and

    joints      the farthest that a joint (for C3D a marker, for patterns a channel) is from the independent reading, mm
    carried     the largest angle between a bone on the canonical body and the line between the landmarks of the file
    path        by how much of it the way of the canonical root differs from that of the middle between the file's hips
    bvh         the farthest that a joint, mm, and a bone, degrees, is from where it was, written as BVH and read back
    csv         the same for positions, mm, and the farthest that a landmark of the canonical body is off then, mm
    root, hips  how high the file's root, and the middle between its hips, is when the person stands (9 frames of 10
                with a foot near the ground are lower), m: an .asf has its root a hand's breadth above the hips
    lacking     in how many files more than hands and toes was not found
    by shape    in how many files all limbs are found on the right side, when the names say nothing

    python -m benchmarks readings ../shared/data
"""

from __future__ import annotations

import tempfile
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import command
from benchmarks.recordings.independent_readings import (
    ACCLAIM,
    BANDAI,
    ENDS,
    ICLONE,
    MAX,
    MOTIONBUILDER,
    amc_joints,
    bvh_joints,
    c3d_points,
    landmarks,
    pattern_channels,
)
from controller.motion.canonical.canonical_body import CANONICAL_BONES, landmarks_of, to_canonical
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.encodings.bone_directions import BoneDirections
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.formats.writing import write_clip
from controller.motion.rotations import Array, normalise, rotate
from motiondeck_base.errors import MotiondeckError

SHORTEST = 1e-4  # m: shorter bones point nowhere in files of six digits
NEAR_GROUND = 0.06  # m
SEEN = 0.1  # m: a path shorter than this is no path
MAY_LACK = {"lfoo", "rfoo", "lhan", "rhan"}
CARRIERS = {"joint_Root", "RL_BoneRoot"}  # above the hips: on the floor, and no part of the body
SAME_LIMB = 0.03  # m: a landmark found by shape may be the end of a short bone beside it


@dataclass(frozen=True)
class Reading:
    """What was measured of one file; NaN where its format has no such thing."""

    joints_mm: float
    carried_degrees: float
    bvh_mm: float
    bvh_degrees: float
    csv_mm: float
    csv_carried_mm: float
    path: float
    root_stands: float
    hips_stand: float
    lacking: bool
    by_shape: bool


def independent(path: Path, clip: Clip, skeleton: Path | None) -> tuple[float, dict[str, Array] | None]:
    """How far the clip is from an independent reading, mm, and the landmarks that this has, in our axes, m."""
    match path.suffix.lower():
        case ".bvh":
            seen = bvh_joints(path.read_text())
            marks = {"joint_Root": BANDAI, "CC_Base": ICLONE, "LeftUpLeg": MOTIONBUILDER, "LeftHip": MAX}
            table = next(table for mark, table in marks.items() if any(mark in name for name in seen))
            unit = _unit_of(clip, seen)
        case ".amc":
            assert skeleton is not None
            seen = amc_joints(skeleton.read_text("latin-1"), path.read_text("latin-1"))
            table, unit = ACCLAIM, 1.0
        case ".c3d":
            off = np.abs(read_c3d(path).position * 1000.0 - c3d_points(path))
            return float(np.nanmax(off)), None
        case _:
            ours = BoneDirections(clip.skeleton).encode(clip)
            return 1000.0 * float(np.abs(ours - pattern_channels(path))[1:].max()), None
    seen = {name: unit * track[:, [2, 0, 1]] for name, track in seen.items()}
    joints = clip.joints()
    body = [track for name, track in seen.items() if name not in CARRIERS]
    farthest = max(float(np.linalg.norm(joints - track[:, None], axis=-1).max(axis=0).min()) for track in body)
    return 1000.0 * farthest, landmarks(seen, table)


def _unit_of(clip: Clip, seen: dict[str, Array]) -> float:
    """What one unit of a BVH is, m: of the usual ones, that in which the file is as large as the clip."""
    size = max(float(np.linalg.norm(a[0] - b[0])) for a in seen.values() for b in seen.values())
    ours = clip.joints()[0]
    own = max(float(np.linalg.norm(ours - joint, axis=-1).max()) for joint in ours)
    units = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)
    return min(units, key=lambda unit: abs(np.log(size * unit / own)))


def carried_degrees(own: Clip, seen: dict[str, Array]) -> float:
    """The largest angle of a carried bone to the line between the file's landmarks."""
    worst = 0.0
    for index, (bone, parent) in enumerate(zip(CANONICAL_BONES, own.skeleton.parent, strict=True)):
        start = "root" if parent < 0 else CANONICAL_BONES[parent]
        if bone in seen and start in seen:
            line = normalise(seen[bone] - seen[start])
            ours = rotate(own.rotation[:, 1 + index], own.skeleton.rest_direction[index])
            worst = max(worst, _degrees(line, ours))
    return worst


def path_differs(own: Clip, seen: dict[str, Array]) -> float:
    """By what share the way that a carried root goes on the ground differs from the hips' own."""
    ways = [_way(own.root_position), _way(seen["root"])]
    return abs(ways[0] - ways[1]) / ways[1] if ways[1] > SEEN else float("nan")


def _way(track: Array) -> float:
    return float(np.linalg.norm(np.diff(track[:, :2], axis=0), axis=-1).sum())


def _degrees(one: Array, other: Array) -> float:
    half = np.linalg.norm(one - other, axis=-1) / 2.0
    return float(np.degrees(2.0 * np.arcsin(np.clip(half, 0.0, 1.0))).max())


def written_and_back(clip: Clip, suffix: str) -> Clip:
    """A clip as another program would get it, read again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"back{suffix}"
        write_clip(clip, path)
        return read_clip(path)


def measured(path: Path, data: Path) -> Reading:
    """One file."""
    skeleton = skeleton_of(path, data)
    clip = read_clip(path, ReadingOptions(skeleton))
    joints_mm, seen = independent(path, clip, skeleton)
    bvh, csv = written_and_back(clip, ".bvh"), written_and_back(clip, ".csv")
    order = np.array([bvh.skeleton.index("_".join(bone.split())) for bone in clip.skeleton.bones])
    long = clip.skeleton.length > SHORTEST
    before = rotate(clip.rotation[:, 1:], clip.skeleton.rest_direction)[:, long]
    after = rotate(bvh.rotation[:, 1:], bvh.skeleton.rest_direction)[:, order[long]]
    low = clip.joints()[..., 2].min(axis=1)
    ground = np.quantile(low, 0.05)
    grounded = low - ground < NEAR_GROUND

    def stands(body: Clip) -> float:
        return float(np.quantile((body.root_position[:, 2] - ground)[grounded], 0.9))

    own = to_canonical(clip)
    lacking = set(landmarks_of(clip.skeleton).lacking)
    return Reading(
        joints_mm,
        carried_degrees(own, seen) if seen is not None else float("nan"),
        1000.0 * float(np.linalg.norm(bvh.joints()[:, [0, *(1 + order)]] - clip.joints(), axis=-1).max()),
        _degrees(before, after),
        1000.0 * float(np.linalg.norm(csv.joints() - clip.joints(), axis=-1).max()),
        1000.0 * float(np.linalg.norm(to_canonical(csv).joints() - own.joints(), axis=-1).max()),
        path_differs(own, seen) if seen is not None else float("nan"),
        stands(clip),
        stands(own),
        bool(lacking - MAY_LACK),
        found_by_shape(path, skeleton, clip),
    )


def found_by_shape(path: Path, skeleton: Path | None, clip: Clip) -> bool:
    """Whether limbs and their sides are found too if every joint is called joint1, joint2 and so on."""
    names = clip.skeleton.bones
    if path.suffix.lower() == ".bvh":
        every = list(bvh_joints(path.read_text(), slice(0, 1)))
        options = ReadingOptions(skeleton, rename={name: f"joint{number}" for number, name in enumerate(every)})
        try:
            other = read_clip(path, options)
        except MotiondeckError:
            return False
    else:
        other = replace(clip, skeleton=replace(clip.skeleton, bones=tuple(f"joint{n}" for n in range(len(names)))))
    try:
        one, two = to_canonical(clip).joints(), to_canonical(other).joints()
    except MotiondeckError:
        return False
    limbs = [1 + CANONICAL_BONES.index(side + end) for side in "lr" for end in ENDS[:3] + ENDS[4:7]]
    return bool((np.median(np.linalg.norm(one - two, axis=-1), axis=0)[limbs] < SAME_LIMB).all())


def source_of(path: Path, data: Path) -> str:
    """The folder of a file, or its actor."""
    folder = path.parent.relative_to(data)
    if folder.parts[:1] == ("hdm05",):
        return f"hdm05, actor {path.stem[4:6]}"
    return str(Path(*folder.parts[:2])) if folder.parts[:1] == ("bvh",) else folder.parts[0] if folder.parts else "."


def _most(values: Iterable[float]) -> float:
    """The largest that is a number; NaN where none is."""
    return max((value for value in values if not np.isnan(value)), default=float("nan"))


def main(data: Path) -> None:
    """Compare every recording of a folder with an independent reading of its file."""
    found: dict[str, list[Reading]] = defaultdict(list)
    unread: dict[str, list[str]] = defaultdict(list)
    for path in recordings_below(data):
        source = source_of(path, data)
        try:
            found[source].append(measured(path, data))
        except MotiondeckError as error:
            unread[source].append(str(error))
    heads = {"read": 9, "joints": 9, "carried": 9, "path": 9, "bvh": 16, "csv": 16, "root": 11, "hips": 11}
    heads |= {"lacking": 9, "by shape": 10}
    print(f"{'source':<20}" + "".join(f"{name:>{width}}" for name, width in heads.items()))
    for source in sorted({*found, *unread}):
        rows = found[source]
        cells = [f"{len(rows)} of {len(rows) + len(unread[source])}"]
        if rows:
            worst = {name: _most(getattr(row, name) for row in rows) for name in Reading.__annotations__}
            cells += [f"{worst[name]:.1e}" for name in ("joints_mm", "carried_degrees", "path")]
            cells += [
                f"{worst['bvh_mm']:.1e} {worst['bvh_degrees']:.1e}",
                f"{worst['csv_mm']:.1e} {worst['csv_carried_mm']:.1e}",
            ]
            for stands in ([row.root_stands for row in rows], [row.hips_stand for row in rows]):
                cells += [f"{min(stands):.2f}-{max(stands):.2f}"]
            cells += [str(sum(row.lacking for row in rows)), str(sum(row.by_shape for row in rows))]
        print(f"{source:<20}" + "".join(f"{cell:>{width}}" for cell, width in zip(cells, heads.values(), strict=False)))
    for source, lines in unread.items():
        for line in lines:
            print(f"{source}: not read: {line}")


if __name__ == "__main__":
    command.run("readings", main)
