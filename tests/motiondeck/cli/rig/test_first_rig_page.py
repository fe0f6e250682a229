"""The first-rig page, typed line by line into terminals as it stands, with emulated servos and emulated hands."""

import fcntl
import os
import pty
import re
import select
import shutil
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest

from waiting import tried, until

PAGE = Path(__file__).parents[4] / "docs" / "first-rig.md"
PROMPT = "typed-here$ "
ESCAPES = re.compile(r"\x1b(\[[0-9;?]*[A-Za-z]|[78])")


class Terminal:
    """A shell on a pseudo-terminal."""

    def __init__(self, folder):
        self.heard = ""
        self._master, slave = pty.openpty()
        scripts = Path(sys.executable).parent
        environment = os.environ | {
            "PATH": f"{scripts}:{os.environ['PATH']}", "PS1": PROMPT, "TERM": "dumb", "HOME": str(folder),
            "XDG_RUNTIME_DIR": str(folder),
        }  # fmt: skip
        self._shell = subprocess.Popen(
            [shutil.which("bash"), "--norc", "--noprofile"], stdin=slave, stdout=slave, stderr=slave, cwd=folder,
            env=environment, start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )  # fmt: skip
        os.close(slave)
        self.wait_for(PROMPT)

    def type(self, line):
        os.write(self._master, line.encode() + b"\n")

    def wait_for(self, text, seconds=60.0):
        """Waits until a text is shown; what stood before it. Later calls look behind it."""
        deadline = time.monotonic() + seconds
        while text not in self.heard:
            if not select.select([self._master], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise AssertionError(f"no {text!r} within {seconds:g} s, but:\n{self.heard[-3000:]}")
            self.heard = ESCAPES.sub("", self.heard + os.read(self._master, 65536).decode(errors="replace"))
        before, _, self.heard = self.heard.partition(text)
        return before

    def line(self):
        """The rest of the line that is being printed."""
        return self.wait_for("\n")

    def run(self, line):
        """Types a command and waits for its end; it must succeed. What it printed."""
        for part in line.split("\n"):
            self.type(part)
        said = self.wait_for(PROMPT)
        self.type("echo ended with $?")
        self.wait_for("ended with $?")
        self.wait_for("ended with ")
        status = self.wait_for(PROMPT)
        assert status.strip() == "0", f"{line}\n{said}"
        return said

    def close(self):
        os.write(self._master, b"\x03")
        time.sleep(0.1)
        self._shell.kill()
        self._shell.wait()
        os.close(self._master)


def blocks(page):
    """(terminal, lines) of the page's blocks in which something is typed."""
    found = re.findall(r"^```sh terminal-(\d)\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    return [(int(number), body.splitlines()) for number, body in found]


def converse(terminal, hands, lines):
    """Answers a command as a transcript says: text to wait for, what is typed behind », hands in parentheses."""
    for line in lines:
        if pause := re.fullmatch(r"\(for (\d+) seconds\)", line):
            time.sleep(int(pause[1]))
        elif line.startswith("("):
            hands.type(line.strip("()"))
            time.sleep(float(line.rstrip(")").split()[-1]) + 0.1 if " in " in line else 0.05)
        else:
            expected, answers, typed = line.partition("»")
            if expected.strip():
                terminal.wait_for(expected.strip())
            if answers:
                terminal.type(typed.strip())


def swings(emulator, seconds):
    """How far each joint really goes in so many seconds, rad, and how often it turns back."""
    places, deadline = [], time.monotonic() + seconds
    while time.monotonic() < deadline:
        emulator.type("where")
        emulator.wait_for("where")
        places.append(
            [float(number) for number in re.findall(r"[+-]\d\.\d+", emulator.wait_for("tilt") + emulator.line())]
        )
        time.sleep(0.03)
    places = np.array(places)
    way = np.diff(places, axis=0)
    moving = [column[np.abs(column) > 0.01] for column in way.T]
    return np.ptp(places, axis=0), [int((np.diff(np.sign(column)) != 0).sum()) for column in moving]


@pytest.mark.documented
def test_a_taught_wave_loops_and_switches_to_a_taught_nod(tmp_path):
    typed = blocks(PAGE)[:6]
    assert [number for number, _ in typed] == [1, 2, 2, 2, 2, 3]
    terminals = {number: Terminal(tmp_path) for number in (1, 2, 3)}
    emulator = terminals[1]
    try:
        emulator.type(typed[0][1][0])
        emulator.wait_for("commands:")
        emulator.line()
        for number, (first, *rest) in typed[1:-1]:
            if any("»" in line for line in rest):
                terminals[number].type(first)
                converse(terminals[number], emulator, rest)
                terminals[number].wait_for(PROMPT)
                continue
            for line in (first, *rest):
                if "motiondeck play" in line:
                    terminals[number].type(line)
                else:
                    terminals[number].run(line)
        until(lambda: swings(emulator, 0.5)[0][0] >= 0.35, "the wave")

        def waves():
            reach, turns = swings(emulator, 2.4)  # longer than what was taught
            assert reach == pytest.approx([0.4, 0.0], abs=0.08)
            assert turns[0] >= 4

        tried(waves)
        switch, stop = typed[-1][1]
        terminals[3].run(switch)
        time.sleep(0.8)

        def nods():
            reach, turns = swings(emulator, 1.4)
            assert reach == pytest.approx([0.05, 0.4], abs=0.08)
            assert turns[1] >= 2

        tried(nods)
        terminals[3].run(stop)
        assert "stopped on command" in terminals[2].wait_for(PROMPT)
    finally:
        for terminal in terminals.values():
            terminal.close()


@pytest.mark.documented
def test_a_written_head_plays_what_was_written_and_its_mirror_image(tmp_path):
    typed = blocks(PAGE)[6:]
    assert [number for number, _ in typed] == [1, 2, 3]
    terminals = {number: Terminal(tmp_path) for number in (1, 2, 3)}
    emulator = terminals[1]
    try:
        *copied, emulate = typed[0][1]
        for line in copied:
            emulator.run(line)
        emulator.type(emulate)
        emulator.wait_for("commands:")
        emulator.line()
        commands = re.findall(r"^(?:cat .*?^END|.*?)$", "\n".join(typed[1][1]), flags=re.M | re.S)
        for line in commands[:-1]:
            terminals[2].run(line)
        terminals[2].type(commands[-1])
        switch, stop = typed[2][1]
        wait_for_neck(emulator, lambda pan: pan > 0.4)  # it looks to the left by 32 degrees
        terminals[3].run(switch)
        wait_for_neck(emulator, lambda pan: pan < -0.38)  # shy is 25 degrees to the left
        wait_for_neck(emulator, lambda pan: abs(pan) < 0.03)
        time.sleep(1.0)
        wait_for_neck(emulator, lambda pan: abs(pan) < 0.03)  # it holds its end
        terminals[3].run(stop)
        assert "stopped on command" in terminals[2].wait_for(PROMPT)
    finally:
        for terminal in terminals.values():
            terminal.close()


def wait_for_neck(emulator, reached):
    """Waits until the emulated shaft of neck_pan is there."""
    deadline = time.monotonic() + 30.0
    while True:
        emulator.type("where")
        emulator.wait_for("neck_pan")
        pan = float(re.search(r"[+-]\d\.\d+", emulator.line())[0])
        if reached(pan):
            return
        assert time.monotonic() < deadline
        time.sleep(0.03)
