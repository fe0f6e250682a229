"""Processes of this program that a run starts and that end with it; they never import from the working directory."""

import contextlib
import socket
import subprocess
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from controller.wire.local_transport import refuse_second_deck
from controller.wire.run_folder import run_folder
from motiondeck_base.early_end import without_interrupts
from motiondeck_base.errors import MotiondeckError


@contextmanager
def child_process(
    module: str, *arguments: str, patience: float = 2.0, own_session: bool = False, stdin: int | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Runs a module beside the block; after the block it has `patience` seconds to end, then it is killed.

    Ctrl-C, which is for the deck, does not reach it, nor with its own session a hangup; `stdin` is an open file.
    """
    command = [sys.executable, "-P", "-m", module, *arguments]
    with without_interrupts():
        child = subprocess.Popen(command, stdin=stdin, start_new_session=own_session)
    try:
        yield child
    except BaseException:
        child.terminate()
        raise
    finally:
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(patience)
        child.kill()
        child.wait()


@dataclass(frozen=True)
class PageProcess:
    """The browser view, in its own process."""

    state: Path  # the file that it waits for
    process: subprocess.Popen[bytes]
    port: int


@contextmanager
def page_process(port: int, command_port: int) -> Iterator[PageProcess]:
    """The browser view while the block runs; it prints the address of its page when that answers.

    It takes longest of all to start, so it is started before anything else is imported or loaded. MotiondeckError if
    either port is taken, also where another deck has the command port, or there can be no temporary folder.
    """
    refuse_second_deck(command_port)
    port = free_port(port)
    with run_folder() as folder:
        state = folder / "state"
        with child_process("motiondeck.page.viewer", str(state), str(port), own_session=True) as process:
            yield PageProcess(state, process, port)


def free_port(port: int) -> int:
    """The port itself if it is free, or any free one for 0."""
    if not 0 <= port <= 65535:
        raise MotiondeckError(f"port {port} for the page cannot be used: it must be from 0 to 65535")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise MotiondeckError(
                f"port {port} for the page cannot be used ({error.strerror or error}): another "
                "program, or the page of another deck, may have it. Give --port 0 for any that is free."
            ) from None
        return int(probe.getsockname()[1])


class Children:
    """The processes that a run has started: the page, the prompt, the recorder, a part in a show."""

    def __init__(self) -> None:
        # Restores the terminal, which a killed prompt may have changed.
        self.restore_tty: Callable[[], None] = lambda: None
        self._running: list[tuple[subprocess.Popen[bytes], str, str]] = []

    def add(self, name: str, process: subprocess.Popen[bytes], then: str = "the deck plays on") -> None:
        """Watches one more; its name, and what comes of its end, are for people."""
        self._running.append((process, name, then))

    def report_dead(self) -> None:
        """Prints a line for each that has died since the last call."""
        for process, name, then in [*self._running]:
            if process.poll() is not None:
                self._running.remove((process, name, then))
                if process.returncode != 0:
                    self.restore_tty()
                    print(f"motiondeck: {name} has ended; {then}", file=sys.stderr)


@contextmanager
def kept_tty() -> Iterator[Callable[[], None]]:
    """Restores the terminal's settings after the block, as a killed prompt changes them; yields what restores them."""
    before = None
    with contextlib.suppress(termios.error, ValueError, OSError):
        before = termios.tcgetattr(sys.stdin)

    def restore() -> None:
        if before is not None:
            with contextlib.suppress(termios.error, ValueError, OSError):
                termios.tcsetattr(sys.stdin, termios.TCSANOW, before)

    try:
        yield restore
    finally:
        restore()
