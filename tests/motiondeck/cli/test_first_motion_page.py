"""The page on one's first motion, pasted line by line into a fresh folder."""

import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from command_line import invoked

PAGE = Path(__file__).parents[3] / "docs" / "first-motion.md"
BLOCK = re.compile(r"^```(sh|text)\n(.*?)^```", re.M | re.S)


def pasted(line):
    """What a line prints; it must succeed. A deck with a page is watched until it plays, and interrupted."""
    words = shlex.split(line)
    if words[0] != "motiondeck":
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        return done.stdout
    if words[1] == "play" and "--headless" not in words:
        return interrupted([sys.executable, "-m", *words, "--port", "0"])
    result = invoked(*words[1:])
    assert result.exit_code == 0, (line, result.output, result.exception)
    return result.output


def interrupted(command, seconds=60.0):
    """What a command prints until it names its page; Ctrl-C then ends it well."""
    started = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        deadline, said = time.monotonic() + seconds, ""
        while "http://127.0.0.1" not in said and time.monotonic() < deadline:
            said += started.stdout.readline()
        assert "http://127.0.0.1" in said, said
        started.send_signal(signal.SIGINT)
        said += started.communicate(timeout=seconds)[0]
        assert started.returncode == 0, said
        return said
    finally:
        started.kill()
        started.wait()


def like(expected):
    """A pattern for a printed line: the same words, and a number where there is one."""
    words = (
        re.escape(word) if not word[0].isdigit() else r"[\d.]+" for word in re.findall(r"[\d.]+|[^\d\s]+", expected)
    )
    return re.compile(r"\s*".join(words))


@pytest.mark.documented
def test_a_recording_comes_to_a_robot_as_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    typed, said = [], ""
    for kind, body in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        lines = [line for line in body.splitlines() if line]
        if kind == "sh":
            said = "".join(pasted(line) for line in lines)
            typed += lines
        else:
            for line in lines:
                assert like(line).search(said), (line, said)
    assert [line.split()[1] for line in typed if line.startswith("motiondeck")] == [
        "examples", "clip", "learn", "play", "play", "learn", "clip", "library",
    ]  # fmt: skip
