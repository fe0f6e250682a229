import subprocess
import sys

import pytest

from waiting import PATIENCE

# A module that takes the interrupt of its import for a missing package, as compiled ones and their callers do.
DEAF = """
import os, signal
try:
    os.kill(os.getpid(), signal.{name})
    for _ in range(1000): pass
except BaseException:
    pass
"""
IMPORTS_IT = """
import sys, time
from motiondeck.cli import main as cli
sys.path.insert(0, sys.argv[1])
def command(**settings):
    import deaf
    time.sleep({seconds})
    print("went on")
cli.command_line = lambda words: command
cli.main()
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_within_an_import_is_not_lost_there(name, code, tmp_path):
    (tmp_path / "deaf.py").write_text(DEAF.format(name=name))
    program = [sys.executable, "-c", IMPORTS_IT.format(seconds=PATIENCE), str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=2 * PATIENCE)
    assert (done.stdout, done.returncode) == ("", code)
    assert done.stderr == ("" if name == "SIGINT" else f"motiondeck: ended by {name}\n")


IN_A_RUN = """
import signal, sys, time
from controller.loop.stop_requests import stop_on_signals
from motiondeck_base.early_end import take_signals
take_signals()
sys.path.insert(0, sys.argv[1])
signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGALRM,))  # the wait ends once the run has begun
import deaf
with stop_on_signals() as stop:
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGALRM,))
    end = time.monotonic() + {seconds}
    while not stop and time.monotonic() < end:
        time.sleep(0.01)
    print(stop.reason)
"""


def test_a_signal_within_the_last_import_before_a_run_stops_that_in_order(tmp_path):
    (tmp_path / "deaf.py").write_text(DEAF.format(name="SIGTERM"))
    program = [sys.executable, "-c", IN_A_RUN.format(seconds=PATIENCE), str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=2 * PATIENCE)
    assert (done.stdout, done.stderr, done.returncode) == ("stopped from outside (SIGTERM)\n", "", 0)
