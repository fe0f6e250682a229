"""An emulated bus behind a pseudo-terminal, for any client that can open a serial port."""

import contextlib
import fcntl
import json
import math
import os
import pty
import select
import struct
import time
import tty
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hardware.emulator.bus import EmulatedBus, JointPlant
from hardware.emulator.faults import Fault, FaultPlan
from hardware.errors import RigError, SerialPortError
from hardware.rig.rig_file import RigConfig


class Wire:
    """The wire of one adapter and a bus behind it: the time that bytes take, and faults on the way.

    Ten bits carry a byte. A servo starts to answer its return delay after the instruction's last bit; in a sync read
    each waits its own. With USB latency an adapter hands over what it has received at every whole period only.
    """

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
        for answer in self.bus.exchange(data, start):
            if self.paced:
                start += answer.delay + self._time(answer.data)
            heard = self.faults.mangle(answer)
            if heard is not None:
                arrived, latency = start + max(0.0, heard.delay - answer.delay), self.faults.latency
                handed_over = math.ceil(arrived / latency) * latency if latency else arrived
                self._arriving.append((handed_over, heard.data))
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


class SimulatedPort:
    """Fits `hardware.bus.port.Port`, with a bus behind it in this process; time passes only in `wait` and `elapse`."""

    name = "emulated"

    def __init__(self, bus: EmulatedBus, paced: bool = False, faults: FaultPlan | None = None) -> None:
        self.bus = bus  # what is behind the port
        self.wire = Wire(bus, faults, paced)  # what is between
        self._now = 0.0

    def send(self, data: bytes) -> bool:
        """Hands the bytes to the wire."""
        self.wire.send(data, self._now)
        return True

    def receive(self, likely: bool = False) -> bytes:
        """What the servos have answered since the last call."""
        return self.wire.receive(self._now)

    def wait(self, seconds: float) -> bool:
        """Lets time pass until there is something to receive, at most `seconds`; whether there is."""
        due = self.wire.due
        if due is None or due > self._now:
            self.elapse(max(0.0, seconds if due is None else min(seconds, due - self._now)))
        due = self.wire.due
        return due is not None and due <= self._now

    def now(self) -> float:
        """The simulated time, s."""
        return self._now

    def close(self) -> None:
        """Does nothing."""

    def elapse(self, seconds: float) -> None:
        """Lets time pass on a silent bus."""
        self._now += seconds
        self.wire.advance(self._now)


_WAKE = 0.02
_LONGEST_STEP = 0.1
_TCGETS2 = 0x802C542A  # the terminal's settings with its speed as a plain number (Linux)
_SETTINGS = struct.Struct("=4I20s2I")


class PtyServer:
    """Serves one emulated bus on one pseudo-terminal.

    The servos' time is the real one, except that it stands still while this process is not given the processor: else a
    busy machine would look like a silent bus, and trip their watchdogs. For the same reason the host's word waits for
    the end of an answer under way (a client may be late without knowing), and gaps within an instruction are forgiven.
    """

    def __init__(
        self, bus: EmulatedBus, faults: FaultPlan | None = None, paced: bool = True, link: Path | None = None
    ) -> None:
        """Opens a pseudo-terminal; a `link` names the port, and stays the same when it is plugged in again."""
        bus.longest_gap = None
        self._bus = bus
        self.wire = Wire(bus, faults, paced, half_duplex=False)  # between the pseudo-terminal and the servos
        self._link = link
        self._master = self._slave = -1
        self._woken = time.monotonic()
        self._now = 0.0
        self._plug_in()
        self.port = str(link) if link is not None else os.ttyname(self._slave)

    @property
    def patience(self) -> float:
        """How long nothing has to be done while the host is silent, s."""
        due = self.wire.due
        return _WAKE if due is None else min(_WAKE, max(0.0, due - self._now))

    @property
    def open(self) -> list[int]:
        """What to wait for: the descriptor on which the host is heard, none while the adapter is out."""
        if self.wire.faults.unplugged != (self._master < 0):
            self._unplug() if self._master >= 0 else self._plug_in()
        return [self._master] if self._master >= 0 else []

    def turn(self, ready: Sequence[int]) -> None:
        """Lives until now, and carries what has come if its descriptor is among those that are ready."""
        woken = time.monotonic()
        self._now += min(woken - self._woken, _LONGEST_STEP)
        self._woken = woken
        if self._master in ready:
            self._bus.baud = _speed(self._slave) or self._bus.baud
            self.wire.send(os.read(self._master, 65536), self._now)
        else:
            self.wire.advance(self._now)
        answers = self.wire.receive(self._now)
        if answers and self._master >= 0:
            # A wire does not wait: bytes that are not read are lost.
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, answers)

    def close(self) -> None:
        """Takes the pseudo-terminal away, as unplugging an adapter does; may be called twice."""
        self._unplug()
        self._link = None

    def _plug_in(self) -> None:
        self._master, self._slave = pty.openpty()
        # Kept open on this side too, so that the link outlives a client and serves the next.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        if self._link is not None:
            try:
                if not self._link.exists():
                    self._link.unlink(missing_ok=True)  # of an emulator that was killed
                self._link.symlink_to(os.ttyname(self._slave))
            except OSError as error:
                self._unplug()
                raise SerialPortError(f"no link {self._link}: {error.strerror}. Remove it or name another.") from error

    def _unplug(self) -> None:
        if self._master >= 0:
            # Before the terminal is gone: the next one of the machine, somebody else's, may get its number.
            if self._link and self._link.is_symlink() and str(self._link.readlink()) == os.ttyname(self._slave):
                self._link.unlink()
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1


