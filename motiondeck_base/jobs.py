"""Where tasks run: in processes of this machine (joblib), or on a Dask cluster.

A task is a call of a module's function, as `joblib.delayed` packs it, that depends on its arguments alone; so its
result is the same wherever it runs. On a cluster each process runs one task at a time, and a task whose process is lost
is run again. A process of this machine ends when the one that it works for has ended, however that was.

A cluster is asked through Dask's own client. joblib's backend for it (1.6.0) waits for ever when Dask gives up a task
that has killed several processes, and keeps large arguments on one worker only, with which they are lost.
"""

import itertools
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from multiprocessing import resource_tracker
from typing import Any, Self

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from motiondeck_base.early_end import without_interrupts
from motiondeck_base.errors import MotiondeckError

Task = tuple[Callable[..., Any], tuple[Any, ...], Mapping[str, Any]]

_CLUSTER = re.compile(r"dask://(.+:\d+)")
_PATIENCE = 10.0  # s for a scheduler to answer, and for its first worker
_LOOKS_EVERY = 0.5  # s: how often a process looks whether its parent is still there
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class Jobs:
    """Where tasks run."""

    processes: int = -1  # of this machine; -1 for one per core
    cluster: str = ""  # the address of a Dask scheduler, HOST:PORT, that is used instead; "" for none

    @classmethod
    def parse(cls, text: str) -> Self:
        """What "4", "-1" or "dask://HOST:PORT" says. MotiondeckError if it is none of these."""
        if found := _CLUSTER.fullmatch(text):
            return cls(cluster=found[1])
        if re.fullmatch(r"-1|[1-9]\d*", text):
            return cls(int(text))
        raise MotiondeckError(f"--jobs {text}: give a number of processes, -1 for one per core, or dask://HOST:PORT")


ALONE = Jobs(1)  # in this process
EVERY_CORE = Jobs(-1)  # in a process per core of this machine


def spread(tasks: Iterable[Task], jobs: Jobs) -> Iterator[Any]:
    """The results of tasks, in their order.

    MotiondeckError if the cluster cannot be used, or gave a task up; what a task raises is raised too.
    """
    if not jobs.cluster:
        several = jobs.processes != 1
        if several and not os.access("/dev/shm", os.W_OK):
            print("motiondeck: one core computes, as /dev/shm is not writable. Mount a tmpfs there", file=sys.stderr)
        watched = (delayed(_watched)(os.getpid(), task) for task in tasks)
        if several:
            resource_tracker.ensure_running()  # which lets interrupts in again where it starts later
        with without_interrupts():  # which the processes inherit; with one, none is started
            results = Parallel(jobs.processes, return_as="generator")(watched)
        yield from results
    else:
        early: dict[int, Any] = {}
        awaited = 0
        for number, result in _on_cluster(tasks, jobs.cluster):
            early[number] = result
            while awaited in early:
                yield early.pop(awaited)
                awaited += 1


def _watched(parent: int, task: Task) -> Any:
    """One task of a process, which ends with its parent from now on: joblib's own go on for minutes if it is killed."""
    _end_with(parent)
    function, args, kwargs = task
    return function(*args, **kwargs)


@cache
def _end_with(parent: int) -> None:
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOKS_EVERY)
        os._exit(1)

    if os.getppid() == parent:
        threading.Thread(target=watch, daemon=True).start()


def _on_cluster(tasks: Iterable[Task], address: str) -> Iterator[tuple[int, Any]]:
    """The number and the result of each task; few more than can run are given to the cluster at a time."""
    with _connected(address) as client:
        from distributed import KilledWorker, as_completed

        left = enumerate(tasks)
        numbers: dict[Any, int] = {}
        done: Any = as_completed(loop=client.loop)

        def give() -> None:
            enough = 2 * sum(client.nthreads().values())
            for number, task in itertools.islice(left, max(enough - len(numbers), 1)):
                future = client.submit(_run, *task, pure=False)
                numbers[future] = number
                done.add(future)

        give()
        for future in done:
            try:
                result = future.result()
            except KilledWorker as error:
                raise MotiondeckError(f"dask://{address} gave a task up: {error}") from None
            yield numbers.pop(future), result
            give()


def _run(function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> Any:
    """One task on a worker; its threads take turns, as tasks keep robots and networks for the next one."""
    with _one_at_a_time, threadpool_limits(1):
        return function(*args, **kwargs)


def _connected(address: str) -> Any:
    """A client of a cluster whose workers have this version of Motiondeck."""
    try:
        from distributed import Client
    except ImportError:
        raise MotiondeckError('a Dask cluster needs distributed: pip install "motiondeck[cluster]"') from None
    try:
        client: Any = Client(f"tcp://{address}", timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError):
        raise MotiondeckError(
            f"dask://{address}: no Dask scheduler answers there. Start one with: "
            "dask scheduler --host 127.0.0.1 --dashboard-address 127.0.0.1:8787"
        ) from None
    try:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            raise MotiondeckError(
                f"dask://{address}: the cluster has no worker. Start one with: dask worker {address} --nthreads 1"
            ) from None
        ours = version("motiondeck")
        for worker, theirs in client.run(version, "motiondeck", on_error="return").items():
            if theirs != ours:
                raise MotiondeckError(
                    f"dask://{address}: worker {worker} has motiondeck {theirs}, not {ours}. Install the same on both"
                )
    except BaseException:
        client.close()
        raise
    return client
