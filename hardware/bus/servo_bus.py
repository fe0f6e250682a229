"""A bus of servos of Protocol 2.0, 1.0 or both.

Every call has a deadline from the wire time, and one dead servo costs one servo.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from typing import NamedTuple

from hardware.bus.echo import WithoutEcho, returns_what_is_sent
from hardware.bus.group_read import Blocks, GroupRead, group_read
from hardware.bus.port import Port, SerialPort
from hardware.bus.protocol import PROTOCOLS, Protocol
from hardware.errors import NoReplyError, RefusedError
from hardware.families.dynamixel2 import instructions
from hardware.families.dynamixel2.frames import BROADCAST, StatusPacket
from hardware.families.dynamixel2.group_reply import GroupReply, WholeReply, status_length
from hardware.families.models import model_name

UNKNOWN_MODEL = 0
"""Instead of a model number: a servo of Protocol 1.0 that answers a ping, which tells no model, and no read."""
_PROTOCOL1, _PROTOCOL2 = PROTOCOLS[1], PROTOCOLS[2]
_REQUESTS_KEPT = 256
_SHORT_MARGIN = 0.02  # s for an adapter, where hundreds of IDs are silent
_PATIENCE = 0.4  # s for an adapter or a program in between that was kept from running


class Identity(NamedTuple):
    """Model and firmware of a servo; the firmware is 0 where the model number is UNKNOWN_MODEL."""

    id: int
    model_number: int
    firmware: int
    alert: bool
    protocol: int = 2

    @property
    def model(self) -> str:
        """The model's name, or its number where the model is not known."""
        return model_name(self.model_number) if self.model_number != UNKNOWN_MODEL else "servo that answers only a ping"

    @property
    def spoken(self) -> str:
        """The protocol as an addition to a sentence, "" for the usual one."""
        return "" if self.protocol == 2 else f" in Protocol {self.protocol}.0"


