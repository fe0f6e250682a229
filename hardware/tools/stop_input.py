"""An emergency stop that is wired: a contact on a serial adapter, or a key of an input device.

Both stop where anything fails: the contact is closed while all is well, so that a cut wire or an unplugged adapter is
the same as a pulled stop. An adapter may take a millisecond to report its lines, so a thread polls them for the loop.
"""

import contextlib
import os
import struct
import threading
from collections.abc import Callable
from pathlib import Path

import serial

from motiondeck_base.errors import MotiondeckError

ASKED_EVERY = 0.01  # s
_EVENT = struct.Struct("@llHHi")  # of an input device: time, type, code, value
_KEY, _DOWN = 1, 1


class StopInput:
    """Asks a wired stop again and again whether it is closed; an OSError means that it is not."""

    def __init__(self, name: str, closed: Callable[[], bool], release: Callable[[], None]) -> None:
        self.name = name
        self.pulled = False  # whether the stop is pulled, or cannot be asked
        self.pulls = 0  # how often it was; a key that was let go again before the loop looked still counts
        self._closed, self._release = closed, release
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()

    def look(self) -> None:
        """Asks once; the thread does it by itself."""
        try:
            pulled = not self._closed()
        except OSError:
            pulled = True
        self.pulls += pulled and not self.pulled
        self.pulled = pulled

    def close(self) -> None:
        """Asks no more; may be called twice."""
        if not self._over.is_set():
            self._over.set()
            self._thread.join()
            with contextlib.suppress(OSError):
                self._release()

    def _ask(self) -> None:
        while not self._over.wait(ASKED_EVERY):
            self.look()


def open_stop_input(device: Path) -> StopInput:
    """A wired stop: /dev/input/eventN stops with any of its keys; every other device is a serial adapter.

    On the adapter a contact that opens when the stop is pulled connects DTR with CTS. MotiondeckError if it cannot be
    opened, or is pulled already.
    """
    try:
        if device.parent == Path("/dev/input"):
            file = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
            found = StopInput(str(device), key_reader(file), lambda: os.close(file))
        else:
            adapter = serial.Serial(str(device), exclusive=True)
            adapter.dtr = True
            found = StopInput(str(device), lambda: adapter.cts, adapter.close)
    except (OSError, serial.SerialException) as error:
        raise MotiondeckError(f"{device}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    found.look()
    if found.pulled:
        found.close()
        raise MotiondeckError(f"{device}: the emergency stop is pulled, or its contact does not connect DTR with CTS")
    return found


def key_reader(file: int) -> Callable[[], bool]:
    """Whether no key of an input device was pressed since the last call; a device that is gone raises OSError."""

    def closed() -> bool:
        pressed = False
        while True:
            try:
                data = os.read(file, 64 * _EVENT.size)
            except BlockingIOError:
                return not pressed
            if not data:
                raise OSError("the device is gone")
            whole = data[: len(data) // _EVENT.size * _EVENT.size]
            pressed |= any(kind == _KEY and value == _DOWN for *_, kind, _, value in _EVENT.iter_unpack(whole))

    return closed
