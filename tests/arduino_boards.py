"""The exported Arduino library of a made-up figure, and boards that run its sketches: stubs, no real board."""

import os
import pty
import subprocess
import tty
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE
from threading import Event, Thread

from benchmarks.export._c_player import wide
from hardware.bus.port import SerialPort
from hardware.rig.rig_file import load_rig
from joint_libraries import joint_library
from motiondeck.export.c_folder import write_arduino
from motiondeck.export.figure import figure_of
from motiondeck.run.robots.rig_on_deck import robot_of
from waiting import PATIENCE

STUB = Path(__file__).parent / "motiondeck/export/arduino_stub"
RIG = """
port = "/dev/ttyUSB0"
baud = 1_000_000
rate_hz = 100
[[joints]]
name = "joint0"
id = 1
direction = 1
zero = 2048

[[joints]]
name = "joint1"
id = 2
direction = -1
zero = 2000
second = { id = 7, direction = 1, zero = 2100 }

[[joints]]
name = "joint2"
id = 4
direction = 1
zero = 2048
"""
ALIKE = 'model = "XM430-W350"\nlower = -3.0\nupper = 3.0\nvelocity = 4.7\n'


def written(folder):
    """The rig file."""
    file = folder / "rig.toml"
    file.write_text(RIG.replace("[[joints]]\n", f"[[joints]]\n{ALIKE}"))
    return file


def exported(rig, folder, *, limited=False, fixed=False):
    """The figure of the rig, with limits that hold nothing back unless it is `limited`; its library in the folder."""
    library = joint_library(3)
    body = robot_of(rig, library.skeleton)
    figure = figure_of(library, body.joints, body.limits, body.rest, 100.0, fixed=fixed)
    figure = figure if limited else wide(figure)
    write_arduino(figure, load_rig(rig), folder)
    return figure


def compiled(folder, sketch, place):
    """The program of a board with a sketch of the library in a folder."""
    strict = ["-Wall", "-Wextra", "-Werror", "-O1", f"-I{folder / 'src'}"]
    for source in (folder / "src").glob("*.c*"):
        language = ["c++", "-std=gnu++17"] if source.suffix == ".cpp" else ["cc", "-std=gnu11"]
        subprocess.run([*language, *strict, "-c", source, "-o", place / f"{source.stem}.o"], check=True)
    board, objects = place / "board", [place / "motiondeck.o", place / "commands.o"]
    sources = ["-include", STUB / "Arduino.h", folder / f"examples/{sketch}/{sketch}.ino", STUB / "board.cpp"]
    sources = ["-x", "c++", *sources, "-x", "none"]
    command = ["c++", "-std=gnu++17", *strict, f"-I{STUB}", *sources, *objects, "-o", board, "-lm"]
    subprocess.run(command, check=True)
    return board


class BoardPort:
    """A port to a board on a pseudo-terminal; its time is the board's, which stands still but for `wait` and `run`."""

    def __init__(self, port, board):
        self.name, self._port, self._board = port.name, port, board
        self._sent = self._come = 0
        self._time, self._received = 0.0, b""
        self.damage = self.lose = lambda data: data  # what the line makes of what is sent, and received
        self.dead = False  # whether the board does nothing any more
        self.said = []  # what its servos, or the maker's library, print
        self.written = b""  # by the board, whether the line loses it or not

    def now(self):
        return self._time

    def send(self, data):
        data = self.damage(data)
        self._sent += len(data)
        return self._port.send(data)

    def receive(self, likely=False):
        received, self._received = self._received, b""
        return received

    def wait(self, seconds):
        for _ in range(max(1, round(seconds / 0.01))):
            if self._received:
                break
            self.run()
        return bool(self._received)

    def close(self):
        pass

    def harm(self, servo, kind):
        """Makes a servo silent ("s") or in alarm ("a"), or well ("w")."""
        self._tell(f"harm {servo} {kind}")

    def run(self):
        """Lets a tick pass, and takes all that the board has sent by then."""
        self._time += 0.01
        if self.dead:
            return
        self._tell(f"run 1 {self._sent}")
        while not (line := self._board.stdout.readline().strip()).isdigit():
            assert line, "the board has ended"
            self.said.append(line)
        while self._come < int(line):
            assert self._port.wait(PATIENCE), "the terminal has lost bytes"
            data = self._port.receive()
            self._come += len(data)
            self.written += data
            self._received += self.lose(data)

    def _tell(self, text):
        self._board.stdin.write(text + "\n")
        self._board.stdin.flush()


@contextmanager
def board_port(program):
    """A board that runs a program, behind its port."""
    master, slave = pty.openpty()
    port = SerialPort(os.ttyname(slave), 115200)
    command = [program, "pty", str(master)]
    with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, text=True, pass_fds=[master]) as board:
        yield BoardPort(port, board)
        board.stdin.close()
    port.close()
    os.close(slave)
    os.close(master)


@contextmanager
def running_board(program):
    """The port of a board that runs a program by itself, a tick every 10 ms, and what its servos have printed."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    command, ended, said = [program, "pty", str(master)], Event(), []
    with subprocess.Popen(command, stdin=PIPE, stdout=PIPE, text=True, pass_fds=[master]) as board:

        def pace():
            while not ended.wait(0.01):
                board.stdin.write("run 1 0\n")
                board.stdin.flush()
                while not (line := board.stdout.readline().strip()).isdigit():
                    assert line, "the board has ended"
                    said.append(line)

        pacing = Thread(target=pace)
        pacing.start()
        try:
            yield os.ttyname(slave), said
        finally:
            ended.set()
            pacing.join()
            board.stdin.close()
    os.close(slave)
    os.close(master)
