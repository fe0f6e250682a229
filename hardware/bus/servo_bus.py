"""A bus of servos, of one family or several: every call has a deadline, and one dead servo costs one servo."""

from collections import Counter, deque
from collections.abc import Mapping
from typing import NamedTuple, Self

from hardware.bus.port import Port, SerialPort, WithoutEcho, returns_what_is_sent
from hardware.errors import NoReplyError, RefusedError
from hardware.families.family import Family
from hardware.families.frames import BROADCAST, ERRORS, StatusPacket
from hardware.families.models import FAMILIES, USUAL, known_name, model_name
from hardware.families.replies import Blocks, GroupRead, GroupReply, WholeReply

UNKNOWN_MODEL = 0  # instead of a model number: a servo that answers a ping, which tells no model, and no read
_REQUESTS_KEPT = 256
_SHORT_MARGIN = 0.02  # s for an adapter, where hundreds of IDs are silent
_PATIENCE = 0.4  # s for an adapter or a program in between that was kept from running


class Identity(NamedTuple):
    """Model and firmware of a servo; the firmware is 0 where the model number is UNKNOWN_MODEL."""

    id: int
    model_number: int
    firmware: int
    alert: bool
    family: Family = USUAL

    @property
    def model(self) -> str:
        """The model's name, or its number where the model is not known."""
        mute = self.model_number == UNKNOWN_MODEL
        return "servo that answers only a ping" if mute else model_name(self.model_number, self.family)


