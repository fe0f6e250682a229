"""How far joints of one actor are off when carried to one body.

Recordings below a folder are grouped by actor (equal limbs). Each is carried to the actor's body; wrists, feet and the
base of the neck are compared in the world with the recording's own joints.

    python -m benchmarks one_body ../shared/data
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from controller.motion.canonical.actors import actors_of
from controller.motion.canonical.canonical_body import CANONICAL_BONES, carried, landmark_places
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip, recordings_below
from motiondeck_base.errors import MotiondeckError

JOINTS = {"wrists": ("lwri", "rwri"), "feet": ("lfoo", "rfoo"), "neck": ("neck",)}
SHARE = 95


def off(clip: Clip, moved: Clip, joints: tuple[str, ...]) -> float:
    """How far joints are off in 95 % of the frames, mm, the farther side."""
    at = [1 + CANONICAL_BONES.index(joint) for joint in joints]
    away = np.linalg.norm(landmark_places(clip)[0][:, at] - moved.joints()[:, at], axis=-1)
    return 1000.0 * float(np.percentile(away.max(axis=1), SHARE))


def main(data: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of recordings.")]) -> None:
    """Print for each source, by median and worst recording, how far joints are off on their actor's body."""
    clips: dict[str, dict[str, Clip]] = defaultdict(dict)
    for path in recordings_below(data):
        try:
            clip = read_clip(path, ReadingOptions(skeleton_of(path, path.parent.parent)))
        except MotiondeckError:
            continue
        clips[path.relative_to(data).parts[0]][str(path)] = clip
    for source, own in clips.items():
        actors = actors_of(own)
        rows = [
            [off(own[name], carried(own[name], actor.body), joints) for joints in JOINTS.values()]
            for actor in actors
            for name in actor.motions
        ]
        found = zip(JOINTS, np.median(rows, axis=0), np.max(rows, axis=0), strict=True)
        print(
            f"{source}: {len(rows)} recordings of {len(actors)} actors, mm, median / worst: "
            + ", ".join(f"{joint} {median:.1f} / {worst:.1f}" for joint, median, worst in found)
        )


if __name__ == "__main__":
    command.run("one_body", main)
