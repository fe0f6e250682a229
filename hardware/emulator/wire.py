"""The wire between an adapter and emulated servos: the time that bytes take, and faults on the way.

Ten bits carry a byte. A servo starts to answer its return delay after the instruction's last bit; in a sync read each
waits its own. With USB latency an adapter hands over what it has received at every whole period only.
"""

import math
from collections import deque

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan


class Wire:
    """One adapter and a bus behind it."""

    def __init__(
        self, bus: EmulatedBus, faults: FaultPlan | None = None, paced: bool = True, half_duplex: bool = True
    ) -> None:
        self.bus = bus
        self.faults = faults or FaultPlan()
        self.faults.check([device.id for device in bus.devices])
        self.paced = paced  # whether bytes take their time; otherwise all happens at once
        # Whether a frame that the host sends during an answer destroys both, as on a real wire. Otherwise it waits for
        # the answer's end, and is only counted.
        self.half_duplex = half_duplex
        self.collisions = 0  # how often the host spoke into an answer
        self._free = 0.0  # when the wire becomes silent
        self._arriving: deque[tuple[float, bytes]] = deque()  # at the adapter, by time

    def send(self, data: bytes, now: float) -> None:
        """The host's bytes, from the time `now` on, s."""
        self.advance(now)
        start = now
        if now < self._free and self._arriving and self.paced:
            self.collisions += 1
            if self.half_duplex:
                self._arriving = deque((due, data) for due, data in self._arriving if due <= now)
                self._free = now + self._time(data)
                return
        if self.paced:
            start = max(now, self._free) + self._time(data)
        answers = self.bus.exchange(data, start)
        for answer in answers:
            if self.paced:
                start += answer.delay + self._time(answer.data)
            heard = self.faults.mangle(answer)
            if heard is not None:
                late = max(0.0, heard.delay - answer.delay)
                self._arriving.append((self._handed_over(start + late), heard.data))
        self._free = start

    def receive(self, now: float) -> bytes:
        """The bytes that have arrived by the time `now`, s."""
        arrived: list[bytes] = []
        while self._arriving and self._arriving[0][0] <= now:
            arrived.append(self._arriving.popleft()[1])
        return b"".join(arrived)

    @property
    def due(self) -> float | None:
        """When something arrives next, s; None while nothing is under way."""
        return self._arriving[0][0] if self._arriving else None

    def advance(self, now: float) -> None:
        """Advances servos and faults to the time `now`, s."""
        self.faults.advance(self.bus, now)
        self.bus.advance(now)

    def _time(self, data: bytes) -> float:
        return 10.0 * len(data) / self.bus.baud

    def _handed_over(self, arrived: float) -> float:
        """When the adapter hands over arrived bytes to the host, s."""
        latency = self.faults.latency
        return math.ceil(arrived / latency) * latency if latency else arrived
