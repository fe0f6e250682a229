"""A clock and a port in simulated time: for tests and benchmarks that neither wait nor depend on the machine."""

from __future__ import annotations

from dataclasses import dataclass, field

from controller.loop.clock import period_ns
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan
from hardware.emulator.pty_server import SimulatedPort
from hardware.errors import SerialPortError


@dataclass
class VirtualClock:
    """Ticks without waiting, each exactly on time; RateError if the rate is out of range."""

    rate: float
    overruns: int = field(default=0, init=False)
    skipped: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._period = period_ns(self.rate)
        self._time = 0

    @property
    def period(self) -> float:
        """Virtual seconds from tick to tick."""
        return self._period * 1e-9

    def now(self) -> int:
        """The virtual time, ns."""
        return self._time

    def start(self) -> None:
        """Sets the virtual time to zero."""
        self._time = 0

    def wait(self) -> int:
        """Advances by one period; returns 0, because a virtual tick is never late."""
        self._time += self._period
        return 0


class EmulatedPort(SimulatedPort):
    """Keeps what was sent, and can be unplugged."""

    def __init__(self, bus: EmulatedBus, paced: bool = False, faults: FaultPlan | None = None) -> None:
        super().__init__(bus, paced, faults)
        self.sent: list[bytes] = []  # every byte string that was sent, in order

    def send(self, data: bytes) -> bool:
        """Hands the bytes to the wire."""
        self._check()
        self.sent.append(data)
        return super().send(data)

    def receive(self, likely: bool = False) -> bytes:
        """What the servos have answered since the last call."""
        self._check()
        return super().receive(likely)

    def wait(self, seconds: float) -> bool:
        """Lets time pass until there is something to receive, at most `seconds`; whether there is."""
        self._check()
        ready = super().wait(seconds)
        self._check()
        return ready

    def unplug(self) -> None:
        """From now on every call fails, as after pulling the adapter."""
        self.wire.faults.unplugged = True

    def _check(self) -> None:
        if self.wire.faults.unplugged:
            raise SerialPortError(f"the port {self.name} is gone: plug the adapter in again and start anew.")
