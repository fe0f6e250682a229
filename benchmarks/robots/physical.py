"""Physical stage: how many motions G1 does on its own feet, and how well.

G1 is calibrated from mjlab's model, with Unitree's torque limits, and carries recordings in real time (tempo 1). It has
fallen when its pelvis is 0.25 m lower than the carried one's for 0.3 s (after a lower jump it lands earlier), or tilted
50 degrees away from it, which is not the rule by which the stage ends. Each row of the results is a motion and a seed:

    plain      second at which it falls with the carried targets alone
    stood      seconds until it fell, of so many
    path       mean distance of the pelvis from the carried one's along the ground, m
    pose       root mean square of the joints' differences, degrees
    flight     longest time without contact with the floor, of the robot and of the carried motion, s
    replays    share of replays of what was found that stand to the end, from a start 1 mm and mrad beside
    cpu        seconds of processor time a second of motion

    python -m benchmarks physical ../shared/data --models published-models --download
    python -m benchmarks physical ../shared/data --motions nnRawWalk,02_04 --seeds 1 --seconds 4

With --planner sampling it is what `retarget` tries where the first search falls; with ps, mppi or cem a sampling
planner of judo (`pip install --no-deps judo-rai`) takes its place.

A run that was stopped continues: rows that are in the results are not computed again.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks import command
from benchmarks.robots.published_models import MODELS, fetch
from benchmarks.robots.world import NOT_CARRIED, SHARED
from controller.motion.canonical.clip_edits import resampled, without_reference_pose
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip
from sim.physical.course import Batch, CarriedCourse, played
from sim.physical.search import Sampling, Search
from sim.physical.stage import RATE, OnItsFeet, PhysicalStage
from sim.physics.physics_model import physics_model
from sim.robots.calibrate import calibrate
from sim.robots.joint_motion import retargeted
from sim.robots.robot import Robot, RobotLoader

# Torque limits by the beginning of a joint's name after its side, N m (Unitree's data sheet and mjlab's constants).
TORQUES = {
    "hip_roll": 139.0,
    "hip": 88.0,
    "knee": 139.0,
    "ankle": 50.0,
    "waist_yaw": 88.0,
    "waist": 50.0,
    "shoulder": 25.0,
    "elbow": 25.0,
    "wrist_roll": 25.0,
    "wrist": 5.0,
}
COUNT_SHARED = 10
LOW, TILTED, LASTS = 0.25, 50.0, 0.3  # m and degrees beside the carried pelvis, and s that it is low
REPLAYS, NOISE = 10, 0.001  # m and rad
OURS = "search"
PLANNERS = {OURS: Search, "sampling": Sampling}

Array = NDArray[np.float64]
Row = dict[str, Any]


def g1_file(models: Path, folder: Path) -> Path:
    """G1's robot file, calibrated and with its torque limits, written into a folder."""
    model = models / next(model.file for model in MODELS if model.name == "unitree_g1")
    text, path = calibrate(model.resolve()).to_toml(folder), folder / "g1.toml"
    bare = mujoco.MjModel.from_xml_path(str(model))
    for joint in (bare.joint(index).name for index in range(1, bare.njnt)):
        kind = joint.removeprefix("left_").removeprefix("right_")
        torque = next(value for start, value in TORQUES.items() if kind.startswith(start))
        text += f"\n[limits.joints.{joint}]\ntorque = {torque}\n"
    path.write_text(text)
    return path


def recordings(data: Path, motions: str) -> list[Path]:
    """The recordings below a folder; `motions` are their names' beginnings, by commas."""
    patterns = sorted(p for p in (data / "jaeger").glob("nnRaw*.mat") if p.name != NOT_CARRIED)
    files = [*patterns, *(data / name for name in SHARED[:COUNT_SHARED])]
    return [f for f in files if f.exists() and (not motions or f.stem.startswith(tuple(motions.split(","))))]


def clip_of(path: Path, data: Path, seconds: float) -> Clip:
    """The first seconds of a recording at the rate of the stage."""
    clip, _ = without_reference_pose(read_clip(path, ReadingOptions(skeleton_of(path, data))))
    clip = resampled(clip, RATE)
    count = min(len(clip), round(seconds * RATE) + 1)
    return replace(clip, root_position=clip.root_position[:count], rotation=clip.rotation[:count])


def has_fallen(qpos: Array, carried: Array) -> NDArray[np.bool_]:
    """Whether a robot (T, nq) lies where the carried one (T, nq) does not, by frame."""
    up = [1.0 - 2.0 * (q[:, 4:6] ** 2).sum(axis=1) for q in (qpos, carried)]
    tilt = [np.degrees(np.arccos(np.clip(one, -1.0, 1.0))) for one in up]
    low, knots = qpos[:, 2] < carried[:, 2] - LOW, round(LASTS * RATE)
    lasting = np.array([low[k : k + knots].all() for k in range(len(low))])
    fallen: NDArray[np.bool_] = lasting | (tilt[0] > tilt[1] + TILTED)
    return fallen


def flight(model: mujoco.MjModel, qpos: Array) -> float:
    """The longest time without contact with the floor, s."""
    data, longest, now = mujoco.MjData(model), 0, 0
    for q in qpos:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        floor = [0 in model.geom_bodyid[[contact.geom1, contact.geom2]] for contact in data.contact]
        now = 0 if any(floor) else now + 1
        longest = max(longest, now)
    return longest / RATE


