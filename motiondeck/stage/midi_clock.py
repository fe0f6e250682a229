"""The clock of MIDI: 24 pulses a quarter note, counted from where a song is started (MIDI 1.0, system real time)."""

from __future__ import annotations

PULSES = 24
"""A quarter note."""

_PER_POSITION = 6  # pulses a unit of the song position, which is a sixteenth


class MidiClock:
    """Tells the pulses that are beats.

    A clock that is heard before a start counts from its first pulse, as nothing tells where its beats are.
    """

    def __init__(self) -> None:
        self._pulse = 0
        self._running = True

    def take(self, kind: str, position: int = 0) -> bool:
        """Takes a message by mido's name of its type; whether it is a beat.

        Args:
            kind: "clock" for a pulse, "start", "stop", "continue", "songpos"; others change nothing.
            position: of "songpos", in sixteenths.
        """
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
