"""Loop or once: what `learn` decides, against labels written by looking.

Looked at were the first three principal components of the joint positions over time, and the descriptions of the
sources (HDM05 classes, the CMU listing, names of Bandai-Namco and the thesis). "loop": a gait, or a movement that goes
on through its ends; "once": it begins or ends at rest, or does not come back; "either": one cycle cut out of several
whose ends meet roughly, or repeated gestures with pauses between. Bounds were chosen with CHOSEN_ON in mind, but the
figures of all clips lay on the table by then, so the other half is not a blind test.
"""

from __future__ import annotations

import fnmatch
import json
from pathlib import Path
from typing import Annotated

import typer

from benchmarks import command
from controller.learning.recording_analysis import analyse_recording
from controller.motion.formats.reading import recordings_in
from motiondeck_base.errors import MotiondeckError

CHOSEN_ON = ("hdm05/*/HDM_bd_*", "hdm05/*/HDM_dg_*", "cmu/*", "jaeger/*")

LABELS = {  # of the path in the folder; the first pattern that fits counts
    "bvh/bandai/bow_*": "once",
    "bvh/bandai/bye_*": "once",
    "bvh/bandai/byebye_*": "either",  # seven waves of the hand and nothing else
    "bvh/bandai/dance-short_*": "once",
    "bvh/bandai/punch_*": "either",  # five punches
    "bvh/bandai/slash_*": "either",  # three slashes
    "bvh/bandai/*": "loop",  # dash, run, walk
    "bvh/*_131_01.bvh": "once",
    "bvh/*": "loop",  # walk, run
    "c3d/133_01_*": "once",
    "c3d/49_08_*": "either",  # two cartwheels
    "c3d/55_01dance.c3d": "either",  # four rounds of a waltz, no two alike
    "c3d/*": "loop",
    "cmu/02/02_04.amc": "once",  # jumps, then balances
    "cmu/10/*": "once",  # kicks a ball
    "cmu/16/*": "once",  # jumps
    "cmu/86/*": "once",  # several behaviours
    "cmu/*": "loop",
    "hdm05/jogLeft*/HDM_dg_*_008_*": "either",  # jogs from the first frame on, along a circle
    "hdm05/jogLeft*/HDM_dg_*_009_*": "either",
    "hdm05/jogLeft*/HDM_mm_*_012_*": "either",
    "hdm05/jogLeft*": "once",  # from standing
    "hdm05/kick*": "once",
    "hdm05/squat*": "once",
    "hdm05/rotateArms*": "loop",
    "hdm05/*": "either",  # one hop, two sneaking steps, one elbow to a knee, cut out of many
    "jaeger/nnRawBox*": "either",
    "jaeger/nnRawCartWheel.mat": "either",
    "jaeger/nnRawCrawl.mat": "either",
    "jaeger/nnRawSitting.mat": "either",
    "jaeger/nnRawGet*": "once",
    "jaeger/nnRawStandup*": "once",
    "jaeger/*": "loop",
}


def label_of(name: str) -> str:
    """The label of a path in the data folder."""
    return next((label for pattern, label in LABELS.items() if fnmatch.fnmatch(name, pattern)), "either")


def main(
    data: Annotated[Path, typer.Argument(help="The folder of recordings.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    rows: list[dict[str, str | bool]] = []
    several: list[str] = []
    for file in recordings_in([data], convertible=True):
        name = file.relative_to(data).as_posix()
        try:
            motions = analyse_recording(file, "motion")
            if len(motions) > 1:
                several.append(f"{name}: cut into {len(motions)} motions, {motions[0].take.decisions[-2]}")
                motions = analyse_recording(file, "motion", whole=True)
        except MotiondeckError:
            continue
        chosen = any(fnmatch.fnmatch(name, pattern) for pattern in CHOSEN_ON)
        label, found = label_of(name), motions[0].motion.plays
        rows.append(
            {"file": name, "label": label, "found": found, "chosen_on": chosen, "right": label in (found, "either")}
        )
    definite = [row for row in rows if row["label"] != "either"]
    halves = {
        words: [row for row in definite if row["chosen_on"] is chosen]
        for words, chosen in (("chosen on", True), ("reported on", False))
    }
    right = {words: (sum(bool(row["right"]) for row in some), len(some)) for words, some in halves.items()}
    if as_json:
        print(json.dumps({"rows": rows, "cut": several, **right}))
        return
    for row in rows:
        if not row["right"]:
            print(f"{row['file']}: {row['label']}, found {row['found']}")
    for words, (good, many) in right.items():
        print(f"{words}: {good} of {many} right ({good / max(1, many):.1%})")
    print(f"{len(several)} of {len(rows)} are cut", *several, sep="\n")
    print(f"{len(rows) - len(definite)} recordings may play either way")


if __name__ == "__main__":
    command.run("kinds", main, __doc__)
