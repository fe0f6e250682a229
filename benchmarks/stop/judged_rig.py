"""An emulated rig behind a relay, and decks that play on it: processes, ports, signals, and nothing of the project."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from benchmarks.stop.bus_relay import ENTRY, LOST, TO_SERVOS, slowest_handover
from benchmarks.stop.goal_frames import GOAL_POSITION, FrameReader, goals_in
from benchmarks.stop.goal_judge import Joints, joints_of

ROOT = Path(__file__).parents[2]
ROBOT, RIG = ROOT / "configs" / "robots" / "servo20.toml", ROOT / "configs" / "rigs" / "servo20.toml"
MOTIONDECK = (sys.executable, "-m", "motiondeck.cli.main")
PATIENCE = 60.0  # s
_HANDED_OVER = 0.008  # s
FAST = 2.0  # rad/s; an approach is slower, a motion faster


class JudgedRig:
    """The emulated servos and the relay to them.

    Attributes:
        joints: what robot and rig file say.
        file: a rig file whose port is the relay's.
        bus, shafts: the records.
    """

    def __init__(self, folder: Path) -> None:
        self.joints: Joints = joints_of(ROBOT, RIG)
        self.bus, self.shafts = folder / "bus.record", folder / "shafts.record"
        self._emulator = subprocess.Popen(
            [*MOTIONDECK, "rig", "emulate", str(RIG), "--record", str(self.shafts)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
        )
        with contextlib.suppress(OSError):  # servos answer in time on a busy machine too
            os.sched_setscheduler(self._emulator.pid, os.SCHED_FIFO, os.sched_param(40))
        baud = re.search(r"^baud = ([\d_]+)", RIG.read_text(), re.M)
        command = "from benchmarks.stop.bus_relay import main; main()"
        self._relay = subprocess.Popen(
            [sys.executable, "-c", command, _line_of(self._emulator), baud[1].replace("_", ""), str(self.bus)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            cwd=ROOT,
        )
        self.file = folder / "rig.toml"
        port = _line_of(self._relay)
        self.file.write_text(re.sub(r'^port = ".*"', f'port = "{port}"', RIG.read_text(), flags=re.M))
        self._read, self._reader = 0, FrameReader()
        self._goals: dict[int, int] = {}
        self._at = 0

    def __enter__(self) -> JudgedRig:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for process in (self._relay, self._emulator):
            process.kill()
            process.wait()

    def forget(self) -> None:
        """Empties the record of the bus."""
        os.truncate(self.bus, 0)
        self._read, self._reader = 0, FrameReader()

    def disturbed(self, start: float, end: float) -> bool:
        """Whether this machine was too busy between two times, s, to hand frames over when they were sent."""
        return slowest_handover(self.bus, start, end) > _HANDED_OVER

    def cut(self) -> None:
        """Cuts the bus."""
        self._say("cut")

    def join(self) -> None:
        """Joins it again."""
        self._say("join")

    def speed(self) -> float:
        """The largest speed of a goal since the last call, rad/s; 0 without frames."""
        with self.bus.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        at, fastest = 0, 0.0
        joints = self.joints
        address_of = {id: GOAL_POSITION[model] for id, model in zip(joints.ids, joints.models, strict=True)}
        pulse = dict(zip(joints.ids, joints.pulse.tolist(), strict=True))
        while at + ENTRY.size <= len(data):
            now, way, length = ENTRY.unpack_from(data, at)
            if at + ENTRY.size + length > len(data):
                break
            if way in (TO_SERVOS, TO_SERVOS + LOST):
                for frame in self._reader.feed(data[at + ENTRY.size : at + ENTRY.size + length]):
                    goals = goals_in(*frame, address_of)
                    passed = max(1e-9 * (now - self._at), joints.period)
                    ways = [abs(goals[id] - self._goals.get(id, goals[id])) * pulse[id] for id in goals]
                    fastest = max([fastest, *(way / passed for way in ways)])
                    if goals:
                        self._at = now
                        self._goals.update(goals)
            at += ENTRY.size + length
        self._read += at
        return fastest

    def _say(self, word: str) -> None:
        assert self._relay.stdin is not None
        self._relay.stdin.write(f"{word}\n")
        self._relay.stdin.flush()


class JudgedDeck:
    """A deck that plays a motion on a judged rig, and whatever processes it starts."""

    def __init__(
        self, rig: JudgedRig, folder: Path, motion: str, *options: str, program: tuple[str, ...] = MOTIONDECK
    ) -> None:
        """Starts it; `{folder}` in an option stands for the folder, and `program` runs the command line."""
        self.rig, self.folder = rig, folder
        self.environment = os.environ | {"TMPDIR": str(folder), "XDG_RUNTIME_DIR": str(folder)}
        folder.chmod(0o700)
        words = ("play", motion, "--robot", str(ROBOT), "--rig", str(rig.file), "--kinematic", *options)
        rig.speed()
        self.said = (folder / "said").open("a+")
        self.process = subprocess.Popen(
            [*program, *(word.replace("{folder}", str(folder)) for word in words)],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=self.said,
            stderr=self.said,
            start_new_session=True,
            cwd=ROOT,
        )

    def __enter__(self) -> JudgedDeck:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.end()

    def plays(self, patience: float = PATIENCE) -> None:
        """Waits until the joints move as in a motion; a deck that has ended or does not play raises RuntimeError."""
        deadline = time.monotonic() + patience
        while self.rig.speed() < FAST:
            if self.process.poll() is not None or time.monotonic() > deadline:
                self.said.seek(0)
                raise RuntimeError(f"the deck does not play: {self.said.read()[-2000:]}")
            time.sleep(0.02)

    def signal(self, number: signal.Signals) -> float:
        """Sends a signal to the deck alone; the time just before, s."""
        at = time.monotonic()
        self.process.send_signal(number)
        return at

    def processes(self, module: str = "") -> list[int]:
        """The processes of this deck (not the rig's), or those with these words on their command line."""
        found: list[int] = []
        for place in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                ours = f"TMPDIR={self.folder}\0".encode() in (place / "environ").read_bytes()
                words = (place / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                if ours and module in words and " Z " not in (place / "stat").read_text():
                    found.append(int(place.name))
        return found

    def end(self) -> None:
        """Ends all of its processes."""
        for number, waits in ((signal.SIGTERM, 0.3), (signal.SIGKILL, 2.0)):
            if self.process.poll() is None:
                self.process.send_signal(signal.SIGCONT)
            for process in self.processes():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL if process == self.process.pid else number)
            until(lambda: not self.processes(), waits)
        self.process.wait()
        self.said.close()


def until(condition: Callable[[], object], seconds: float) -> bool:
    """Whether the condition came true within some seconds."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _line_of(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    line = process.stdout.readline().strip()
    if not line:
        raise RuntimeError(f"{process.args} did not start")
    return line
