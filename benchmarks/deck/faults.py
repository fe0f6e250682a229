"""When something around a deck breaks: what is said, exit code, what is left.

Each row is a run of `play` on a simulated robot in a temporary folder of its own, with one fault: no room for what the
processes share, a full disk of the recording, a home that cannot be written, a process killed or stopped for a while, a
signal at some moment from launch on, a second deck, the socket of a killed one, a closed terminal. `left` are processes
that outlived the deck by five seconds and folders that are still there after the next start. While Python is starting,
before our first line, the system itself ends the program without a word; /proc tells whether it has come so far. Full
folders are small tmpfs, and a home that cannot be written is a tmpfs mounted for reading only; where mounting is not
permitted the row says so, and stand-ins for them (a limit for the size of files, /dev/full) remain. The exit code of
this program is 1 if a row is not as it must be.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import resource
import signal
import subprocess
import sys
import tempfile
import termios
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.command import run
from controller.wire.run_folder import run_folder

PATIENCE = 90.0  # s
LEAVES_WITHIN = 5.0  # s


@dataclass
class Outcome:
    """What became of a run."""

    fault: str
    said: str
    code: int
    left: list[str]
    good: bool


class Run:
    """A deck with a folder of its own for all that it leaves; `{folder}` in an option stands for it."""

    def __init__(self, folder: Path, *options: str, terminal: int | None = None, **environment: str) -> None:
        """Starts it; `terminal` is the one that it runs in."""
        self.folder = folder
        self.environment = os.environ | {"TMPDIR": str(folder), "XDG_RUNTIME_DIR": str(folder)} | environment
        self.process = self._start(*options, terminal=terminal)

    def _start(self, *options: str, terminal: int | None = None) -> subprocess.Popen[str]:
        words = ("play", "--kinematic", "--seconds", "3", "--command-port", "7000", *options)
        words = tuple(word.replace("{folder}", str(self.folder)) for word in words)
        limited = "no room" in options
        return subprocess.Popen(
            [sys.executable, "-m", "motiondeck.cli.main", *(word for word in words if word != "no room")],
            env=self.environment,
            stdin=subprocess.DEVNULL if terminal is None else terminal,
            stdout=subprocess.PIPE if terminal is None else terminal,
            stderr=subprocess.STDOUT if terminal is None else subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=_small_files if limited else _take_terminal if terminal is not None else None,
        )

    def second(self, *options: str) -> tuple[str, int]:
        """Another deck beside this one; what it says, and its exit code."""
        other = self._start("--headless", *options)
        return _last_line(other.communicate(timeout=PATIENCE)[0]), other.returncode

    def plays(self) -> None:
        """Waits until the deck takes commands, and a moment more."""
        socket = self.folder / "motiondeck" / "7000"
        deadline = time.monotonic() + PATIENCE
        while not socket.exists() and self.process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(2.0)

    def processes(self, module: str = "") -> list[int]:
        """The processes of this run, or those of one module."""
        found: list[int] = []
        for place in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                ours = f"TMPDIR={self.folder}\0".encode() in (place / "environ").read_bytes()
                if ours and module in (place / "cmdline").read_text() and " Z " not in (place / "stat").read_text():
                    found.append(int(place.name))
        return found

    def takes(self, number: signal.Signals) -> bool:
        """Whether the deck has a handler of its own for a signal."""
        status = (Path("/proc") / str(self.process.pid) / "status").read_text()
        caught = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
        return bool(int(caught.split()[1], 16) >> (number - 1) & 1)

    def send(self, module: str, number: signal.Signals) -> None:
        """Sends a signal to the processes of a module."""
        for process in self.processes(module):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, number)

    def end(self, fault: str, codes: tuple[int, ...], words: str) -> Outcome:
        """Waits for the end; whether the exit code is one of these, and the words were said."""
        try:
            said = "".join(text for text in self.process.communicate(timeout=PATIENCE) if text)
        except subprocess.TimeoutExpired:
            self.send("", signal.SIGKILL)
            self.process.wait()
            return Outcome(fault, f"it has not ended within {PATIENCE:g} s", self.process.returncode, [], False)
        deadline = time.monotonic() + LEAVES_WITHIN
        while self.processes() and time.monotonic() < deadline:
            time.sleep(0.1)
        left = [f"{len(self.processes())} processes"] if self.processes() else []
        self.send("", signal.SIGKILL)
        tempfile.tempdir = str(self.folder)
        with run_folder():  # as the next start does
            pass
        tempfile.tempdir = None
        left += [file.name for file in self.folder.glob("motiondeck-*")]
        lines = [line for line in said.splitlines() if words in line]
        code = self.process.returncode
        good = code in codes and (bool(lines) or not words) and not left
        return Outcome(fault, lines[-1] if lines else _last_line(said), code, left, good)


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))


def _take_terminal() -> None:
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[bool]:
    """A small tmpfs in a folder; whether it may be mounted."""
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "motiondeck-fault", folder], capture_output=True)
    try:
        yield made.returncode == 0
    finally:
        if made.returncode == 0:
            subprocess.run(["umount", "-l", folder], check=True)


def _last_line(said: str) -> str:
    return next(reversed([line for line in said.splitlines() if line.strip()]), "")


@contextlib.contextmanager
def started(*options: str, terminal: int | None = None, **environment: str) -> Iterator[Run]:
    """A run that is over after the block, whatever happened."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        one = Run(Path(folder), *options, terminal=terminal, **environment)
        try:
            yield one
        finally:
            one.send("", signal.SIGKILL)
            one.process.wait()


