"""Tasks in processes of this machine: they end with the program that started them."""

import os
import shutil
import signal
import subprocess
import sys

import pytest

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
def test_without_shared_memory_one_process_computes_and_one_line_says_why():
    program = (
        "from motiondeck.cli.main import app; app\nfrom joblib import delayed\n"
        "from motiondeck_base.jobs import EVERY_CORE, spread\n"
        "print(sorted(spread([delayed(abs)(-1), delayed(abs)(2)], EVERY_CORE)))"
    )
    alone = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
    hidden = [*alone, 'mount -t tmpfs -o ro none /dev/shm || exit 77; exec "$@"', "sh"]
    if not shutil.which("unshare"):
        pytest.skip("unshare is not installed")
    done = subprocess.run([*hidden, sys.executable, "-c", program], capture_output=True, text=True, timeout=100)
    if done.returncode and "Traceback" not in done.stderr:
        pytest.skip("this machine lets no user mount a folder of his own")
    assert done.stdout == "[1, 2]\n"
    assert done.stderr == "motiondeck: one core computes, as /dev/shm is not writable. Mount a tmpfs there\n"
