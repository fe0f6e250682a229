"""Ten minutes of two people in a file: motions, borders, time and memory.

The file is a table of joint centres (TRC, 60 Hz) of Anna and Ben, each with their own order of the labelled whole
bodies of `cuts`: as recorded, mirrored, and slower. A second leads from the last pose of a recording to the first one
of the next; its middle is a border as well. Ben is 0.9 of Anna's size. `motiondeck learn` reads it in a process of its
own with no option, so that its memory is its own. Borders are those of its step `cuts`.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks import command
from benchmarks.recordings.cuts import FAR, NEAR, Borders, Trial, trials_in
from controller.learning.recording_analysis import with_steps
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import mirrored, moving_part
from controller.motion.clip import AS_FOUND, Clip
from controller.motion.formats.reading import read_fitted
from controller.motion.rotations import Array, dot, multiply, normalise, rotate, yaw
from controller.motion.take.segmentation import cuts_of
from motiondeck_base.errors import MotiondeckError

RATE, EVERY, JOIN = 60.0, 2, 60
SIZES = {"Anna": 1.0, "Ben": 0.9}
JOINTS = {"kne": "Knee", "ank": "Ankle", "foo": "BigToe", "sho": "Shoulder", "elb": "Elbow", "wri": "Wrist"}
LABELS = {side + end: side.upper() + name for side in "lr" for end, name in JOINTS.items()}
# Of a child process `getrusage` has the largest memory of its parent too, if that was larger.
COMMAND = """import atexit, pathlib, sys
from motiondeck.command import main
atexit.register(lambda: print(pathlib.Path("/proc/self/status").read_text(), file=sys.stderr))
main()"""
LABELS |= {"lhip": "LHip", "rhip": "RHip", "neck": "Neck", "head": "Head"}


def variants(trials: list[Trial]) -> list[tuple[Clip, Borders]]:
    """The whole bodies at 60 Hz on the canonical body with their borders: as recorded, mirrored, and slower."""
    found: list[tuple[Clip, Borders]] = []
    bodies = [(to_canonical(trial.clip), trial.best) for trial in trials if trial.clip is not None]
    for number in range(3):
        for clip, best in bodies:
            pace = (1.0, 1.0, 0.8)[number]
            at = np.arange(0.0, len(clip) - 1, EVERY * pace)
            low = at.astype(int)
            source = mirrored(clip) if number == 1 else clip
            share = (at - low)[:, None]
            place = source.root_position[low] * (1.0 - share) + source.root_position[low + 1] * share
            turned = _between(source.rotation[low], source.rotation[low + 1], share)
            seen = replace(source, rate=RATE, root_position=place, rotation=turned)
            found.append((seen, (best / (EVERY * pace)).astype(int)))
    return found


def _between(start: Array, end: Array, share: Array) -> Array:
    """Rotations (T, B, 4) at shares (T, 1) of the way between others."""
    end = np.where(dot(start, end)[..., None] < 0.0, -end, end)
    return normalise(start + share[..., None] * (end - start))


def in_a_row(pieces: list[tuple[Clip, Borders]], frames: int) -> tuple[Clip, Borders]:
    """Pieces joined until there are some frames, and the borders."""
    place, rotation = [pieces[0][0].root_position[:0]], [pieces[0][0].rotation[:0]]
    borders: list[int] = []
    length = 0
    while length < frames:
        for clip, best in pieces:
            if length:
                clip = _moved_to(clip, place[-1][-1], rotation[-1][-1])
                share = (np.arange(1, JOIN + 1) / (JOIN + 1))[:, None]
                share = share * share * (3.0 - 2.0 * share)
                borders.append(length + JOIN // 2)
                place.append(place[-1][-1] * (1.0 - share) + clip.root_position[0] * share)
                start, end = (np.repeat(one[None], JOIN, axis=0) for one in (rotation[-1][-1], clip.rotation[0]))
                rotation.append(_between(start, end, share))
                length += JOIN
            borders += (length + best).tolist()
            place.append(clip.root_position)
            rotation.append(clip.rotation)
            length += len(clip)
            if length >= frames:
                break
    joined = replace(
        pieces[0][0], root_position=np.concatenate(place)[:frames], rotation=np.concatenate(rotation)[:frames]
    )
    return joined, np.array([border for border in borders if border < frames - RATE])


def _moved_to(clip: Clip, place: Array, rotation: Array) -> Clip:
    """The clip from another place on the floor, and turned to the heading of a body there."""
    ahead = [rotate(one[0], np.array([1.0, 0.0, 0.0])) for one in (rotation, clip.rotation[0])]
    turn = yaw(np.array(np.subtract(*(np.arctan2(one[1], one[0]) for one in ahead))))
    path = rotate(turn, clip.root_position - clip.root_position[0] * [1.0, 1.0, 0.0]) + place * [1.0, 1.0, 0.0]
    return replace(clip, root_position=path, rotation=multiply(turn, clip.rotation))


def write_people(path: Path, people: dict[str, Clip]) -> None:
    """Writes a TRC of the joints of some people."""
    labels = [f"{name}:{label}" for name in people for label in LABELS.values()]
    columns: list[Array] = []
    for number, (name, clip) in enumerate(people.items()):
        at = [1 + clip.skeleton.bones.index(bone) for bone in LABELS]
        points = SIZES[name] * clip.joints()[:, at] + [0.0, 3.0 * number, 0.0]
        columns.append(1000.0 * points.reshape(len(clip), -1))
    table = np.concatenate(columns, axis=1)
    count = len(table)
    with path.open("w") as file:
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{path.name}\n")
        file.write("DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\t")
        file.write("OrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n")
        file.write(f"{RATE:g}\t{RATE:g}\t{count}\t{len(labels)}\tmm\t{RATE:g}\t1\t{count}\n")
        file.write("Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t\n")
        file.write("\t\t" + "\t".join(f"{axis}{one}" for one in range(1, len(labels) + 1) for axis in "XYZ") + "\n\n")
        for frame, row in enumerate(table):
            file.write(f"{frame + 1}\t{frame / RATE:.5f}\t" + "\t".join(f"{value:.2f}" for value in row) + "\n")


def learned(path: Path) -> dict[str, Any]:
    """What `motiondeck learn` prints of a file, with its time, s, its largest memory, MB, and its recipe's borders."""
    out = path.with_suffix(".safetensors")
    begin, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = [sys.executable, "-c", COMMAND, "learn", str(path), "--out", str(out), "--force", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
    if done.returncode:
        raise MotiondeckError(done.stderr.strip() or "learn failed")
    took, used = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    largest = float(done.stderr.rpartition("VmHWM:")[2].split()[0])  # KiB
    figures = {"took_s": took, "processor_s": used.ru_utime - before, "memory_mb": largest * 1.024e-3}
    return json.loads(done.stdout) | figures | {"file_mb": path.stat().st_size / 1e6}


def borders_of(path: Path, person: str) -> Array:
    """The borders between the motions of a person, s; a loop's frames in the recipe are fewer than its motion's."""
    clip = read_fitted(path, with_steps(replace(AS_FOUND, person=person))).clip
    motions = cuts_of(clip, *moving_part(clip)).motions
    return np.array([0.5 * (one[1] + other[0]) / clip.rate for one, other in pairwise(motions)])


def main(
    data: Annotated[Path, typer.Argument(help="The folder of recordings, as for `cuts`.")],
    minutes: Annotated[list[float] | None, typer.Option("--minutes", help="Lengths to try.")] = None,
    keep: Annotated[Path | None, typer.Option("--keep", help="A folder in which files and libraries stay.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object for each length.")] = False,
) -> None:
    pieces = variants(trials_in(data))
    orders = {"Anna": pieces, "Ben": pieces[::-1]}
    for length in minutes or (2.5, 5.0, 10.0):
        with tempfile.TemporaryDirectory() as there:
            path = (keep or Path(there)) / f"duo{length:g}.trc"
            people = {name: in_a_row(order, round(60.0 * RATE * length)) for name, order in orders.items()}
            write_people(path, {name: clip for name, (clip, _) in people.items()})
            report = learned(path)
            found = {name: borders_of(path, name) for name in people}
        motions = report["motions"]
        report |= {"minutes": length, "people": {}}
        off: list[Array] = []
        for name, (_, best) in people.items():
            apart = np.abs(found[name][None] - best[:, None] / RATE)
            off.append(apart.min(axis=1))
            row = {"labels": len(best), "borders": found[name].tolist(), "errors_s": off[-1].tolist()}
            report["people"] |= {name: row}
        if as_json:
            print(json.dumps(report), flush=True)
            continue
        every = np.concatenate(off)
        passed = sum(bool(one["passed"]) for one in motions)
        print(
            f"{length:g} minutes of 2 people, {report['file_mb']:.0f} MB: {report['took_s']:.0f} s "
            f"({report['processor_s']:.0f} s of processor time), {report['memory_mb']:.0f} MB"
        )
        print(f"  {len(motions)} motions, {passed} passed: {', '.join(one['name'] for one in motions[:3])} ...")
        print(
            f"  {sum(map(len, found.values()))} borders for {len(every)} labels: median {np.median(every):.2f} s, "
            f"within {NEAR:g} s {np.mean(every <= NEAR):.0%}, {FAR:g} s {np.mean(every <= FAR):.0%}",
            flush=True,
        )


if __name__ == "__main__":
    command.run("long_take", main, __doc__)
