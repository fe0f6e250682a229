"""A bus of Protocol 2.0 servos: every call has a deadline from the wire time, and one dead servo costs one servo."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from hardware.control_table.models import MODELS
from hardware.errors import NoReplyError, RefusedError
from hardware.port import Port, SerialPort
from hardware.protocol2 import instructions
from hardware.protocol2.frames import Parser, Status, as_status
from hardware.protocol2.instructions import FastReply

_MODEL_NAMES = {table.number: table.model for table in MODELS.values()}


class Identity(NamedTuple):
    """What a ping tells about a servo."""

    id: int
    model_number: int
    firmware: int
    alert: bool

    @property
    def model(self) -> str:
        """The model's name, or its number where the model is not known."""
        return _MODEL_NAMES.get(self.model_number, f"model number {self.model_number}")


_Ask = Callable[[Sequence[int]], dict[int, Status]]


class _Request(NamedTuple):
    """A fast sync read under way."""

    ids: tuple[int, ...]
    length: int
    deadline: float


class Bus:
    """Servos on one port.

    Calls that wait do so in poll(), until a deadline: the time the bytes need on the wire, plus `margin` for the
    adapter (a USB latency timer may hold a reply for 16 ms) and the servos' return delay. They are repeated at most
    `retries` times. That a servo has a hardware problem is a field of its answer (`alert`), never an exception.

    For a real-time loop there are three calls that never wait: `sync_write`, `request` and `collect`. Any other call
    gives up a request under way. Every call raises PortError when the port is gone.

    Attributes:
        port: what carries the bytes.
        baud: bits/s, 10 of which carry a byte.
    """

    def __init__(self, port: Port, baud: int, retries: int = 2, margin: float = 0.05) -> None:
        self.port = port
        self.baud = baud
        self._retries = retries
        self._margin = margin
        self._pending: _Request | None = None
        self._received = b""

    @classmethod
    def open(cls, name: str, baud: int) -> Bus:
        """The bus on a serial device.

        Raises:
            PortError: if it cannot be opened.
        """
        return cls(SerialPort(name, baud), baud)

    def wire_time(self, count: int) -> float:
        """How long so many bytes take on the wire, s."""
        return 10.0 * count / self.baud

    def ping(self, id: int) -> Identity | None:
        """Who answers at this ID; None if nobody does."""
        status = self._ask(instructions.ping(id), id, 3)
        if status is None or status.error:
            return None
        return Identity(id, status.params[0] | status.params[1] << 8, status.params[2], status.alert)

    def read(self, id: int, address: int, length: int) -> Status:
        """Reads `length` bytes of a servo's control table; they are the status' params.

        Raises:
            NoReplyError: if the servo stays silent.
            RefusedError: if it answers with an error number.
        """
        return self._insist(instructions.read(id, address, length), id, length, f"read register {address}")

    def write(self, id: int, address: int, data: bytes) -> Status:
        """Writes bytes into a servo's control table and waits for its answer.

        Raises:
            NoReplyError: if the servo stays silent.
            RefusedError: if it answers with an error number.
        """
        return self._insist(instructions.write(id, address, data), id, 0, f"write register {address}")

    def reboot(self, id: int) -> Status:
        """Restarts a servo, torque off; it is deaf for a moment afterwards.

        Raises:
            NoReplyError: if the servo stays silent.
            RefusedError: if it answers with an error number.
        """
        return self._insist(instructions.reboot(id), id, 0, "reboot")

    def sync_write(self, address: int, length: int, entries: bytes) -> bool:
        """Writes the same registers of many servos, without an answer and without waiting.

        Args:
            address: of the first byte to write.
            length: how many bytes each servo gets.
            entries: ID and `length` bytes, servo after servo.

        Returns:
            False if the port would not take the bytes: nothing is written then.
        """
        return self.port.send(instructions.sync_write(address, length, entries))

    def sync_read(self, ids: Sequence[int], address: int, length: int) -> dict[int, Status]:
        """Reads the same registers of many servos, one status each; who stays silent is missing from the answer."""

        def ask(line: Sequence[int]) -> dict[int, Status]:
            return self._gather(instructions.sync_read(address, length, line), line, length)

        return self._by_turns(ids, ask)

    def fast_sync_read(self, ids: Sequence[int], address: int, length: int) -> dict[int, Status]:
        """As `sync_read`, in one joint reply: fewer bytes, and the return delay is paid once."""

        def ask(line: Sequence[int]) -> dict[int, Status]:
            self._pending = None
            if not self.request(line, address, length):
                return {}
            while (reply := self.collect()) is None:
                self.port.wait(self._margin)
            return reply.statuses

        return self._by_turns(ids, ask)

    def request(self, ids: Sequence[int], address: int, length: int) -> bool:
        """Starts a fast sync read without waiting for its reply; False if one is under way or the port is full."""
        if self._pending is not None:
            return False
        self.port.receive()  # what came too late for the last request
        frame = instructions.fast_sync_read(address, length, ids)
        if not self.port.send(frame):
            return False
        count = len(frame) + instructions.fast_reply_length(len(ids), length)
        self._pending = _Request(tuple(ids), length, self.port.now() + self.wire_time(count) + self._margin)
        self._received = b""
        return True

    def collect(self) -> FastReply | None:
        """The reply to `request` as far as it has come by its deadline; None while it may still be on its way."""
        pending = self._pending
        if pending is None:
            return None
        late = self.port.now() >= pending.deadline
        self._received += self.port.receive()
        start = instructions.fast_reply_start(self._received)
        needed = instructions.fast_reply_length(len(pending.ids), pending.length)
        complete = start >= 0 and len(self._received) - start >= needed
        if not complete and not late:
            return None
        self._pending = None
        return instructions.fast_reply(self._received, pending.ids, pending.length)

    def close(self) -> None:
        """Gives the port back; may be called twice."""
        self.port.close()

    def _insist(self, frame: bytes, id: int, length: int, what: str) -> Status:
        """The status a servo answers with, or the reason why there is none."""
        status = self._ask(frame, id, length)
        if status is None:
            raise NoReplyError(
                f"id {id} on {self.port.name} does not answer ({what}). Check its power, cable, id and baud rate."
            )
        if status.error:
            meaning = instructions.ERRORS.get(status.error, "unknown error")
            raise RefusedError(f"id {id} on {self.port.name} refused to {what}: error {status.error}, {meaning}.")
        return status

    def _ask(self, frame: bytes, id: int, length: int) -> Status | None:
        """The status of one servo, asked again if it stays silent."""
        for _ in range(1 + self._retries):
            status = self._gather(frame, (id,), length).get(id)
            if status is not None:
                return status
        return None

    def _gather(self, frame: bytes, ids: Sequence[int], length: int) -> dict[int, Status]:
        """Sends a frame and waits until all these servos have answered or the deadline is over.

        An answer of another length than expected, unless it says why, is one that came too late for an earlier call.
        """
        self._pending = None
        self.port.receive()
        heard: dict[int, Status] = {}
        if not self.port.send(frame):
            return heard
        count = len(frame) + len(ids) * instructions.status_length(length)
        deadline = self.port.now() + self.wire_time(count) + self._margin
        parser = Parser()
        while len(heard) < len(ids) and (left := deadline - self.port.now()) > 0.0 and self.port.wait(left):
            for answer in parser.feed(self.port.receive()):
                status = as_status(answer)
                if status is not None and status.id in ids and (status.error or len(status.params) == length):
                    heard[status.id] = status
        return heard

    def _by_turns(self, ids: Sequence[int], ask: _Ask) -> dict[int, Status]:
        """Asks a line of servos until each has answered or has been silent at the head of the line too often.

        A servo waits for the one before it, so a silent one may hush all behind it: only the head of the line is to
        blame for itself. It goes to the back, and after `retries` more chances it is given up.
        """
        line = deque(ids)
        heard: dict[int, Status] = {}
        silent: dict[int, int] = {}
        while line:
            heard |= ask(tuple(line))
            line = deque(id for id in line if id not in heard)
            if line:
                head = line.popleft()
                silent[head] = silent.get(head, 0) + 1
                if silent[head] <= self._retries:
                    line.append(head)
        return heard
