"""Many clips on a Dask cluster that loses a worker, beside one process.

The clips are all recordings of --data, the longest ones cut in halves until there are --clips. They are learned in
libraries of 16, and carried onto a robot, once in this process and once on a cluster of two workers of this machine
(`distributed.LocalCluster`, one thread each). When half of the retargeted files are there, a worker is killed
(SIGKILL). Then every file of both runs is compared byte by byte. Seconds are wall-clock, without the start of the
cluster, which is listed separately; `overhead_ms` is the time of an empty task.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from joblib import delayed

from benchmarks import command
from benchmarks.robots.training_files import write_clips
from controller.learning.learn import learn
from controller.library.motion_library import save_library
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import ALONE, Jobs, spread
from motiondeck_base.shipped import find_robot
from sim.robots.retarget_files import MANIFEST, retarget_files

LIBRARY = 16  # clips
NOTHINGS = 200


def main(
    data: Annotated[Path, typer.Option(help="Recordings.", envvar="MOTIONDECK_DATA")] = Path("../shared/data"),
    robot: Annotated[str, typer.Option(help="A robot file or name.")] = "servo20",
    clips: Annotated[int, typer.Option(help="How many.")] = 500,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    import distributed

    local_cluster: Any = distributed.LocalCluster  # its types do not know dashboard_address=None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        row: dict[str, Any] = {"clips": clips, "clip_seconds": round(write_clips(data, folder / "clips", clips))}
        row |= {f"{what}_alone_s": took for what, took in both(folder, folder / "alone", robot, ALONE, []).items()}
        begin = time.perf_counter()
        with local_cluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
            jobs = Jobs(cluster=cluster.scheduler_address.removeprefix("tcp://"))
            workers = [worker.pid for worker in cluster.workers.values()]
            first = list(spread([delayed(os.getpid)()], jobs))
            row["cluster_start_s"] = time.perf_counter() - begin
            assert first[0] in workers
            row |= {
                f"{what}_cluster_s": took
                for what, took in both(folder, folder / "cluster", robot, jobs, workers).items()
            }
            begin = time.perf_counter()
            done = len(list(spread((delayed(abs)(number) for number in range(NOTHINGS)), jobs)))
            row["overhead_ms"] = 1e3 * (time.perf_counter() - begin) / done
        here, there = digests(folder / "alone"), digests(folder / "cluster")
        row |= {"files": len(here), "same": sum(there.get(path) == digest for path, digest in here.items())}
        row["others"] = len(there.keys() - here.keys())
        row |= {f"{what}_speed_up": row[f"{what}_alone_s"] / row[f"{what}_cluster_s"] for what in ("learn", "retarget")}
    row = {key: round(value, 2) if isinstance(value, float) else value for key, value in row.items()}
    print(json.dumps(row) if as_json else "\n".join(f"{key}: {value}" for key, value in row.items()))


def both(folder: Path, out: Path, robot: str, jobs: Jobs, workers: list[int]) -> dict[str, float]:
    """Learns and retargets the clips; how long either took, s. The first of some workers is killed half-way."""
    files, took = sorted((folder / "clips").iterdir()), {}
    (out / "libraries").mkdir(parents=True)
    begin = time.perf_counter()
    parts = [files[first : first + LIBRARY] for first in range(0, len(files), LIBRARY)]
    tasks = (
        delayed(learn_library)(part, out / "libraries" / f"{number:03}.safetensors")
        for number, part in enumerate(parts)
    )
    for problem in spread(tasks, jobs):
        if problem:
            print(problem, file=sys.stderr)
    took["learn"] = time.perf_counter() - begin
    begin = time.perf_counter()
    rows = retarget_files(find_robot(robot), [folder / "clips"], out / "motions", "npz", None, jobs)
    for number, row in enumerate(rows):
        if row.error:
            print(row.error, file=sys.stderr)
        if workers and number == len(files) // 2:
            os.kill(workers.pop(), signal.SIGKILL)
    took["retarget"] = time.perf_counter() - begin
    return took


def learn_library(files: list[Path], out: Path) -> str:
    """Learns clips as one library file; why it could not be, or nothing."""
    try:
        save_library(learn(files, out.stem, seeds=[0]).library, out)
    except MotiondeckError as error:
        return str(error)
    return ""


def digests(folder: Path) -> dict[str, str]:
    """What is in each file below a folder, by its path in it; of a manifest the lines, in any order."""
    found: dict[str, str] = {}
    for path in folder.rglob("*"):
        if path.is_file():
            data = path.read_bytes()
            data = b"".join(sorted(data.splitlines())) if path.name == MANIFEST else data
            found[path.relative_to(folder).as_posix()] = hashlib.sha256(data).hexdigest()
    return found


if __name__ == "__main__":
    command.run("cluster", main, __doc__)
