"""The turns in which servos stand, kept on disk: after power-up a servo knows only its place within one.

A file for each serial adapter, in motiondeck in XDG_STATE_HOME (else ~/.local/state), has for each servo

    zero      its position at angle 0 as it counted, pulses
    place     its position as it counted, pulses
    stands    whether it stood there; false while it moved
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Self

import msgspec

from hardware.bus.port import lasting_name
from hardware.families.register import Counts
from motiondeck_base.files import read_kept, write_file
from motiondeck_base.shipped import state_folder


class Turn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is kept of a servo; see above."""

    zero: Counts
    place: Counts
    stands: bool


class TurnFile:
    """The turns of the servos on one port, by ID."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def of_port(cls, port: str) -> Self:
        """The file of a serial adapter, found again under its lasting name."""
        name = re.sub(r"[^\w.-]+", "-", str(Path(lasting_name(port)).absolute()))
        return cls(state_folder() / f"turns{name}.json")

    def read(self) -> dict[int, Turn]:
        """What is kept; nothing where there is no file, or a damaged one."""
        return read_kept(self.path, dict[int, Turn]) or {}

    def keep(self, turns: Mapping[int, Turn]) -> None:
        """Writes these beside what else is kept, on the disk itself; raises a FileFormatError if that fails."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_file(self.path, msgspec.json.format(msgspec.json.encode(self.read() | dict(turns))) + b"\n")
