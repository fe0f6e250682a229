"""What the rig commands share: arguments, the rig file, its open ports, and the lines that are typed."""

from __future__ import annotations

import io
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import RigConfig

RigArgument = Annotated[str, Argument(metavar="RIG", help="A rig file (.toml), or a shipped one by its name.")]
PortOption = Annotated[
    list[str] | None, Option(metavar="PORT", help="Serial port instead of the rig file's; of several, each in order.")
]


def load(rig: str) -> RigConfig:
    """Loads a rig file, or a shipped one by its name; raises a MotiondeckError if there is none, or it is invalid."""
    from hardware.rig.rig_file import load_rig
    from motiondeck_base.shipped import find_rig

    return load_rig(find_rig(rig))


def aside(line: str) -> None:
    """Prints to stderr, because stdout carries the result."""
    print(line, file=sys.stderr, flush=True)


@contextmanager
def open_buses(config: RigConfig, ports: list[str] | None) -> Iterator[list[tuple[RigConfig, Bus]]]:
    """Opens the bus of each port of a rig, with the joints on it, and closes them at the end."""
    from hardware.bus.servo_bus import Bus

    with ExitStack() as opening:
        parts: list[tuple[RigConfig, Bus]] = []
        for part in config.on_ports(ports or ()):
            parts.append((part, bus := Bus.open(part.port, part.baud)))
            bus.families = part.families
            opening.callback(bus.close)
        yield parts


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """Lets SIGTERM and a closed terminal raise SystemExit in the block, so that ports and links are closed."""

    def end(number: int, frame: object) -> None:
        raise SystemExit(128 + number)

    with handled(end, signal.SIGTERM, signal.SIGHUP):
        yield


@contextmanager
def handled(handler: Callable[[int, object], None], *numbers: int) -> Iterator[None]:
    """Has signals call a handler in the block; those that are ignored (with nohup a closed terminal) stay so."""
    wanted = [one for one in numbers if signal.getsignal(one) is not signal.SIG_IGN]
    before = [(number, signal.signal(number, handler)) for number in wanted]
    try:
        yield
    finally:
        for number, earlier in before:
            signal.signal(number, earlier)


class LineInput:
    """Reads lines from standard input; prompts go to standard error, because standard output carries the result."""

    def __init__(self) -> None:
        self._partial = b""
        try:
            self._fd: int | None = sys.stdin.fileno()
        except (io.UnsupportedOperation, AttributeError):
            self._fd = None  # a stream without a descriptor never blocks

    def ask(self, prompt: str) -> str:
        """Prompts for a line, which is returned without surrounding spaces; MotiondeckError at the input's end."""
        print(prompt, end="", file=sys.stderr, flush=True)
        while (line := self.take(None)) is None:
            pass
        return line

    def take(self, seconds: float | None = 0.0) -> str | None:
        """The next line, or None if none comes within `seconds` (None: for ever); MotiondeckError at the end."""
        if self._fd is None:
            return self._ended_or(sys.stdin.readline())
        if b"\n" not in self._partial:
            if not select.select([self._fd], [], [], seconds)[0]:
                return None
            data = os.read(self._fd, 4096)
            self._partial += data
            if b"\n" not in self._partial:
                return self._ended_or("") if not data else None
        line, _, self._partial = self._partial.partition(b"\n")
        return line.decode(errors="replace").strip()

    @staticmethod
    def _ended_or(line: str) -> str:
        if not line:
            raise MotiondeckError("standard input has ended, so there is no Enter; --help shows what works without it")
        return line.strip()


def in_foreground() -> bool:
    """Whether standard input may be read: it is no terminal, or this process is in its foreground."""
    try:
        return not sys.stdin.isatty() or os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        return False