def pump(servers: Sequence[PtyServer]) -> None:
    """Waits until one of them has something to do, 20 ms at most, and has each take its turn."""
    # select, because poll() would wait in whole milliseconds.
    ready = select.select(
        [number for server in servers for number in server.open], [], [], min(server.patience for server in servers)
    )[0]
    for server in servers:
        server.turn(ready)


def serve(
    config: RigConfig,
    announce: Callable[[str], None],
    faults: Sequence[Fault] = (),
    link: Path | None = None,
    plant: JointPlant | None = None,
    between: Callable[[Sequence[EmulatedBus]], None] = lambda buses: None,
    goes_on: Callable[[], bool] = lambda: True,
) -> None:
    """Emulates the rig, passes the port to open to `announce`, and serves any client for as long as `goes_on`.

    Runs for ever by default: end it with a signal. A rig with several ports gets as many, announced in order; a link is
    numbered then (NAME-1, NAME-2), and a fault about one servo happens on every port that has its ID.

    Fifty times a second or more `goes_on` is asked, and `between` called with the bus of each port: for what people do
    to the servos. RigError if a model cannot be emulated, or a rig on several ports is to move one plant.
    SerialPortError if the link cannot be made. MotiondeckError if a fault is about a servo that is not there.
    """
    if plant is not None and len(config.ports) > 1:
        raise RigError(f"a rig on several ports ({', '.join(config.ports)}) cannot be coupled to one body")
    FaultPlan(faults).check([joint.id for joint in config.servos.joints])
    servers: list[PtyServer] = []
    try:
        for number, part in enumerate(config.parts, 1):
            ids = [joint.id for joint in part.servos.joints]
            plan = FaultPlan([fault for fault in faults if fault.id is None or fault.id in ids])
            name = link.with_name(f"{link.name}-{number}") if link is not None and len(config.ports) > 1 else link
            servers.append(PtyServer(EmulatedBus(part, plant=plant), plan, link=name))
            announce(servers[-1].port)
        while goes_on():
            pump(servers)
            between([server.wire.bus for server in servers])
    finally:
        for server in servers:
            server.close()


def _speed(fd: int) -> int | None:
    """The speed at which the client has opened the terminal, bits/s; None where the system does not know it."""
    try:
        return _SETTINGS.unpack(fcntl.ioctl(fd, _TCGETS2, bytes(_SETTINGS.size)))[-1] or None
    except OSError:
        return None


class ShaftRecord:
    """A record of where the shafts of emulated servos really are, which no reply on the bus tells exactly.

    a line of JSON: {"joints": names}
    rows of float64, little endian: CLOCK_MONOTONIC (s), time of the servos (s), shaft of each joint (rad)

    Each call writes a row; nothing is buffered, so that a killed emulator leaves all of them.
    """

    def __init__(self, path: Path, config: RigConfig) -> None:
        """Creates the file; raises RigError if it cannot be written."""
        joints = [joint for part in config.parts for joint in part.servos.joints]
        self._zero = np.array([joint.zero for joint in joints], dtype=np.float64)
        self._per_radian = np.array([joint.pulses_per_radian for joint in joints])
        self._row = np.empty(2 + len(joints))
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise RigError(f"cannot write the record {path}: {error.strerror}.") from error
        self._file.write(json.dumps({"joints": [joint.name for joint in joints]}).encode() + b"\n")

    def __call__(self, buses: Sequence[EmulatedBus]) -> None:
        """Writes where the shafts of the buses, in the order of the rig's ports, are now."""
        shafts = [device.bank.shaft[device.row] for bus in buses for device in bus.devices]
        self._row[0], self._row[1] = time.monotonic(), buses[0].time
        self._row[2:] = (np.array(shafts) - self._zero) / self._per_radian
        self._file.write(self._row.tobytes())
