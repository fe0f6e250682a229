import subprocess
import sys

SWALLOWED = """
import os, signal
from motiondeck_base.early_end import take_signals
take_signals()
try:
    os.kill(os.getpid(), signal.SIGTERM)
except SystemExit:
    print("swallowed", flush=True)
from controller.loop.stop_requests import stop_on_signals
with stop_on_signals():
    print("a run has begun")
"""


def test_a_signal_whose_exception_was_swallowed_ends_the_program_before_a_run_begins():
    done = subprocess.run([sys.executable, "-c", SWALLOWED], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == ("swallowed\n", 143)
    assert done.stderr == "motiondeck: ended by SIGTERM\n"
