"""The command line within a test's own process: no interpreter starts, and what it prints is returned."""

import io
import signal
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

from typer.testing import CliRunner

from motiondeck.cli.main import command_line, main


def invoked(*words, **options):
    """How a command ended, as Typer's runner tells it; what it raised is in the result, and no signal is touched."""
    words = [str(word) for word in words]
    return CliRunner().invoke(command_line(words), words, **options)


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
