"""Tasks in processes of this machine: they end with the program that started them."""

import os
import signal
import subprocess
import sys

import pytest
from joblib import delayed

from motiondeck_base.jobs import Jobs, spread
from waiting import runs, until

PROGRAM = """
import pathlib, sys, time, os
from joblib import delayed
from motiondeck_base.jobs import Jobs, spread
pathlib.Path(sys.argv[1], str(os.getpid())).touch()
list(spread((delayed(os.system)(f"echo > {sys.argv[1]}/$PPID; sleep 60") for _ in range(2)), Jobs(2)))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process does not see there that its parent has ended")
def test_processes_end_when_their_parent_is_killed(tmp_path):
    parent = subprocess.Popen([sys.executable, "-c", PROGRAM, str(tmp_path)], start_new_session=True)
    try:
        until(lambda: len(list(tmp_path.iterdir())) == 3, "the processes")
        workers = [int(file.name) for file in tmp_path.iterdir() if int(file.name) != parent.pid]
        parent.kill()
        parent.wait()
        until(lambda: not any(map(runs, workers)), "their end")
    finally:
        os.killpg(parent.pid, signal.SIGKILL)


@pytest.mark.thorough
def test_an_interrupt_does_not_reach_the_processes():
    interrupted = (delayed(signal.raise_signal)(signal.SIGINT) for _ in range(4))
    assert list(spread(interrupted, Jobs(2))) == [None] * 4
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


WITHOUT_SHARED_MEMORY = """
import os, _multiprocessing
def refused(*arguments, **named):
    raise OSError(30, "Read-only file system")
_multiprocessing.SemLock, allowed = refused, os.access
os.access = lambda path, mode: path != "/dev/shm" and allowed(path, mode)
from motiondeck.cli.main import command_line
command_line()
from joblib import delayed
from motiondeck_base.jobs import EVERY_CORE, spread
print(sorted(spread([delayed(abs)(-1), delayed(abs)(2)], EVERY_CORE)))
"""


@pytest.mark.thorough
def test_without_shared_memory_one_process_computes_and_one_line_says_why():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_SHARED_MEMORY], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.stdout == "[1, 2]\n"
    assert done.stderr == "motiondeck: one core computes, as /dev/shm is not writable. Mount a tmpfs there\n"
