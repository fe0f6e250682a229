"""Defects of recordings: read right, doubted, refused, or silent.

Each recording is spoilt in every way of `defect_kinds` with scipy alone, written, and analysed as `motiondeck learn`
does with no option. Of each it prints, one letter a recording,

    r   right: limbs point within 2 degrees of the truth, legs are as long within 3 %, frames and rate are right, and
        the hips within 5 cm of their true height (where that is in the file)
    D   not right, or not known, but a doubt or a decision says so and names an option, a key or what to look for
    x   left out or refused with the true reason
    X   refused with another reason
    S   silent: learned, not right, and no word

and the first that was said. The first table is what the stage was chosen on, the second what it is reported on.

    python -m benchmarks defects ../shared/data
    python -m benchmarks defects ../shared/data --of 35/35_01 --only floor
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from benchmarks.recordings.defect_kinds import FURTHER, ISSUE, Defect, Spoilt
from benchmarks.recordings.odd_bodies import Body, of_acclaim
from controller.learning.recording_analysis import AnalysedRecording, analyse_recording
from controller.motion.canonical.canonical_body import CANONICAL_BONES, to_canonical
from controller.motion.clip import AS_FOUND, ReadingOptions
from controller.motion.joint_tree import SeveralPeopleError
from controller.motion.rotations import normalise
from motiondeck_base.errors import MotiondeckError

CHOSEN_ON = "cmu/08/08_01,cmu/16/16_01"
OTHERS = "cmu/02/02_01,cmu/35/35_01,hdm05/sneak2StepsLStart/HDM_bd_sneak2StepsLStart_002_120"
FRAMES = 600  # of each recording
SAME_WAY, SAME_LENGTH, SAME_HEIGHT = 2.0, 0.03, 0.05  # degrees, share, m
LIMBS = [
    (side + end, side + start)
    for side in "lr"
    for end, start in (("kne", "hip"), ("ank", "kne"), ("elb", "sho"), ("wri", "elb"))
]


def is_right(found: AnalysedRecording, truth: Body, *, height: bool) -> bool:
    """Whether a recording was analysed as what it holds."""
    clip = found.clip
    if abs(clip.rate / truth.rate - 1.0) > 0.005 or abs(len(clip) - len(truth.root)) > 2:
        return False
    frames = slice(0, min(len(clip), len(truth.root)))
    joints, marks = to_canonical(clip).joints(), truth.landmarks()
    ours = {bone: joints[frames, 1 + place] for place, bone in enumerate(CANONICAL_BONES)}
    for end, start in LIMBS:
        line, own = marks[end][frames] - marks[start][frames], ours[end] - ours[start]
        apart = np.linalg.norm(normalise(line) - normalise(own), axis=-1)
        if np.degrees(2.0 * np.arcsin(np.quantile(apart, 0.99) / 2.0)) > SAME_WAY:
            return False
        lengths = [float(np.median(np.linalg.norm(one, axis=-1))) for one in (line, own)]
        if end[1:] == "kne" and abs(lengths[1] / lengths[0] - 1.0) > SAME_LENGTH:
            return False
    hips = [0.5 * (one["lhip"] + one["rhip"])[frames, 2] for one in (ours, marks)]
    allowed = SAME_HEIGHT if height else 2.0 * SAME_HEIGHT  # a body in the air is lost where the file has no height
    return float(np.quantile(np.abs(hips[0] - hips[1]), 0.9)) < allowed


def said_of(found: AnalysedRecording) -> list[str]:
    """What `learn` prints of a recording; how it plays, and which round, says nothing of a defect."""
    said = [str(decision) for decision in found.take.decisions if decision.notable and decision.step != "kind"]
    return [*said, *found.take.doubts]


def judged(spoilt: Spoilt, path: Path) -> tuple[str, str]:
    """The letter of a file, and the first that was said."""
    path.write_text(spoilt.content)
    try:
        try:
            found = {"": analyse_recording(path, "spoilt", AS_FOUND)[0]}
        except SeveralPeopleError as error:
            found = {one: analyse_recording(path, "spoilt", ReadingOptions(person=one))[0] for one in error.people}
    except MotiondeckError as error:
        reason = str(error).replace(f"{path}", path.name)
        return "x" if any(word in reason for word in spoilt.refusal) else "X", reason
    said = [line for one in found.values() for line in said_of(one)]
    first = said[0] if said else ""
    stops = [line for one in found.values() for line in one.take.anatomy]
    if stops and spoilt.refusal:
        return "x" if any(word in line for word in spoilt.refusal for line in stops) else "X", stops[0]
    if found.keys() == spoilt.bodies.keys() and all(
        is_right(found[name], body, height=spoilt.height) for name, body in spoilt.bodies.items()
    ):
        return "r", first
    return "D" if said else "S", first


def main(
    data: Path,
    of: Annotated[str, typer.Option(help="Recordings of Acclaim, with commas between them.")] = "",
    only: Annotated[str, typer.Option(help="Only defects with this in their name.")] = "",
) -> None:
    """Spoil recordings in forty ways, analyse them as learn does, and compare."""
    tables = [("chosen on", ISSUE, CHOSEN_ON), ("the same defects on other recordings", ISSUE, OTHERS)]
    tables += [("reported on", FURTHER, OTHERS)]
    silent = 0
    with tempfile.TemporaryDirectory() as folder:
        for title, defects, usual in tables:
            recordings = of or usual
            bodies = [_body(data, one) for one in recordings.split(",")]
            print(f"{title}: {len(defects)} defects of {recordings}")
            silent += _table(defects, bodies, only, Path(folder))
    print(f"silent: {silent}")


def _body(data: Path, recording: str) -> Body:
    amc = data / f"{recording}.amc"
    asf = amc.parent / f"{amc.parent.name}.asf"
    hdm05 = amc.parent.parent / f"{amc.stem[:6]}.asf"  # of the actor, above the folders of its motions
    return of_acclaim(asf if asf.exists() else hdm05, amc, slice(0, FRAMES))


def _table(defects: dict[str, Defect], bodies: list[Body], only: str, folder: Path) -> int:
    """Prints the letters of each defect and their counts; the number that were silent."""
    letters = ""
    for name, defect in defects.items():
        if only not in name:
            continue
        found = []
        for body in bodies:
            spoilt = defect(body)
            found.append(judged(spoilt, folder / f"spoilt{spoilt.suffix}"))
        row = "".join(letter for letter, _ in found)
        letters += row
        print(f"  {name:<42}{row:<7}{next((text for _, text in found if text), '')[:150]}", flush=True)
    print("  " + ", ".join(f"{letter} {letters.count(letter)}" for letter in "rDxXS"))
    return letters.count("S")


if __name__ == "__main__":
    command.run("defects", main)
