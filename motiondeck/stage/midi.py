"""MIDI: notes, controls, the beats of a clock and the times of a timecode are commands."""

from collections.abc import Iterable, Iterator
from typing import Any

from controller.wire.messages.commands import GiveBeat
from motiondeck.stage.command_pattern import CommandPattern, Signal
from motiondeck.stage.midi_port import MidiPort
from motiondeck.stage.stage_file import MidiMap, control_values
from motiondeck.stage.timecode import TimecodeReader

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
        for at, message in self._port.messages(now):
            yield from self._signals(at, message)

    def _signals(self, at: float, message: Any) -> Iterable[Signal]:
        # mido's messages have attributes by their type.
        stage = self._stage
        match message.type:
            case "note_on" if message.velocity and stage.channel in (None, message.channel):
                if message.note in stage.notes:
                    return self._given(at, f"note {message.note}", stage.notes[message.note])
            case "control_change" if message.control in stage.controls and stage.channel in (None, message.channel):
                pattern, value = stage.controls[message.control], control_values(message.value)
                return self._given(at, f"control {message.control}", pattern, value)
            case "quarter_frame":
                return self._cues(at, message.frame_type, message.frame_value)
            case "sysex" if len(message.data) > 3 and (message.data[0], *message.data[2:4]) == _FULL_FRAME:
                self._timecode.locate()
            case "clock" | "start" | "stop" | "continue" | "songpos" if stage.clock:
                position = message.pos if message.type == "songpos" else 0
                if self._clock.take(message.type, position):
                    return [Signal(at, "clock", GiveBeat())]
        return []

    def _cues(self, at: float, piece: int, nibble: int) -> Iterator[Signal]:
        passed = self._timecode.quarter_frame(piece, nibble)
        if passed is not None:
            for cue, pattern in self._stage.cues.items():
                if passed.contains(cue):
                    yield from self._given(at, "{:02}:{:02}:{:02}:{:02}".format(*cue), pattern)

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
