"""The stage file: OSC addresses, MIDI notes and times of a timecode that give commands, and trackers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, TypeVar

import msgspec

from controller.wire.messages.arguments import CommandError
from motiondeck.stage.command_pattern import CommandPattern
from motiondeck.stage.timecode import Timecode
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import shortened
from motiondeck_base.toml_file import read_toml

Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]
Key = TypeVar("Key")
_NOTE = "a note is a number from 0 to 127 (60 is the middle C)"
_CONTROL = "a controller is a number from 0 to 119 (1 is the modulation wheel)"


class _Osc(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    listen: Port | None = None
    send_to: str | None = None
    commands: dict[str, str] = {}


class _Midi(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    input: str
    channel: Annotated[int, msgspec.Meta(ge=1, le=16)] | None = None
    clock: bool = False
    notes: dict[str, str] = {}
    controls: dict[str, str] = {}
    timecode: dict[str, str] = {}


class TrackerMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where points of a person arrive, and the motions that they are followed through."""

    listen: Port  # the UDP port on loopback
    library: str  # the one that the deck plays: a file or the name of a shipped one
    points: tuple[str, ...] = ("head", "lhan", "rhan")  # joints of its body or rig that are followed, or `root`
    height: float | None = None  # of the person, m; without it they are as tall as the library's body
    names: dict[str, str] = {}  # the point of each device, by its serial number


class _StageFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    osc: _Osc = _Osc()
    midi: _Midi | None = None
    tracker: TrackerMap | None = None


@dataclass(frozen=True)
class OscMap:
    """What OSC does."""

    port: int | None  # the UDP port on loopback at which messages arrive; None for none
    target: tuple[str, int] | None  # where events and states are sent to, host and port; None for nowhere
    commands: Mapping[str, CommandPattern]


@dataclass(frozen=True)
class MidiMap:
    """What MIDI does."""

    input: str  # the name of a port, or the path of a raw MIDI device
    channel: int | None  # the only one whose notes and controls count, from 0; None for all
    clock: bool
    notes: Mapping[int, CommandPattern]
    controls: Mapping[int, CommandPattern]  # by number of the controller
    cues: Mapping[Timecode, CommandPattern]


@dataclass(frozen=True)
class StageMap:
    """A stage file that was read."""

    osc: OscMap
    midi: MidiMap | None
    tracker: TrackerMap | None

    @property
    def patterns(self) -> list[CommandPattern]:
        """All commands in it."""
        found = [*self.osc.commands.values()]
        if self.midi is not None:
            found += [*self.midi.notes.values(), *self.midi.controls.values(), *self.midi.cues.values()]
        return found


def read_stage(path: Path) -> StageMap:
    """Reads a stage file; a FileFormatError has one line per problem: the file, the place, what is allowed there."""
    raw = read_toml(path, _StageFile)
    problems: list[str] = []

    def patterns(
        place: str, table: Mapping[str, str], key: Callable[[str], Key], values: Sequence[int] | None = None
    ) -> dict[Key, CommandPattern]:
        found: dict[Key, CommandPattern] = {}
        for name, text in table.items():
            try:
                pattern = found[key(name)] = CommandPattern(text)
                if not pattern.complete and values is None:
                    raise ValueError(f"'{shortened(text)}': only OSC messages and controls have arguments")
                for value in values or ():
                    pattern.command(control_values(value))
            except (CommandError, ValueError) as error:
                problems.append(f"'{shortened(name)}' in [{place}]: {error}")
        return found

    target = None
    if raw.osc.send_to is not None:
        host, _, port = raw.osc.send_to.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            target = host, int(port)
        else:
            problems.append(
                f"send_to in [osc] is HOST:PORT, such as 127.0.0.1:9001, not '{shortened(raw.osc.send_to)}'"
            )
    osc = OscMap(raw.osc.listen, target, patterns("osc.commands", raw.osc.commands, _address, ()))
    if osc.commands and osc.port is None:
        problems.append("commands in [osc] need a port on which they arrive, such as: listen = 9000")
    midi = None
    if raw.midi is not None:
        midi = MidiMap(
            raw.midi.input,
            raw.midi.channel - 1 if raw.midi.channel is not None else None,
            raw.midi.clock,
            patterns("midi.notes", raw.midi.notes, partial(_number, 128, _NOTE)),
            patterns("midi.controls", raw.midi.controls, partial(_number, 120, _CONTROL), (0, 50, 127)),
            patterns("midi.timecode", raw.midi.timecode, Timecode.parse),
        )
    if midi is None and raw.tracker is None and raw.osc == _Osc():
        problems.append("nothing is mapped: give listen or send_to in [osc], [midi] or [tracker]")
    if problems:
        raise FileFormatError.listing(str(path), problems)
    return StageMap(osc, midi, raw.tracker)


def _address(name: str) -> str:
    if not name.startswith("/"):
        raise ValueError("an OSC address begins with /")
    return name


def control_values(value: int) -> tuple[float, float]:
    """What a controller's value, 0 to 127, is from 0 to 1, and from -1 to 1 with the middle at 64."""
    return value / 127.0, max(-1.0, (value - 64) / 63.0)


def _number(below: int, allowed: str, name: str) -> int:
    if not (name.isdecimal() and int(name) < below):
        raise ValueError(allowed)
    return int(name)