def no_room() -> Outcome:
    with started("--headless", "--record", "/dev/null", "no room") as one:
        return one.end("no room in TMPDIR (or /dev/shm, if that is it)", (1,), "no room for")


def full_disk() -> Outcome:
    with started("--headless", "--record", "/dev/full") as one:
        return one.end("disk of the recording full", (1,), "/dev/full: cannot be written")


def on_tmpfs(fault: str, options: str, start: Callable[[Path], Outcome]) -> Outcome:
    """A row for which a tmpfs is mounted, or says that it may not be."""
    with tempfile.TemporaryDirectory() as folder, mounted(Path(folder), options) as may:
        return start(Path(folder)) if may else Outcome(fault, "skipped: mounting is not permitted here", 0, [], True)


def full_tmpfs() -> Outcome:
    fault = "TMPDIR on a full tmpfs"

    def start(folder: Path) -> Outcome:
        (folder / "full").write_bytes(b" " * 60_000)
        with started("--port", "0", TMPDIR=str(folder)) as one:
            found = one.end(fault, (1,), "no room")
        found.left += [file.name for file in folder.glob("motiondeck*")]
        found.good &= not found.left
        return found

    return on_tmpfs(fault, "size=64k", start)


def full_recording() -> Outcome:
    fault = "tmpfs of the recording fills up in the run"

    def start(folder: Path) -> Outcome:
        with started("--headless", "--record", str(folder / "run.rec")) as one:
            found = one.end(fault, (1,), "run.rec: cannot be written (No space left on device)")
        # What was written before is readable.
        shown = subprocess.run(
            [sys.executable, "-m", "motiondeck.cli.main", "replay", str(folder / "run.rec"), "--headless"],
            capture_output=True,
            text=True,
        )
        found.good &= shown.returncode == 0
        return found

    return on_tmpfs(fault, "size=256k", start)


def read_only_home() -> Outcome:
    fault = "home mounted for reading only"

    def start(folder: Path) -> Outcome:
        with started("--headless", HOME=str(folder)) as one:
            return one.end(fault, (0,), "played to the end")

    return on_tmpfs(fault, "size=64k,ro", start)


