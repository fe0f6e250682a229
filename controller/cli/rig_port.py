"""What the rig commands share: their arguments, the rig file, and its port, given back whatever happens."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hardware.bus import Bus
    from hardware.rig import RigConfig

RigArgument = Annotated[str, typer.Argument(metavar="RIG", help="A rig file (.toml), or a shipped one by its name.")]
PortOption = Annotated[str | None, typer.Option("--port", help="Serial port instead of the rig file's own.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]


def load(rig: str) -> RigConfig:
    """A rig file, or a shipped one by its name.

    Raises:
        MotiondeckError: if there is none, or it is not good.
    """
    from controller.cli.resources import find
    from hardware.rig import load_rig

    return load_rig(find("rig", rig, ".toml"))


@contextmanager
def open_bus(config: RigConfig, port: str | None) -> Iterator[Bus]:
    """The bus of a rig, given back in the end."""
    from hardware.bus import Bus

    bus = Bus.open(port or config.port, config.baud)
    try:
        yield bus
    finally:
        bus.close()


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """SIGTERM ends the block as an exception does, so that ports and links are given back."""

    def end(number: int, frame: object) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