class Bus:
    """Servos on one port.

    Calls that wait do so in poll(), until a deadline: the time the bytes need on the wire, plus `margin` for the
    adapter (a USB latency timer may hold a reply for 16 ms) and the servos' return delay. They are repeated at most
    `retries` times. On a busy machine the adapter's driver may be delayed for longer: a `ping`, `read` or `write` gets
    one more, long deadline before it fails, unless that failed the last time and no servo has answered since. A
    servo's hardware problem is a field of its answer (`alert`), never an exception.

    For a real-time loop there are calls that never wait: `sync_write`, `request` and `collect`. Any other call
    gives up a request under way. Every call raises SerialPortError when the port is gone.

    A group read that waits asks together what the family allows whatever the models (`Family.lines`); a `request` is
    about servos of one family, whose models are known to answer it.
    """

    def __init__(self, port: Port, baud: int, retries: int = 2, margin: float = 0.05) -> None:
        self.port = port  # carries the bytes
        self.baud = baud  # bits/s, 10 of which carry a byte
        self._byte_time = 10.0 / baud
        self.busy = 0.0  # s on the wire of what the loop has sent, and of the whole answers to it
        self.families: Mapping[int, Family] = {}  # of servos by ID; an ID that is not in it is of the usual family
        # Whether the adapter returns what is sent, which is then dropped (see `echo`); None until known.
        self.echoes: bool | None = None
        # Whether bytes have come instead of the last answer that was waited for, or between those of a ping to all: two
        # servos may have answered at the same time.
        self.garbled = False
        self._retries = retries
        self._margin = margin
        self._patient = True  # whether a last wait may be a long one
        self._requests: dict[tuple[Blocks, bool], GroupRead] = {}
        self._pending: GroupRead | None = None  # the one whose reply is awaited
        self._due = 0.0  # when all of it has arrived, if nothing holds it up
        self._received = b""
        self._given_early: set[int] = set()  # IDs whose statuses `collect_early` has given
        self._may_be_late = True  # whether bytes of an earlier answer may still come, so that they must be discarded

    @classmethod
    def open(cls, name: str, baud: int) -> Self:
        """The bus on a serial device."""
        return cls(SerialPort(name, baud), baud)

    def wire_time(self, count: int) -> float:
        """The time of `count` bytes on the wire, s."""
        return count * self._byte_time

    def ping(self, id: int) -> Identity | None:
        """The servo that answers at this ID; None if none does."""
        family = self._family(id)
        identified, ping = family.identification, family.instructions.ping(id)
        if not identified.by_ping:
            return None if self._ask_patiently(ping, id, 0) is None else self._look_up(id, family)
        status = self._ask_patiently(ping, id, identified.length)
        return None if status is None or status.error else _identity(status, family)

    def _look_up(self, id: int, family: Family) -> Identity:
        """What a servo is that has answered a ping; of families whose pings look alike, the one that it fits."""
        found: list[tuple[bool, bool, bool, Identity]] = []
        alike = [other for other in FAMILIES if other.dialect == family.dialect]
        for one in sorted(alike, key=lambda other: other is not family):
            identified = one.identification
            status = self._ask_patiently(one.instructions.read(id, 0, identified.length), id, identified.length)
            if status is None or status.error:
                continue
            identity = _identity(status, one)
            unknown = known_name(identity.model_number, one) is None
            # A servo of the usual family that was set to this one has its ID where it always is.
            elsewhere = identified.id is not None and status.params[identified.id] != id
            if not elsewhere or (one.choice is not None and not unknown):
                found.append((elsewhere, unknown, one is not family, identity))
        return min(found, key=lambda each: each[:3])[3] if found else Identity(id, UNKNOWN_MODEL, 0, False, family)

    def read(self, id: int, address: int, length: int) -> StatusPacket:
        """Reads `length` bytes of a servo's control table; they are the status' params.

        NoReplyError if the servo stays silent. RefusedError if it answers with an error number.
        """
        frame = self._family(id).instructions.read(id, address, length)
        return self._insist(frame, id, length, f"read register {address}")

    def write(self, id: int, address: int, data: bytes) -> StatusPacket:
        """Writes bytes into a servo's control table and waits for its answer; errors as of `read`."""
        frame = self._family(id).instructions.write(id, address, data)
        return self._insist(frame, id, 0, f"write register {address}")

    def restart(self, id: int) -> None:
        """Restarts a servo that can be; it is deaf and without torque for a while. Errors as of `read`."""
        if (reboot := self._family(id).reboot) is None:
            raise RefusedError(f"id {id} on {self.port.name} cannot be restarted. Switch its power off and on.")
        self._insist(reboot(id), id, 0, "restart")

    def sync_write(self, address: int, length: int, entries: bytes) -> bool:
        """Writes the same registers of many servos of one family, unanswered; False if the port takes no bytes.

        The `entries` are ID and `length` bytes, servo after servo.
        """
        return self.send(self._family(entries[0]).instructions.sync_write(address, length, entries))

    def send(self, data: bytes, answer: int = 0) -> bool:
        """Sends frames that are answered by some bytes, and does not wait; False if the port takes no bytes."""
        if sent := self.port.send(data):
            self.busy += (len(data) + answer) * self._byte_time
        return sent

    def bulk_read(self, blocks: Blocks, fast: bool = False) -> dict[int, StatusPacket]:
        """Reads (id, address, length) of each servo, all in one reply if `fast`; silent ones are not in the result."""
        # A servo waits for the one before it, so a silent one may silence all behind it: only the first in the line is
        # known to be silent itself. It goes to the back, and after `retries` more chances it is given up.
        heard: dict[int, StatusPacket] = {}
        for line in self._lines(blocks):
            heard |= self._read_line(line, fast)
        return heard

    def _lines(self, blocks: Blocks) -> list[Blocks]:
        """The blocks that may be asked for together."""
        by_family: dict[Family, list[tuple[int, int, int]]] = {}
        for block in blocks:
            by_family.setdefault(self._family(block[0]), []).append(block)
        return [line for family, own in by_family.items() for line in family.lines(tuple(own))]

    def _read_line(self, blocks: Blocks, fast: bool) -> dict[int, StatusPacket]:
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

        Blocks are (id, address, length) of each servo of one family; `fast` wants one joint reply, which not every
        model can. Frames without an answer (`before`) go out in the same write, in front of the question. On False
        nothing is sent.
        """
        if self._pending is not None:
            return False
        request = self._requests.get((blocks, fast)) or self._plan(blocks, fast)
        if self._may_be_late:
            self._discard()
        data = before + request.frame
        if not self.send(data, request.needed):
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
        """The servos of the usual family that answer a broadcast ping, in order of ID; waits for the slowest of 253."""
        self._pending = None
        self._discard()
        if not self.port.send(USUAL.instructions.ping(BROADCAST)):
            return []
        # Each waits for its turn, at most its return delay of 508 us and its own answer.
        length = USUAL.status_length(USUAL.identification.length)
        deadline = self.port.now() + 253 * (self.wire_time(length) + 5.08e-4) + self._margin
        quiet = 0.1 + self._margin
        parser, found, unread = USUAL.parser(), {}, 0
        last = self.port.now()
        while (now := self.port.now()) < min(deadline, last + quiet):
            self.port.wait(min(deadline, last + quiet) - now)
            received = self.port.receive()
            unread += len(received)
            for frame in parser.feed(received):
                last = self.port.now()
                unread -= USUAL.status_length(len(frame.params) - 1)
                status = USUAL.as_status(frame)
                if status is not None and len(status.params) == USUAL.identification.length:
                    found[status.id] = _identity(status, USUAL)
        self.garbled = unread > 0
        return [found[id] for id in sorted(found)]

    def ping_each(self) -> list[Identity]:
        """The servos of the other families that answer, in order of ID."""
        # A broadcast ping tells only whether there are any, since some families answer it all at once; then each ID is
        # asked.
        asked = {family.dialect: family for family in reversed(FAMILIES) if not family.identification.by_ping}
        return [identity for family in asked.values() for identity in self._ping_each(family)]

    def _ping_each(self, family: Family) -> list[Identity]:
        self._pending = None
        self._discard()
        ping = family.instructions.ping(BROADCAST)
        for _ in range(2):
            if not self.port.send(ping) or not self.port.wait(self.wire_time(2 * len(ping)) + self._margin):
                return []
            self.port.wait(self._margin)
            if not (self.port.receive().startswith(ping) and self._drops_echo(family)):
                break
        before = self.families, self._retries, self._margin
        self.families = dict.fromkeys(range(BROADCAST), family)
        self._retries, self._margin = 0, min(self._margin, _SHORT_MARGIN)
        try:
            return [identity for id in range(BROADCAST) if (identity := self.ping(id)) is not None]
        finally:
            self.families, self._retries, self._margin = before

    def close(self) -> None:
        """Closes the port; may be called twice."""
        self.port.close()

    def _family(self, id: int) -> Family:
        return self.families.get(id, USUAL)

    def _insist(self, frame: bytes, id: int, length: int, what: str) -> StatusPacket:
        """The status a servo answers with, or the reason why there is none."""
        status = self._ask_patiently(frame, id, length)
        if status is None:
            raise NoReplyError(f"id {id} on {self.port.name} does not answer ({what}). Check power, cable, id, baud.")
        if status.error:
            meaning = ERRORS.get(status.error, "unknown error")
            raise RefusedError(f"id {id} on {self.port.name} refused to {what}: error {status.error}, {meaning}.")
        return status

    def _ask_patiently(self, frame: bytes, id: int, length: int) -> StatusPacket | None:
        """The status of one servo, asked again if it stays silent, at last with a long deadline (but in a scan)."""
        margins = [self._margin] * (1 + self._retries) + [_PATIENCE] * bool(self._patient and self._retries)
        status, asked = None, 0
        while status is None and asked < len(margins):
            status = self._exchange(frame, id, length, margins[asked])
            asked += 1
        if asked > 1 and (status is not None or margins[-1] == _PATIENCE):
            self._outlast_repeats()
        self._patient = status is not None
        return status

    def _outlast_repeats(self) -> None:
        """Discards late replies to a repeated request, which the next request would take for its own."""
        end = self.port.now() + 2.0 * self._margin * (1 + self._retries)
        while (left := end - self.port.now()) > 0.0 and self.port.wait(min(left, 2.0 * self._margin)):
            self._discard()

    def _exchange(self, frame: bytes, id: int, length: int, margin: float) -> StatusPacket | None:
        """Sends a frame and waits until this servo has answered or the deadline is over."""
        # An answer of an unexpected length and without an error number came too late for an earlier call.
        self._pending, self.garbled = None, False
        self.port.wait(0.0)  # what has arrived may still be on its way through the kernel; this waits for that
        self._discard()
        if not self.port.send(frame):
            return None
        family = self._family(id)
        deadline = self.port.now() + self.wire_time(len(frame) + family.status_length(length)) + margin
        parser, read = family.parser(), family.as_status
        unread, heard = 0, b""
        while (left := deadline - self.port.now()) > 0.0 and self.port.wait(left):
            received = self.port.receive()
            unread += len(received)
            heard += received
            for answer in parser.feed(received):
                unread = 0
                status = read(answer)
                if status is not None and status.id == id and (status.error or len(status.params) == length):
                    if family.mirrors and heard.startswith(frame) and self._drops_echo(family):
                        return self._exchange(frame, id, length, margin)
                    return status
        self.garbled = unread > 0
        return None

    def _drops_echo(self, family: Family) -> bool:
        """Whether the port turns out to be one with an echo, which it drops from now on."""
        if self.echoes is not None:
            return False
        self.echoes = returns_what_is_sent(self.port, family, self._margin)
        if self.echoes:
            self.port = WithoutEcho(self.port)
        return self.echoes

    def _discard(self) -> None:
        self.port.receive()
        self._may_be_late = True

    def _plan(self, blocks: Blocks, fast: bool) -> GroupRead:
        """A group read, which is kept: a loop asks the same again."""
        if len(self._requests) >= _REQUESTS_KEPT:
            self._requests.clear()
        request = self._requests[blocks, fast] = self._family(blocks[0][0]).group_read(blocks, fast)
        return request

    def _ask_group(self, blocks: Blocks, fast: bool) -> dict[int, StatusPacket]:
        self._pending = None
        if not blocks or not self.request(blocks, fast) or (request := self._pending) is None:
            return {}
        while True:
            self.port.wait(self._margin)
            if (reply := self.collect()) is not None:
                return reply.statuses if isinstance(reply, GroupReply) else reply.statuses(request.ids)


def _identity(status: StatusPacket, family: Family) -> Identity:
    return Identity(status.id, *family.identification.read(status.params), status.alert, family)
