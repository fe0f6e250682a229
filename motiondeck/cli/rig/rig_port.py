"""What the rig commands share: arguments, the rig file, and its open ports."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

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