def measured(robot: Robot, clip: Clip, seed: int, planner: str = OURS) -> tuple[Row, OnItsFeet]:
    """A row of one motion and seed."""
    carried = retargeted(robot, clip)
    started = time.process_time()
    stage = PhysicalStage(robot, carried)
    found = stage.search(seed, planner=PLANNERS.get(planner) or sampled(planner, seed))
    cpu = time.process_time() - started
    done, asked = found.motion.qpos, carried.qpos[: len(found.motion)]
    fallen, model = has_fallen(done, asked), physics_model(robot, "free")
    stood = float(np.argmax(fallen)) / RATE if fallen.any() else (len(done) - 1) / RATE
    row: Row = {"plain": stage.plain(), "stood": stood, "seconds": (len(carried) - 1) / RATE}
    row |= {"fell": bool(fallen.any()) or found.fell_s is not None, "path": found.path_m, "pose": found.pose_deg}
    row |= {"flight": [flight(model, q) for q in (done, carried.qpos)], "cpu": cpu / stood if stood else 0.0}
    if not row["fell"]:
        row["kept"] = kept(stage, found, done, asked, seed)
    return row, found


def sampled(planner: str, seed: int) -> Callable[[Batch, CarriedCourse], Search]:
    """A planner of judo, which draws from NumPy's global state."""
    from benchmarks.robots.physical_peers import SampledSearch

    np.random.seed(seed)  # noqa: NPY002
    return partial(SampledSearch, planner)


def kept(stage: PhysicalStage, found: OnItsFeet, done: Array, asked: Array, seed: int) -> float:
    """The share of replays of its targets, from a start a little beside, in which it stands to the end."""
    batch, course, nv = stage.batch, stage.course, stage.batch.model.nv
    beside = np.random.default_rng(seed).normal(0.0, np.repeat([NOISE, 0.0], nv), (REPLAYS, 2 * nv))
    start = batch.moved(np.concatenate([done[0], course.states[0, done.shape[1] :]]), beside)
    offsets = np.broadcast_to((found.targets - course.targets)[:-1], (REPLAYS, len(done) - 1, done.shape[1] - 7))
    runs = played(batch, course, start, 0, offsets)
    return sum(not has_fallen(run, asked).any() for run in runs) / REPLAYS


def line(row: Row) -> str:
    plain = "  -  " if row["plain"] is None else f"{row['plain']:5.2f}"
    again = f"{row['kept']:.1f}" if "kept" in row else "-"
    air = "/".join(f"{seconds:.2f}" for seconds in row["flight"])
    return (
        f"{row['motion'][:28]:28} {row['seed']:4} {plain} {row['stood']:6.2f}/{row['seconds']:5.2f}"
        f"{' fell' if row['fell'] else '     '} {row['path']:6.3f} {row['pose']:5.1f} {air:>9} {again:>7} "
        f"{row['cpu']:6.1f}"
    )


def main(
    data: Annotated[Path, typer.Argument(help="Recordings.", envvar="MOTIONDECK_DATA")],
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option(help="Fetch mjlab, if it is not in it, from PyPI.")] = False,
    motions: Annotated[str, typer.Option(help="Beginnings of names, by commas; default: all 24.")] = "",
    seeds: Annotated[int, typer.Option(help="Seeds of each motion.")] = 3,
    seconds: Annotated[float, typer.Option(help="Of each recording.")] = 6.0,
    planner: Annotated[
        Literal["search", "sampling", "ps", "mppi", "cem"], typer.Option(help="What plans the offsets.")
    ] = OURS,
    results: Annotated[Path, typer.Option(help="A JSON object a row; what is there is not repeated.")] = Path(
        "physical.jsonl"
    ),
    keep: Annotated[Path | None, typer.Option(help="A folder for the motions found, as .npz of qpos.")] = None,
) -> None:
    if download:
        fetch(models, {"unitree_g1"})
    rows: list[Row] = [json.loads(text) for text in results.read_text().splitlines()] if results.exists() else []
    done = {(row["motion"], row["seed"], row["asked"], row.get("planner", OURS)) for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        load = RobotLoader(g1_file(models, Path(folder)))
        for seed in range(seeds):
            for path in recordings(data, motions):
                if (path.stem, seed, seconds, planner) in done:
                    continue
                clip = clip_of(path, data, seconds)
                row, found = measured(load(clip.skeleton, None, 1.0 / RATE), clip, seed, planner)
                asked = {"motion": path.stem, "seed": seed, "asked": seconds, "planner": planner}
                rows.append(asked | row)
                with results.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
                print(line(rows[-1]), file=sys.stderr, flush=True)
                if keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    np.savez(keep / f"{path.stem}.{seed}.npz", qpos=found.motion.qpos, fps=RATE)
    print("motion                       seed plain   stood            path  pose    flight replays    cpu")
    rows = [row for row in rows if row.get("planner", OURS) == planner]
    for row in sorted(rows, key=lambda row: (row["motion"], row["seed"])):
        print(line(row))
    stands = sum(not row["fell"] for row in rows)
    print(f"{stands} of {len(rows)} stand to the end; without the stage {sum(r['plain'] is None for r in rows)}")


if __name__ == "__main__":
    command.run("physical", main, __doc__)