class Bus:
    """Servos on one port.

    Calls that wait do so in poll(), until a deadline: the time the bytes need on the wire, plus `margin` for the
    adapter (a USB latency timer may hold a reply for 16 ms) and the servos' return delay. They are repeated at most
    `retries` times. On a busy machine the adapter's driver may be delayed for longer: a `ping`, `read` or `write` gets
    one more, long deadline before it fails, unless that failed the last time and no servo has answered since. A
    servo's hardware problem is a field of its answer (`alert`), never an exception.

    For a real-time loop there are calls that never wait: `sync_write`, `request` and `collect`. Any other call
    gives up a request under way. Every call raises SerialPortError when the port is gone.

    Protocol 1.0 has no sync read, and only MX servos know a bulk read: there a group read that waits asks one servo
    after the other, and a `request` is about one servo, or several MX.

    Attributes:
        port: carries the bytes.
        baud: bits/s, 10 of which carry a byte.
        protocols: the protocol (1 or 2) of servos by ID; an ID that is not in it speaks 2.0.
        echoes: whether the adapter returns what is sent, which is then dropped (see `echo`); None while nothing has
            looked like it.
        garbled: whether bytes have come instead of the last answer that was waited for, or between those of a ping to
            all: two servos may have answered at the same time.
    """

    def __init__(self, port: Port, baud: int, retries: int = 2, margin: float = 0.05) -> None:
        self.port = port
        self.baud = baud
        self._byte_time = 10.0 / baud
        self.protocols: Mapping[int, int] = {}
        self.echoes: bool | None = None
        self.garbled = False
        self._retries = retries
        self._margin = margin
        self._patient = True  # whether a last wait may be a long one
        self._requests: dict[tuple[Blocks, bool], GroupRead] = {}
        self._asked: tuple[Blocks, bool, GroupRead | None] = (), False, None  # last: a loop asks the same again
        self._pending: GroupRead | None = None  # the one whose reply is awaited
        self._due = 0.0  # when all of it has arrived, if nothing holds it up
        self._received = b""
        self._given_early: set[int] = set()  # IDs whose statuses `collect_early` has given
        self._may_be_late = True  # whether bytes of an earlier answer may still come, so that they must be discarded

    @classmethod
    def open(cls, name: str, baud: int) -> Bus:
        """The bus on a serial device."""
        return cls(SerialPort(name, baud), baud)

    def wire_time(self, count: int) -> float:
        """The time of `count` bytes on the wire, s."""
        return count * self._byte_time

    def ping(self, id: int) -> Identity | None:
        """The servo that answers at this ID; None if none does."""
        protocol = self._protocol(id)
        ping = protocol.instructions.ping(id)
        if protocol is _PROTOCOL2:
            status = self._ask_patiently(ping, id, 3)
            return None if status is None or status.error else self._identity(status)
        # The reply to a ping of Protocol 1.0 is empty; model number and firmware are the first registers.
        if self._ask_patiently(ping, id, 0) is None:
            return None
        status = self._ask_patiently(protocol.instructions.read(id, 0, 3), id, 3)
        return Identity(id, UNKNOWN_MODEL, 0, False, 1) if status is None or status.error else self._identity(status)

    def read(self, id: int, address: int, length: int) -> StatusPacket:
        """Reads `length` bytes of a servo's control table; they are the status' params.

        Raises:
            NoReplyError: if the servo stays silent.
            RefusedError: if it answers with an error number.
        """
        frame = self._protocol(id).instructions.read(id, address, length)
        return self._insist(frame, id, length, f"read register {address}")

    def write(self, id: int, address: int, data: bytes) -> StatusPacket:
        """Writes bytes into a servo's control table and waits for its answer; errors as of `read`."""
        frame = self._protocol(id).instructions.write(id, address, data)
        return self._insist(frame, id, 0, f"write register {address}")

    def restart(self, id: int) -> None:
        """Restarts a servo that can be; it is deaf and without torque for a while. Errors as of `read`."""
        self._insist(self._protocol(id).instructions.reboot(id), id, 0, "restart")

    def sync_write(self, address: int, length: int, entries: bytes) -> bool:
        """Writes the same registers of many servos of one protocol, unanswered; False if the port takes no bytes.

        The `entries` are ID and `length` bytes, servo after servo.
        """
        words = self._protocol(entries[0]).instructions
        return self.port.send(words.sync_write(address, length, entries))

    def bulk_read(self, blocks: Blocks, fast: bool = False) -> dict[int, StatusPacket]:
        """Reads (id, address, length) of each servo, all in one reply if `fast`; silent ones are not in the result.

        A servo waits for the one before it, so a silent one may silence all behind it: only the first in the line is
        known to be silent itself. It goes to the back, and after `retries` more chances it is given up.
        """
        together = tuple(block for block in blocks if self._protocol(block[0]).group_reads)
        if len(together) < len(blocks):
            heard = self.bulk_read(together, fast)
            for id, address, length in blocks:
                if not (protocol := self._protocol(id)).group_reads:
                    status = self._ask(protocol.instructions.read(id, address, length), id, length)
                    heard |= {} if status is None else {id: status}
            return heard
        heard = self._ask_group(blocks, fast)
        if len(heard) == len(blocks):
            return heard
        line = deque(block for block in blocks if block[0] not in heard)
        silent: Counter[int] = Counter()
        while line:
            head = line.popleft()
            silent[head[0]] += 1
            if silent[head[0]] <= self._retries:
                line.append(head)
            heard |= self._ask_group(tuple(line), fast)
            line = deque(block for block in line if block[0] not in heard)
        return heard

    def request(self, blocks: Blocks, fast: bool = True, before: bytes = b"") -> bool:
        """Starts a group read without waiting for its reply; False if one is under way or the port is full.

        Nothing is sent then, neither the question nor what should go before it.

        Args:
            blocks: (id, address, length) of each servo of one protocol; a sync read where all ask for the same, else
                a bulk read; under Protocol 1.0 one servo, or MX servos.
            fast: whether all answer in one joint reply, which not every model can.
            before: frames without an answer, sent in one write with the question and in front of it.
        """
        if self._pending is not None:
            return False
        asked, was_fast, request = self._asked
        if asked is not blocks or was_fast is not fast or request is None:
            request = self._plan(blocks, fast)
        if self._may_be_late:
            self._discard()
        data = before + request.frame
        if not self.port.send(data):
            return False
        self._pending, self._may_be_late = request, True
        self._due = self.port.now() + (len(data) + request.needed) * self._byte_time
        self._received = b""
        self._given_early.clear()
        return True

    def collect(self) -> WholeReply | GroupReply | None:
        """The reply to `request` as far as it has come by its deadline; None while it may still be on its way.

        Rows of equal length in which every servo answered come as a `WholeReply`.
        """
        pending = self._pending
        if pending is None:
            return None
        now = self.port.now()
        received = self.port.receive(now > self._due)
        if self._received:
            received = self._received + received
        if pending.whole is not None and len(received) >= pending.needed and (reply := pending.whole(received)):
            self._pending, self._may_be_late = None, False
            return reply
        self._received = received
        reply = pending.understand(received, now >= self._due + self._margin)
        if reply is not None:
            self._pending = None
        return self._new(reply) if reply is not None and self._given_early else reply

    def collect_early(self) -> GroupReply | None:
        """New partial replies to an overdue `request`; None without any."""
        pending = self._pending
        if pending is None or not self._received or self.port.now() <= self._due:
            return None
        reply = pending.understand(self._received, True)
        statuses = self._new(reply).statuses if reply is not None else {}
        self._given_early.update(statuses)
        return GroupReply(statuses, [], [], []) if statuses else None

    def _new(self, reply: GroupReply) -> GroupReply:
        """The reply without the statuses that `collect_early` has given."""
        return reply._replace(statuses={id: each for id, each in reply.statuses.items() if id not in self._given_early})

    def ping_all(self) -> list[Identity]:
        """The servos of Protocol 2.0 that answer a broadcast ping, in order of ID; waits for the slowest of 253."""
        self._pending = None
        self._discard()
        if not self.port.send(instructions.ping(BROADCAST)):
            return []
        # Each waits for its turn, at most its return delay of 508 us and its own 14 bytes.
        deadline = self.port.now() + 253 * (self.wire_time(status_length(3)) + 5.08e-4) + self._margin
        quiet = 0.1 + self._margin
        parser, found, unread = _PROTOCOL2.parser(), {}, 0
        last = self.port.now()
        while (now := self.port.now()) < min(deadline, last + quiet):
            self.port.wait(min(deadline, last + quiet) - now)
            received = self.port.receive()
            unread += len(received)
            for frame in parser.feed(received):
                last = self.port.now()
                unread -= status_length(len(frame.params) - 1)
                status = _PROTOCOL2.as_status(frame)
                if status is not None and len(status.params) == 3:
                    found[status.id] = self._identity(status)
        self.garbled = unread > 0
        return [found[id] for id in sorted(found)]

    def ping_each(self) -> list[Identity]:
        """The servos of Protocol 1.0 that answer, in order of ID.

        They answer a broadcast ping all at once, so it tells only whether there are any; then each ID is asked.
        """
        self._pending = None
        self._discard()
        ping = _PROTOCOL1.instructions.ping(BROADCAST)
        for _ in range(2):
            if not self.port.send(ping) or not self.port.wait(self.wire_time(2 * len(ping)) + self._margin):
                return []
            self.port.wait(self._margin)
            if not (self.port.receive().startswith(ping) and self._drops_echo()):
                break
        before = self.protocols, self._retries, self._margin
        self.protocols = dict.fromkeys(range(BROADCAST), 1)
        self._retries, self._margin = 0, min(self._margin, _SHORT_MARGIN)
        try:
            return [identity for id in range(BROADCAST) if (identity := self.ping(id)) is not None]
        finally:
            self.protocols, self._retries, self._margin = before

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self.port.close()

    def _protocol(self, id: int) -> Protocol:
        return PROTOCOLS[self.protocols.get(id, 2)]

    def _identity(self, status: StatusPacket) -> Identity:
        number, firmware = status.params[0] | status.params[1] << 8, status.params[2]
        return Identity(status.id, number, firmware, status.alert, self.protocols.get(status.id, 2))

    def _insist(self, frame: bytes, id: int, length: int, what: str) -> StatusPacket:
        """The status a servo answers with, or the reason why there is none."""
        status = self._ask_patiently(frame, id, length)
        if status is None:
            raise NoReplyError(
                f"id {id} on {self.port.name} does not answer ({what}). Check its power, cable, id and baud rate."
            )
        if status.error:
            meaning = instructions.ERRORS.get(status.error, "unknown error")
            raise RefusedError(f"id {id} on {self.port.name} refused to {what}: error {status.error}, {meaning}.")
        return status

    def _ask_patiently(self, frame: bytes, id: int, length: int) -> StatusPacket | None:
        """The status of one servo, with a long last deadline unless there are no retries, as in a scan."""
        status = self._ask(frame, id, length)
        if status is None and self._patient and self._retries:
            status = self._exchange(frame, id, length, _PATIENCE)
            self._outlast_repeats()
        self._patient = status is not None
        return status

    def _ask(self, frame: bytes, id: int, length: int) -> StatusPacket | None:
        """The status of one servo, asked again if it stays silent."""
        for attempt in range(1 + self._retries):
            status = self._exchange(frame, id, length, self._margin)
            if status is not None:
                if attempt:
                    self._outlast_repeats()
                return status
        return None

    def _outlast_repeats(self) -> None:
        """Discards late replies to a repeated request, which the next request would take for its own."""
        end = self.port.now() + 2.0 * self._margin * (1 + self._retries)
        while (left := end - self.port.now()) > 0.0 and self.port.wait(min(left, 2.0 * self._margin)):
            self._discard()

    def _exchange(self, frame: bytes, id: int, length: int, margin: float) -> StatusPacket | None:
        """Sends a frame and waits until this servo has answered or the deadline is over.

        An answer of an unexpected length and without an error number came too late for an earlier call; it is ignored.
        """
        self._pending, self.garbled = None, False
        self.port.wait(0.0)  # what has arrived may still be on its way through the kernel; this waits for that
        self._discard()
        if not self.port.send(frame):
            return None
        deadline = self.port.now() + self.wire_time(len(frame) + status_length(length)) + margin
        protocol = self._protocol(id)
        parser, read = protocol.parser(), protocol.as_status
        unread, heard = 0, b""
        while (left := deadline - self.port.now()) > 0.0 and self.port.wait(left):
            received = self.port.receive()
            unread += len(received)
            heard += received
            for answer in parser.feed(received):
                unread = 0
                status = read(answer)
                if status is not None and status.id == id and (status.error or len(status.params) == length):
                    if protocol is _PROTOCOL1 and heard.startswith(frame) and self._drops_echo():
                        return self._exchange(frame, id, length, margin)
                    return status
        self.garbled = unread > 0
        return None

    def _drops_echo(self) -> bool:
        """Whether the port turns out to be one with an echo, which it drops from now on."""
        if self.echoes is not None:
            return False
        self.echoes = returns_what_is_sent(self.port, self._margin)
        if self.echoes:
            self.port = WithoutEcho(self.port)
        return self.echoes

    def _discard(self) -> None:
        self.port.receive()
        self._may_be_late = True

    def _plan(self, blocks: Blocks, fast: bool) -> GroupRead:
        request = self._requests.get((blocks, fast))
        if request is None:
            request = group_read(blocks, fast, self._protocol(blocks[0][0]))
            if len(self._requests) >= _REQUESTS_KEPT:
                self._requests.clear()
            self._requests[blocks, fast] = request
        self._asked = blocks, fast, request
        return request

    def _ask_group(self, blocks: Blocks, fast: bool) -> dict[int, StatusPacket]:
        self._pending = None
        if not blocks or not self.request(blocks, fast) or (request := self._pending) is None:
            return {}
        while True:
            self.port.wait(self._margin)
            if (reply := self.collect()) is not None:
                return reply.statuses if isinstance(reply, GroupReply) else reply.statuses(request.ids)
