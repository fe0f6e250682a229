"""MIDI: notes, controls, the beats of a clock and the times of a timecode are commands.

Its ports are raw devices of the kernel, by their path, and those of a MIDI system, by their name, read through mido.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.wire.messages.commands import GiveBeat
from motiondeck.stage.command_pattern import CommandPattern, Signal
from motiondeck.stage.stage_file import MidiMap, control_values
from motiondeck.stage.timecode import TimecodeReader
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.mailbox import Mailbox

if TYPE_CHECKING:
    import mido

RAW_DEVICES = Path("/dev/snd")
_EXAMPLE = "/dev/snd/midiC1D0"
_INSTALL = 'Install it with: pip install "motiondeck[stage]"'


class MidiGoneError(MotiondeckError):
    """A MIDI device that was unplugged, or whose other end was closed."""


class RawDevice:
    """A device such as /dev/snd/midiC1D0, or a FIFO into which another program writes MIDI; needs no MIDI system."""

    def __init__(self, path: str) -> None:
        from mido import Parser

        self._path = path
        self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        self._parser = Parser()

    def fileno(self) -> int:
        """The device."""
        return self._file

    def messages(self, now: float) -> Iterator[tuple[float, mido.Message]]:
        """The messages that have come, now; raises a MidiGoneError when the device is unplugged."""
        try:
            data = os.read(self._file, 4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            raise MidiGoneError(f"the MIDI device {self._path} is gone")
        self._parser.feed(data)
        for message in self._parser:
            yield now, message

    def close(self) -> None:
        """Closes the device; may be called twice."""
        if self._file >= 0:
            os.close(self._file)
        self._file = -1


class SystemPort:
    """A port of ALSA's sequencer, JACK, or another system that mido knows; its messages come in a thread."""

    def __init__(self, name: str) -> None:
        import mido

        self._came = Mailbox[tuple[float, "mido.Message"]](4096)
        try:
            put = self._came.put
            self._port: Any = mido.open_input(name, callback=lambda one: put((time.monotonic(), one)))  # pyright: ignore
        except BaseException:
            self._came.close()
            raise

    def fileno(self) -> int:
        """Readable when messages have come."""
        return self._came.fileno()

    def messages(self, now: float) -> Iterator[tuple[float, mido.Message]]:
        """The messages that have come, each with the time at which it did."""
        return self._came.take()

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self._port.close()
        self._came.close()


MidiPort = RawDevice | SystemPort


def open_midi_port(name: str) -> MidiPort:
    """The port of a name, or the device of a path; MotiondeckError without mido, or it names the ports there are."""
    try:
        import mido
    except ImportError:
        raise MotiondeckError(f"MIDI needs mido. {_INSTALL}") from None
    try:
        return RawDevice(name) if "/" in name else SystemPort(name)
    except ImportError as error:
        raise MotiondeckError(
            f"MIDI port '{name}' cannot be opened: {error}. {_INSTALL}, on Python 3.13 and newer python-rtmidi as well"
            f" (it is compiled there); a raw device, such as {_EXAMPLE}, does without"
        ) from None
    except OSError as error:
        reason = error.strerror or str(error).rstrip(".")
    there: list[str] = []
    if "/" in name:
        there = sorted(map(str, RAW_DEVICES.glob("midi*")))
    else:
        with contextlib.suppress(OSError, ImportError):  # without python-rtmidi, or ALSA's library, there are none
            there = mido.get_input_names()  # pyright: ignore
    other = "a port of a MIDI system has a name" if "/" in name else f"a raw device has a path, such as {_EXAMPLE}"
    ports = f"There are: {', '.join(there)}" if there else f"There are none; {other}"
    raise MotiondeckError(f"MIDI input '{name}' cannot be opened ({reason}). {ports}")


_FULL_FRAME = (0x7F, 0x01, 0x01)  # universal real time, timecode, full message; the second byte is a device
PULSES = 24  # of a quarter note
_PER_POSITION = 6  # pulses a unit of the song position, which is a sixteenth


class MidiInput:
    """Commands from the messages of a MIDI port."""

    def __init__(self, port: MidiPort, stage: MidiMap) -> None:
        self._port, self._stage = port, stage
        self._clock, self._timecode = MidiClock(), TimecodeReader()

    def fileno(self) -> int:
        """What can be read when messages have come."""
        return self._port.fileno()

    def read(self, now: float) -> Iterator[Signal]:
        """The commands of the messages that have come; raises a MidiGoneError if the port is gone."""
        stage = self._stage
        message: Any  # mido's messages have attributes by their type
        for at, message in self._port.messages(now):
            match message.type:
                case "note_on" if message.velocity and stage.channel in (None, message.channel):
                    if message.note in stage.notes:
                        yield from self._given(at, f"note {message.note}", stage.notes[message.note])
                case "control_change" if message.control in stage.controls and stage.channel in (None, message.channel):
                    pattern, value = stage.controls[message.control], control_values(message.value)
                    yield from self._given(at, f"control {message.control}", pattern, value)
                case "quarter_frame":
                    passed = self._timecode.quarter_frame(message.frame_type, message.frame_value)
                    for cue, pattern in stage.cues.items():
                        if passed is not None and passed.contains(cue):
                            yield from self._given(at, "{:02}:{:02}:{:02}:{:02}".format(*cue), pattern)
                case "sysex" if len(message.data) > 3 and (message.data[0], *message.data[2:4]) == _FULL_FRAME:
                    self._timecode.locate()
                case "clock" | "start" | "stop" | "continue" | "songpos" if stage.clock:
                    position = message.pos if message.type == "songpos" else 0
                    if self._clock.take(message.type, position):
                        yield Signal(at, "clock", GiveBeat())

    def _given(
        self, at: float, source: str, pattern: CommandPattern, value: tuple[float, float] = (1.0, 1.0)
    ) -> Iterator[Signal]:
        command = pattern.command(value[:1] if pattern.complete else value)
        if command is not None:
            yield Signal(at, source, command)

    def close(self) -> None:
        """Lets go of the port; may be called twice."""
        self._port.close()


class MidiClock:
    """Picks the pulses of a MIDI clock that are beats: 24 make a quarter note (MIDI 1.0, system real time).

    Without a start message the first pulse counts as a beat.
    """

    def __init__(self) -> None:
        self._pulse = 0
        self._running = True

    def take(self, kind: str, position: int = 0) -> bool:
        """Takes a message by mido's name of its type; whether it is a beat. A song position is in sixteenths."""
        match kind:
            case "start":
                self._pulse, self._running = 0, True
            case "continue":
                self._running = True
            case "stop":
                self._running = False
            case "songpos":
                self._pulse = position * _PER_POSITION
            case "clock" if self._running:
                self._pulse += 1
                return self._pulse % PULSES == 1
        return False
