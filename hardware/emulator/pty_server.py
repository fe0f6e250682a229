"""An emulated bus behind a pseudo-terminal, for any client that can open a serial port."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import time
import tty
from collections.abc import Callable

from hardware.emulator.bus import EmulatedBus
from hardware.rig import RigConfig

_WAKE = 0.02
_LONGEST_STEP = 0.1


class PtyServer:
    """Serves one emulated bus on one pseudo-terminal.

    The servos' time is the real one, except that it stands still while this process is not given the processor: else a
    busy machine would look like a silent bus, and trip their watchdogs.

    Attributes:
        port: what a client opens.
    """

    def __init__(self, bus: EmulatedBus) -> None:
        self._bus = bus
        self._master, self._slave = pty.openpty()
        # Kept open on this side too, so that the link outlives a client and serves the next.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._woken = time.monotonic()
        self._now = 0.0

    def pump(self) -> None:
        """Carries what has arrived to the servos and their answers back; returns after 20 ms of silence."""
        ready = self._poll.poll(_WAKE * 1e3)
        woken = time.monotonic()
        self._now += min(woken - self._woken, _LONGEST_STEP)
        self._woken = woken
        answers = self._bus.exchange(os.read(self._master, 65536) if ready else b"", self._now)
        if answers:
            # A wire does not wait: what nobody reads is lost.
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, answers)

    def close(self) -> None:
        """Takes the pseudo-terminal away, as unplugging an adapter does; may be called twice."""
        if self._master >= 0:
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1


def serve(config: RigConfig, announce: Callable[[str], None]) -> None:
    """Emulates the rig, tells `announce` the port to open, and serves any client until the parent process is gone.

    Runs for ever otherwise: end it with a signal.
    """
    parent = os.getppid()
    server = PtyServer(EmulatedBus(config))
    announce(server.port)
    try:
        while os.getppid() == parent:
            server.pump()
    finally:
        server.close()