def closed_terminal() -> Outcome:
    """The window of the terminal in which a deck with its prompt runs is closed."""
    ours, theirs = pty.openpty()
    with started("--port", "0", "--seconds", "60", terminal=theirs) as one:
        os.close(theirs)
        one.plays()
        os.close(ours)
        return one.end("the terminal is closed", (128 + signal.SIGHUP,), "")


def struck(who: str, module: str, number: signal.Signals, codes: tuple[int, ...], words: str) -> Outcome:
    """A process of the run gets a signal while it plays; one that is stopped goes on after a second."""
    options = ("--headless", "--record", "{folder}/run.rec") if module.endswith("recorder") else ("--port", "0")
    with started(*options) as one:
        one.plays()
        one.send(module, number)
        if number == signal.SIGSTOP:
            time.sleep(1.0)
            one.send(module, signal.SIGCONT)
        return one.end(f"{number.name} to {who}", codes, words)


def signalled(after: float, number: signal.Signals) -> Outcome:
    with started("--headless", "--seconds", "15") as one:
        time.sleep(after)
        taken = one.takes(number)
        one.process.send_signal(number)
        fault = f"{number.name} {after:g} s after launch"
        if not taken:
            return one.end(f"{fault}, while Python is starting", (-number,), "")
        return one.end(fault, (0, 128 + number), number.name)


def two_decks() -> Outcome:
    with started("--headless") as one:
        one.plays()
        said, code = one.second()
        first = one.end("a second deck", (0,), "played to the end")
        return Outcome(
            first.fault, said, code, first.left, first.good and code == 1 and "another deck is running" in said
        )


def stale_socket() -> Outcome:
    with started("--headless") as one:
        one.plays()
        one.process.kill()
        one.process.wait()
        said, code = one.second("--seconds", "0.5")
        left = [file.name for file in one.folder.glob("motiondeck-*")]
        return Outcome("socket and folder of a killed deck", said, code, left, code == 0 and not left)


def rows(moments: int) -> Iterator[Callable[[], Outcome]]:
    """All faults."""
    yield from (no_room, full_disk, full_tmpfs, full_recording, read_only_home, closed_terminal)
    deck, page, recorder = "motiondeck.cli.main", "motiondeck.page.viewer", "controller.wire.recorder"
    kill, pause = signal.SIGKILL, signal.SIGSTOP
    yield lambda: struck("the deck", deck, kill, (-9,), "")
    yield lambda: struck("the page", page, kill, (0,), "the page has ended; the deck plays on")
    yield lambda: struck("the recorder", recorder, kill, (1,), "the recorder has ended; the deck plays on")
    yield lambda: struck("the deck for 1 s", deck, pause, (0,), "played to the end")
    yield lambda: struck("the page for 1 s", page, pause, (0,), "played to the end")
    yield lambda: struck("the recorder for 1 s", recorder, pause, (0,), "played to the end")
    for moment in range(moments):
        yield lambda moment=moment: signalled(round(0.03 * 1.9**moment, 2), signal.SIGTERM)
    yield lambda: signalled(6.0, signal.SIGHUP)
    yield from (two_decks, stale_socket)


def main(
    moments: Annotated[int, typer.Option("--moments", help="At how many moments from launch on SIGTERM is sent.")] = 10,
    first: Annotated[int, typer.Option("--from", help="The first row of the table to run, from 0.")] = 0,
    count: Annotated[int, typer.Option("--count", help="How many rows to run.")] = 100,
) -> None:
    print("| fault | said | exit code | left | as it must be |\n|---|---|---|---|---|", flush=True)
    bad = 0
    for row in [*rows(moments)][first : first + count]:
        found = row()
        bad += not found.good
        left = ", ".join(found.left) or "nothing"
        print(
            f"| {found.fault} | {found.said[:150]} | {found.code} | {left} | {'yes' if found.good else 'NO'} |",
            flush=True,
        )
    raise typer.Exit(1 if bad else 0)


if __name__ == "__main__":
    run("faults", main, __doc__)
