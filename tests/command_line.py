"""The command line within a test's own process: no interpreter starts, and what it prints is returned."""

import io
import signal
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

from controller.cli.main import main


def motiondeck(*words):
    """Runs a command to its end; exit code and output as `subprocess.run` gives them."""
    out, errors, code = io.StringIO(), io.StringIO(), 0
    arguments, interrupt = sys.argv, signal.getsignal(signal.SIGINT)
    sys.argv = ["motiondeck", *map(str, words)]
    try:
        with redirect_stdout(out), redirect_stderr(errors):
            main()
    except SystemExit as end:
        code = end.code or 0
    finally:
        sys.argv = arguments
        signal.signal(signal.SIGINT, interrupt)
    return subprocess.CompletedProcess(sys.argv, code, out.getvalue(), errors.getvalue())
