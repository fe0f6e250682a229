"""A port straight onto an emulated bus, in simulated time: for tests that neither wait nor depend on the machine."""

from __future__ import annotations

from hardware.emulator.bus import EmulatedBus
from hardware.errors import PortError


class EmulatedPort:
    """Fits `hardware.port.Port`; time passes only in `wait` and `elapse`.

    Attributes:
        bus: what is behind the port.
        sent: every byte string that was sent, in order.
    """

    name = "emulated"

    def __init__(self, bus: EmulatedBus) -> None:
        self.bus = bus
        self.sent: list[bytes] = []
        self._now = 0.0
        self._arrived = b""
        self._plugged = True

    def send(self, data: bytes) -> bool:
        """Hands the bytes to the servos, whose answers can be received at once."""
        self._check()
        self.sent.append(data)
        self._arrived += self.bus.exchange(data, self._now)
        return True

    def receive(self) -> bytes:
        """What the servos have answered since the last call."""
        self._check()
        arrived, self._arrived = self._arrived, b""
        return arrived

    def wait(self, seconds: float) -> bool:
        """True if there is something to receive; else so much time passes."""
        self._check()
        if not self._arrived:
            self.elapse(max(0.0, seconds))
        return bool(self._arrived)

    def now(self) -> float:
        """The simulated time, s."""
        return self._now

    def close(self) -> None:
        """Nothing is held open."""

    def elapse(self, seconds: float) -> None:
        """Lets time pass without a word on the bus."""
        self._now += seconds
        self.bus.advance(self._now)

    def unplug(self) -> None:
        """From now on every call fails, as after pulling the adapter."""
        self._plugged = False

    def _check(self) -> None:
        if not self._plugged:
            raise PortError(f"the port {self.name} is gone: plug the adapter in again and start anew.")
