"""MIDI ports: a raw device of the kernel by its path, or a port of a MIDI system by its name, read through mido."""

from __future__ import annotations

import contextlib
import os
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motiondeck_base.errors import MotiondeckError

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

        self._came: deque[tuple[float, mido.Message]] = deque(maxlen=4096)
        self._bell, self._ring = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            self._port: Any = mido.open_input(name, callback=self._take)  # pyright: ignore
        except BaseException:
            self._close_bell()
            raise

    def _take(self, message: mido.Message) -> None:
        self._came.append((time.monotonic(), message))
        with contextlib.suppress(OSError):  # full: already signalled; closed: no longer read
            os.write(self._ring, b"!")

    def fileno(self) -> int:
        """A pipe that can be read when messages have come."""
        return self._bell

    def messages(self, now: float) -> Iterator[tuple[float, mido.Message]]:
        """The messages that have come, each with the time at which it did."""
        with contextlib.suppress(BlockingIOError):
            os.read(self._bell, 4096)
        while self._came:
            yield self._came.popleft()

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self._port.close()
        self._close_bell()

    def _close_bell(self) -> None:
        for end in (self._bell, self._ring):
            if end >= 0:
                os.close(end)
        self._bell = self._ring = -1


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
