"""Recordings written as odd files: read right, doubted, refused or misread.

Each recording is written in every kind of `odd_kinds` with scipy alone, so that the truth is known, and read again. Of
each it prints, one letter a recording,

    r   right: limbs point within 1 degree of the truth in every frame that was not spoilt, the hips are within 2 cm,
        frames and rate are right, and the body is on the ground or said not to be
    R   the same, with a doubt
    d   not right, but a doubt says that something is wrong
    x   refused
    M   misread without a word

then what `learn` makes of the first one (motion, "left out" or refused), and the first doubt or refusal.

    python -m benchmarks odd_files ../shared/data
    python -m benchmarks odd_files ../shared/data --of 35/35_01 --only pose
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.recordings.odd_bodies import of_acclaim
from benchmarks.recordings.odd_kinds import KINDS, Written
from controller.learning.learn import learn
from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import CANONICAL_BONES, to_canonical
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import normalise, rotate
from motiondeck_base.errors import MotiondeckError

CHOSEN_ON = "08/08_01,16/16_01"
OTHERS = "02/02_01,35/35_01,10/10_02,86/86_01"
FRAMES = 240  # of each recording
SAME_WAY, SAME_PLACE = 1.0, 0.02  # degrees, m
ON_GROUND = (-0.15, 0.25)  # m: the lowest joint in the middle of the recording


def limbs_off(own: Clip, truth: dict[str, np.ndarray], frames: slice) -> float:
    """The largest angle of a limb to the true one, degrees."""
    worst = 0.0
    for index, (bone, parent) in enumerate(zip(CANONICAL_BONES, own.skeleton.parent, strict=True)):
        start = "root" if parent < 0 else CANONICAL_BONES[parent]
        if bone in truth and start in truth:
            line = normalise(truth[bone] - truth[start])[frames]
            ours = rotate(own.rotation[:, 1 + index], own.skeleton.rest_direction[index])[frames]
            half = np.linalg.norm(line - ours, axis=-1) / 2.0
            worst = max(worst, float(np.degrees(2.0 * np.arcsin(np.clip(half, 0.0, 1.0))).max()))
    return worst


def judged(written: Written, path: Path) -> tuple[str, str]:
    """The letter of a file that was written, and the first doubt or the refusal."""
    path.write_bytes(written.content)
    try:
        clip = read_clip(path)
        own = to_canonical(clip)
    except MotiondeckError as error:
        return "x", str(error).replace(f"{path}", path.name)
    said = doubts(clip)
    truth = written.body.landmarks()
    right = len(own) == len(truth["root"]) and abs(own.rate / written.body.rate - 1.0) < 0.005
    if right:
        away = float(np.abs(own.root_position - truth["root"])[written.frames].max())
        right = limbs_off(own, truth, written.frames) < SAME_WAY and (away < SAME_PLACE or not written.well_placed)
    low = float(np.median(own.joints()[..., 2].min(axis=1)))
    right = right and (bool(said) or ON_GROUND[0] < low < ON_GROUND[1])
    return ("R" if said else "r") if right else ("d" if said else "M"), said[0] if said else ""


def learned(path: Path) -> str:
    """What `learn` makes of a file."""
    try:
        (motion,) = learn([path], "odd").motions
    except MotiondeckError:
        return "refused"
    return f"{motion.plays} {motion.info.error_mm:.1f} mm" if motion.passed and motion.info else "left out"


def main(
    data: Path,
    of: Annotated[str, typer.Option(help="Recordings of CMU, with commas between them.")] = f"{CHOSEN_ON},{OTHERS}",
    only: Annotated[str, typer.Option(help="Only kinds with this in their name.")] = "",
    with_learn: Annotated[bool, typer.Option("--learn", help="Learn the first recording of each kind.")] = False,
) -> None:
    """Write recordings in odd kinds of files, read them again, and compare."""
    bodies = []
    for recording in of.split(","):
        amc = data / "cmu" / f"{recording}.amc"
        bodies.append(of_acclaim(amc.parent / f"{amc.parent.name}.asf", amc, slice(0, FRAMES)))
    count = dict.fromkeys("rRdxM", 0)
    with tempfile.TemporaryDirectory() as folder:
        for name, kind in KINDS.items():
            if only not in name:
                continue
            path, found = Path(folder) / "odd.bvh", []
            for body in bodies:
                found.append(judged(kind(body), path))
            row, said = "".join(letter for letter, _ in found), next((text for _, text in found if text), "")
            made = ""
            if with_learn:
                path.write_bytes(kind(bodies[0]).content)
                made = learned(path)
            print(f"{name:<48}{row:<8}{made:<14}{said}", flush=True)
            count = {letter: number + row.count(letter) for letter, number in count.items()}
    print(", ".join(f"{letter} {number}" for letter, number in count.items()))


if __name__ == "__main__":
    command.run("odd_files", main)
