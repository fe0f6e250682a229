"""Permissions of the operating system for a real-time loop: scheduling, cores, and memory locked in RAM."""

import ctypes
import os
import resource
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from threadpoolctl import threadpool_info, threadpool_limits

FIFO_PRIORITY = 60  # above the kernel's threaded interrupts (50), below its watchdogs (99)
_MCL_CURRENT, _MCL_FUTURE = 1, 2


@dataclass(frozen=True)
class Permission:
    """A request to the operating system, whether it was granted, and the remedy where it was not."""

    name: str
    granted: bool
    remedy: str = ""


def permission_lines(permissions: Sequence[Permission]) -> list[str]:
    """At most two lines: all that was granted, and all that was not, with its remedies."""
    granted = ", ".join(one.name for one in permissions if one.granted)
    refused = " ".join(f"{one.name}. {one.remedy}" for one in permissions if not one.granted)
    return [f"{what}: {names}" for what, names in (("granted", granted), ("not permitted", refused)) if names]


@contextmanager
def handed_back() -> Iterator[None]:
    """Restores the scheduling and the cores of this thread after the block, and unlocks the memory."""
    try:
        policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
        cores = os.sched_getaffinity(0)
    except (AttributeError, OSError):
        yield
        return
    try:
        yield
    finally:
        with suppress(OSError):
            if os.sched_getaffinity(0) != cores:
                os.sched_setaffinity(0, cores)
            if os.sched_getscheduler(0) != policy:
                os.sched_setscheduler(0, policy, parameters)
                ctypes.CDLL(None).munlockall()


def request_realtime(priority: int = FIFO_PRIORITY) -> list[Permission]:
    """Requests SCHED_FIFO for this thread, at a priority of 1 to 99, and locked memory; what was granted. Never raises.

    Start other processes before: they would inherit the scheduling.
    """
    return [_first_in_first_out(priority), _locked_memory()]


def request_core(core: int) -> Permission:
    """Requests that this thread runs on one core only; never raises, but returns whether that was granted."""
    name = f"core {core} (CPU affinity)"
    available: list[int] = []
    try:
        available = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {core})
    except AttributeError:
        return Permission(name, False, "This system has no CPU affinity.")
    except (OSError, ValueError, OverflowError):
        return Permission(name, False, f"There are cores {', '.join(map(str, available))}.")
    return Permission(name, True)


def leave_core(core: int) -> None:
    """Keeps this thread, and the processes it starts from now on, off a core, if there are others."""
    with suppress(AttributeError, OSError):
        others = os.sched_getaffinity(0) - {core}
        if others:
            os.sched_setaffinity(0, others)


def request_one_blas_thread() -> Permission:
    """Requests one thread for linear algebra: two wait for each other and cost milliseconds now and then."""
    threadpool_limits(1, "blas")
    most = max((int(pool["num_threads"]) for pool in threadpool_info() if pool["user_api"] == "blas"), default=1)
    return Permission("one BLAS thread", most == 1, "Set OPENBLAS_NUM_THREADS=1 (or MKL_NUM_THREADS=1).")


def _first_in_first_out(priority: int) -> Permission:
    name = "real-time scheduling (SCHED_FIFO)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError):
        return Permission(name, False, f"Allow it with 'ulimit -r {priority}' (limits.conf: rtprio) or CAP_SYS_NICE.")
    return Permission(name, True)


def _locked_memory() -> Permission:
    name = "memory locked in RAM (mlockall)"
    remedy = "Allow it with 'ulimit -l unlimited' (limits.conf: memlock) or CAP_IPC_LOCK."
    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY or os.geteuid() == 0
    # Under a limit, locking future memory as well would make every later allocation beyond it fail.
    flags = _MCL_CURRENT | (_MCL_FUTURE if unlimited else 0)
    try:
        granted = ctypes.CDLL(None, use_errno=True).mlockall(flags) == 0
    except (AttributeError, OSError):
        granted = False
    return Permission(name, granted, "" if granted else remedy)
