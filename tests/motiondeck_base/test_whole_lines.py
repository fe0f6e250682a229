"""Each line of a program and of the processes beside it is one write, so that lines of two never mix."""

import io
import os
import subprocess
import sys
from select import PIPE_BUF

import pytest

PARENT = """
import subprocess, sys
from motiondeck_base.whole_lines import print_whole_lines
print_whole_lines()
print("one", file=sys.stderr)
print("two" * 2000, "and more", file=sys.stdout)  # longer than a pipe takes at once
subprocess.run([sys.executable, "-c", "import sys; print('three', file=sys.stderr)"])
"""


def written(command):
    """What a program whose standard output and error are unbuffered writes to them, write by write."""
    end, start = os.pipe2(os.O_DIRECT)  # a read gives what one write wrote
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    program = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=start, stderr=start, env=environment)
    os.close(start)
    with io.FileIO(end) as writes:
        parts = [*iter(lambda: writes.read(65536), b"")]  # until all processes have ended
    assert program.wait(60.0) == 0, parts
    words = [b""]
    for part in parts:
        words[-1] += part
        words += [b""] * (len(part) < PIPE_BUF)  # the pipe itself divides what is longer
    return [word.decode() for word in words if word]


def test_a_program_and_its_child_write_whole_lines():
    assert written([sys.executable, "-c", PARENT]) == ["one\n", f"{'two' * 2000} and more\n", "three\n"]


SCRIPT = "import motiondeck\nwith motiondeck.play(motion='walk', page=True, seconds=2.0) as deck:\n    deck.wait()"
PLAY = (
    "play walk --robot servo20 --rig emulated --record run.rec --realtime --seconds 2 --port 0 --command-port 0 --json"
)


@pytest.mark.thorough
@pytest.mark.parametrize("command", [["-m", "motiondeck", *PLAY.split()], ["-c", SCRIPT]], ids=["command", "script"])
def test_a_deck_and_what_is_beside_it_write_whole_lines(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    lines = written([sys.executable, *command])
    assert any(line.startswith("page: http://127.0.0.1:") for line in lines)
    assert [line for line in lines if not line.endswith("\n")] == []
