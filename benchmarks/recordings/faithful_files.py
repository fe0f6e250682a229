"""Files as the judge of `faithful` reads them: whose they are, and where their landmarks were.

Nothing here is shared with the product: readers are those of `independent_readings`, and actors come from file names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
from numpy.typing import NDArray

from benchmarks.recordings.independent_readings import (
    ACCLAIM,
    BANDAI,
    ICLONE,
    MAX,
    MOTIONBUILDER,
    amc_joints,
    bvh_joints,
    landmarks,
    pattern_channels,
)

Array = NDArray[np.float64]

# Source, and actor: a pattern of the path below the data, and a template of its groups.
RULES: tuple[tuple[str, str, str], ...] = (
    ("HDM05", r"HDM_(\w\w)_[^/]*\.amc$", r"\1"),
    ("CMU", r"(?:^|/)(\d+)_\d+[^/]*\.amc$", r"\1"),
    ("Bandai", r"(?:^|/)bandai/[^/]*\.bvh$", "bandai"),
    ("BVH", r"([^/]*?)_?cmu_(\d+)_\d+[^/]*\.bvh$", r"\1-\2"),
    ("BVH", r"([^/]*)\.bvh$", r"\1"),
    ("thesis", r"nnRawBox\d\.mat$", "15"),
    ("thesis", r"nnRawCartWheel\.mat$", "49"),
    ("thesis", r"nnRaw(?:Crawl|Getdown|Standup)\.mat$", "133"),
    ("thesis", r"nnRaw(?:ExaStride|SlowWalk|Walk)\.mat$", "08"),
    ("thesis", r"nnRaw(?:GetSeated|Sitting|StandupFromStool)\.mat$", "13"),
    ("thesis", r"nnRaw(\w+)\.mat$", r"\1"),
    ("C3D", r"(\d\d)[^/]*\.c3d$", r"\1"),
)
UNITS = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)  # m, of a BVH
USUAL_LEG = 0.85  # m, by which the unit of a BVH is told
PATTERN_RATE = ACCLAIM_RATE = 120.0  # Hz; neither file holds it
# The bones of Jaeger's patterns, in their order: each with the one that it hangs from.
PATTERN_BONES = {
    "rhip": "root",
    "rkne": "rhip",
    "rank": "rkne",
    "rfoo": "rank",
    "lhip": "root",
    "lkne": "lhip",
    "lank": "lkne",
    "lfoo": "lank",
    "back": "root",
    "neck": "back",
    "head": "neck",
    "rsho": "neck",
    "relb": "rsho",
    "rwri": "relb",
    "rhan": "rwri",
    "lsho": "neck",
    "lelb": "lsho",
    "lwri": "lelb",
    "lhan": "lwri",
}


@dataclass(frozen=True)
class Recorded:
    """Where the landmarks of a file were: of each canonical bone, shape (T, 3), m, z up; "root" is between the hips."""

    places: dict[str, Array]
    rate: float  # Hz


def source_and_actor(path: Path, data: Path) -> tuple[str, str] | None:
    """Where a recording comes from, and whose it is; None if no rule knows."""
    below = path.relative_to(data).as_posix()
    for source, pattern, actor in RULES:
        if (found := re.search(pattern, below, re.IGNORECASE)) is not None:
            return source, found.expand(actor).lower()
    return None


def recorded(path: Path) -> Recorded:
    """A file's landmarks; ValueError if this judge has no table for its joints."""
    match path.suffix.lower():
        case ".amc":
            return _acclaim(path)
        case ".bvh":
            return _bvh(path)
        case ".mat":
            return _pattern(path)
        case ending:
            raise ValueError(f"no independent reading of {ending} files gives joints")


def _acclaim(path: Path) -> Recorded:
    skeletons = [*path.parent.glob("*.asf"), *path.parent.parent.glob("*.asf")]
    own = [one for one in skeletons if path.stem.startswith(one.stem)]
    if not own:
        raise ValueError("no .asf beside it")
    joints = amc_joints(own[0].read_text("latin-1"), path.read_text("latin-1"))
    joints = {name: track[:, [2, 0, 1]] for name, track in joints.items()}
    return Recorded(landmarks(joints, ACCLAIM), ACCLAIM_RATE)


def _bvh(path: Path) -> Recorded:
    text = path.read_text()
    joints = bvh_joints(text)
    marks = {"joint_Root": BANDAI, "CC_Base": ICLONE, "LeftUpLeg": MOTIONBUILDER, "LeftHip": MAX}
    table = next((table for mark, table in marks.items() if any(mark in name for name in joints)), None)
    if table is None:
        raise ValueError("no table for the names of its joints")
    frame_time = re.search(r"Frame\s+Time:\s*(\S+)", text)
    assert frame_time is not None
    places = landmarks({name: track[:, [2, 0, 1]] for name, track in joints.items()}, table)
    leg = leg_length(places)
    unit = min(UNITS, key=lambda unit: abs(np.log(leg * unit / USUAL_LEG)))
    return Recorded({bone: unit * track for bone, track in places.items()}, 1.0 / float(frame_time[1]))


def _pattern(path: Path) -> Recorded:
    channels = pattern_channels(path)
    length = 0.001 * next(v for k, v in scipy.io.loadmat(path).items() if k.startswith("segLengths")).ravel()
    turn = np.cumsum(channels[:, 1]) / PATTERN_RATE
    cos, sin = np.cos(turn), np.sin(turn)
    step = channels[:, 2:4] / PATTERN_RATE
    path_xy = np.cumsum(np.stack([cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], 1), axis=0)
    places = {"root": np.column_stack([path_xy, channels[:, 0]])}
    for index, (bone, above) in enumerate(PATTERN_BONES.items()):
        x, y, z = channels[:, 4 + 3 * index : 7 + 3 * index].T
        places[bone] = places[above] + length[index] * np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
    return Recorded(places, PATTERN_RATE)


def leg_length(places: dict[str, Array]) -> float:
    """Thigh and shank, the mean of both legs, of each the median over the frames."""
    legs = [
        np.median(np.linalg.norm(places[f"{side}{a}"] - places[f"{side}{b}"], axis=-1))
        for side in "lr"
        for a, b in (("hip", "kne"), ("kne", "ank"))
    ]
    return float(sum(legs)) / 2.0
