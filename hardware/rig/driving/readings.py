"""State reads of a port's servos: the request of each tick, and the measurements in its reply.

Every request reads the position of every servo that answers. Health (error, temperature, torque, voltage) comes with it
where a servo's indirect cells are arranged (see `state_block`). Of the others, each request reads the health of one in
rotation, and at once of one whose alert bit reports a problem.

A request is about one family, and only some models can be asked together. Where that is not all of a port, requests
rotate: those of each family that can together, each other one alone, and between any two of these the largest group.

While all registers of a servo are wanted, some requests read a few of those instead (see `register_reading`).
"""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.families.family import Family
from hardware.families.replies import Blocks, GroupReply, WholeReply
from hardware.rig.counters import RigFaults
from hardware.rig.driving.register_reading import EVERY, RegisterReading
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale
from hardware.rig.state_block import StateBlock, everything, row_layout

_PATIENCE = 3  # replies in a row that a servo may miss before it is asked only at intervals
_ASK_AGAIN = 0.3  # s from one such request to the next: several before a silent servo is lost
_HURRY, _PLAY = 2.0, 0.05  # of its speed limit, and rad beside, by which a servo moves on from where it was seen
_VOLT = 0.1  # V, one count


class Request(NamedTuple):
    """One group read."""

    joints: NDArray[np.int64]  # their indices, in the order asked
    states: tuple[StateBlock, ...]  # the block of each
    blocks: Blocks  # (id, address, length) of each, for the bus
    layout: np.dtype[Any] | None  # of every block, None where they differ
    places: NDArray[np.int64] | slice  # the joints as an index of arrays of the whole rig
    # A buffer for the rows of whole replies and its view as records, by how the rows are laid out.
    rows: dict[tuple[int, int, int], tuple[bytearray, NDArray[Any]]]


class Measurements:
    """The latest measurements of J joints."""

    def __init__(self, count: int) -> None:
        # Shape (J,), rad, rad/s, A, positive in the joint's direction.
        self.positions, self.velocities, self.currents = np.zeros(count), np.zeros(count), np.zeros(count)
        # Where each was last read with torque on, shape (J,), rad: a restarted servo reports another turn; see `_see`.
        self.seen = np.zeros(count)
        # Shape (J,), degC, V; NaN until first read.
        self.temperatures, self.voltages = np.full(count, np.nan), np.full(count, np.nan)
        self.errors = np.zeros(count, dtype=np.int64)  # hardware error bits, shape (J,)
        self.torque = np.ones(count, dtype=np.bool_)  # whether torque is on, shape (J,)
        self.read_at = np.zeros(count)  # when each joint's position was last read, shape (J,), s
        # The current, A, and the angle, rad, by which two servos of a joint disagree, shape (J,).
        self.against, self.apart = np.zeros(count), np.zeros(count)
        # Each servo's own, from when it was switched on (see `OwnSettings`), shape (J,), degC, rad, bits.
        (self.hottest, self.slack), self.shutdown = np.full((2, count), np.nan), np.zeros(count, dtype=np.int64)
        # Replies that each joint has missed since its last one, shape (J,).
        self.missed_in_a_row = np.zeros(count, dtype=np.int64)
        self.alone = np.zeros(count, dtype=np.bool_)  # whether one of two servos of a joint is out of reach, shape (J,)


class Readings:
    """Reads the joints of one port into the measurements of their rig."""

    def __init__(
        self, config: RigConfig, joints: Sequence[int], scale: RigScale, measured: Measurements, faults: RigFaults
    ) -> None:
        """Reads nothing before `start`; `joints` are those of the port, as indices in the rig.

        In a rig with joints that two servos turn everything here is by servo, but `faults` are the joints'.
        """
        self.measured = measured  # of the whole rig
        self._joint_of = np.array(config.joint_of)
        servos = config.servos
        self._scale = scale
        self._faults = faults
        self._ids = [joint.id for joint in servos.joints]
        self._several = bool(servos.through_turns)
        self._hurry = _HURRY * np.array([joint.velocity for joint in servos.joints])
        self._seen_at = np.zeros(len(servos.joints))
        self._line_of_all = tuple(joints)
        self._all = slice(None) if len(joints) == len(servos.joints) else np.array(joints, dtype=np.int64)
        self._tables = [joint.table for joint in servos.joints]
        self._problems: NDArray[np.uint8] | None = None  # by joint and error bits, where they are not the usual ones
        if any(bit != own for table in self._tables for bit, own in table.series.problems.items()):
            usual = [[table.series.usual_problems(bits) for bits in range(256)] for table in self._tables]
            self._problems = np.array(usual, dtype=np.uint8)
        self._index = {self._ids[index]: index for index in self._line_of_all}
        self._everything = [everything(joint.table) for joint in servos.joints]
        self._blocks = list(self._everything)
        self._without_health: list[int] = []
        self._cached: dict[tuple[tuple[int, ...], frozenset[int]], Request] = {}
        self._requests = 0
        self._alerted: set[int] = set()
        self._asked: Request | RegisterReading | None = None  # what the next reply answers
        self.register_readings: deque[RegisterReading] = deque()  # servos whose registers are to be read, in order
        self._rotation = _rotation(servos, self._line_of_all)
        self._ask_again = round(_ASK_AGAIN * (config.read_hz or config.rate_hz))  # requests

    def start(self, joints: Sequence[int], positions: Array, blocks: Sequence[StateBlock], now: float) -> None:
        """Takes joints, as indices, as just switched on at their positions, rad, with torque and without an error."""
        where, measured = np.array(joints, dtype=np.int64), self.measured
        for index, block in zip(joints, blocks, strict=True):
            self._blocks[index] = block
        self._without_health = [index for index in self._line_of_all if not self._blocks[index].healthy]
        self._cached.clear()
        self._asked = None
        measured.positions[where] = measured.seen[where] = positions
        measured.velocities[where] = measured.currents[where] = 0.0
        measured.missed_in_a_row[where] = measured.errors[where] = 0
        measured.torque[where] = True
        measured.read_at[where] = self._seen_at[where] = now

    def next_request(self) -> Request:
        """What to request next; see `requested`."""
        line = self._line(self._rotation[self._requests % len(self._rotation)])
        wide = frozenset(self._alerted)
        if self._without_health:
            wide |= {self._without_health[self._rounds % len(self._without_health)]}
        return self._cached.get((line, wide)) or self._plan(line, wide)

    @property
    def _rounds(self) -> int:
        return self._requests // len(self._rotation)

    def every_request(self) -> Iterator[Request]:
        """Each that comes up while all servos answer and none reports a problem."""
        for group in self._rotation:
            line = self._line(group)
            for wide in [frozenset({index}) for index in self._without_health] or [frozenset[int]()]:
                yield self._plan(line, wide)

    def next_register_reading(self) -> RegisterReading | None:
        """The servo whose registers may be requested in place of `next_request`, if one is wanted."""
        queue = self.register_readings
        while queue and queue[0].done:
            queue.popleft()
        return queue[0] if queue and self._requests % EVERY == 0 else None

    def requested(self, request: Request | RegisterReading) -> None:
        """Notes that a request was sent: the next reply answers it."""
        self._requests += 1
        self._asked = request
        if isinstance(request, RegisterReading):
            request.write = b""
        else:
            self._alerted.clear()

    def take(self, reply: WholeReply | GroupReply, now: float) -> bool:
        """Takes the reply to the last request and counts what is missing; whether anything was measured."""
        request = self._asked
        if request is None:
            return False
        if isinstance(request, RegisterReading):
            id, self._asked = request.block[0], None
            status = (reply.statuses([id]) if isinstance(reply, WholeReply) else reply.statuses).get(id)
            request.take(None if status is None or status.error else status.params)
            return False
        if isinstance(reply, WholeReply):
            if request.layout is not None and self._take_whole(reply, request, request.layout, now):
                return True
            reply = GroupReply(reply.statuses([id for id, _, _ in request.blocks]), [], [], [])
        return self._take_each(reply, request, now)

    def _take_whole(self, reply: WholeReply, request: Request, layout: np.dtype[Any], now: float) -> bool:
        """All servos at once; False where one of them answered with an error number."""
        place = (reply.stride, reply.error, reply.data)
        if place not in request.rows:
            buffer = bytearray(len(reply.rows))
            request.rows[place] = buffer, np.frombuffer(buffer, dtype=row_layout(layout, *place))
        buffer, rows = request.rows[place]
        buffer[:] = reply.rows
        error = rows["error"]
        if np.logical_or.reduce(error & np.uint8(reply.alert ^ 0xFF)):
            return False
        self.measured.missed_in_a_row[request.places] = 0
        self._note_alerts(request.joints, error != 0)
        self._keep(request.places, rows, now)
        return True

    def _take_each(self, reply: GroupReply, request: Request, now: float) -> bool:
        """Servo by servo, where some are missing or their blocks differ."""
        measured = self.measured
        for id in reply.silent:
            measured.missed_in_a_row[self._index[id]] += 1
        for id in (*reply.silent, *reply.unheard):
            self._faults.missed[self._joint_of[self._index[id]]] += 1
        for id in reply.corrupt:
            self._faults.corrupt[self._joint_of[self._index[id]]] += 1
        block_of = dict(zip(request.joints.tolist(), request.states, strict=True))
        groups: dict[np.dtype[Any], tuple[list[int], list[bytes]]] = {}
        alerts = np.zeros(len(self._ids), dtype=np.bool_)
        for id, status in reply.statuses.items():
            index = self._index[id]
            measured.missed_in_a_row[index] = 0
            alerts[index] = status.alert
            if "hardware_error_status" not in self._tables[index].registers:
                measured.errors[index] = status.hardware
            if not status.error:
                joints, data = groups.setdefault(block_of[index].layout, ([], []))
                joints.append(index)
                data.append(status.params)
        self._note_alerts(np.arange(len(alerts)), alerts)
        for layout, (joints, data) in groups.items():
            self._keep(np.array(joints), np.frombuffer(b"".join(data), dtype=layout), now)
        return bool(groups)

    def _note_alerts(self, joints: NDArray[np.int64], alert: NDArray[np.bool_]) -> None:
        """Counts alert bits; a joint whose block lacks the reason is asked for it next."""
        if np.logical_or.reduce(alert):
            self._faults.alert[self._joint_of[joints]] += alert
            self._alerted.update(index for index in joints[alert].tolist() if index in self._without_health)

    def _keep(self, joints: NDArray[np.int64] | slice, rows: NDArray[Any], now: float) -> None:
        """Takes over what joints measured; an arranged servo that has restarted shows nothing but zeros."""
        measured = self.measured
        measured.read_at[joints] = now
        positions, velocities, currents = self._scale.motion(joints, rows)
        names = rows.dtype.names or ()
        if "torque_enable" in names:
            torque = rows["torque_enable"] != 0
            if "torque_limit" in names:
                torque &= rows["torque_limit"] != 0
            blank = ~torque & (rows["present_temperature"] == 0) & (rows["present_input_voltage"] == 0)
            measured.torque[joints] = torque
            if self._several:
                self._see(joints, positions, torque, now)
            if np.logical_or.reduce(blank):
                indices, known = np.arange(len(self._ids))[joints], ~blank
                measured.errors[indices[blank]] = 0
                joints, rows = indices[known], rows[known]
                positions, velocities, currents = positions[known], velocities[known], currents[known]
            if "hardware_error_status" in names:
                errors = rows["hardware_error_status"]
                if self._problems is not None:
                    errors = self._problems[np.arange(len(self._ids))[joints], errors]
                measured.errors[joints] = errors
            measured.temperatures[joints] = rows["present_temperature"]
            measured.voltages[joints] = rows["present_input_voltage"] * _VOLT
        measured.positions[joints] = positions
        measured.velocities[joints] = velocities
        measured.currents[joints] = currents

    def _see(self, joints: NDArray[np.int64] | slice, positions: Array, torque: NDArray[np.bool_], now: float) -> None:
        """Notes where servos with torque are, unless that is farther than they can have come: another may answer."""
        seen, at = self.measured.seen, self._seen_at
        near = np.abs(positions - seen[joints]) < self._hurry[joints] * (now - at[joints]) + _PLAY
        seen[joints] = np.where(torque & near, positions, seen[joints])
        at[joints] = np.where(torque & near, now, at[joints])

    def _plan(self, line: tuple[int, ...], wide: frozenset[int]) -> Request:
        """The cached request to a line of joints, those in `wide` for everything."""
        states = tuple(self._everything[index] if index in wide else self._blocks[index] for index in line)
        blocks = tuple((self._ids[i], block.address, block.length) for i, block in zip(line, states, strict=True))
        layout = states[0].layout if len({block.layout for block in states}) == 1 else None
        joints = np.array(line)
        places = self._all if line == self._line_of_all else joints
        request = Request(joints, states, blocks, layout, places, {})
        if len(self._cached) > 4 * len(self._ids):
            self._cached.clear()
        self._cached[line, wide] = request
        return request

    def _line(self, group: tuple[int, ...]) -> tuple[int, ...]:
        """The joints of a group to ask, in order."""
        # A silent servo may silence all behind it, so one that missed a reply comes last; one that missed several is
        # asked only at intervals, alone, because waiting for it makes all states older.
        missed = self.measured.missed_in_a_row
        if not np.logical_or.reduce(missed):
            return group
        good = [index for index in group if missed[index] == 0]
        doubtful = [index for index in group if 0 < missed[index] < _PATIENCE]
        lost = [index for index in group if missed[index] >= _PATIENCE]
        # All at the same intervals; counted in requests to this line, so that none is skipped.
        number, rest = divmod(self._rounds, max(1, self._ask_again // (len(self._rotation) * max(1, len(lost)))))
        again = [lost[number % len(lost)]] if lost and (rest == 0 or not good + doubtful) else []
        return tuple(good + doubtful + again)


def _rotation(servos: RigConfig, joints: tuple[int, ...]) -> list[tuple[int, ...]]:
    """The joints of each request, which repeat in this order."""
    tables = {index: servos.joints[index].table for index in joints}
    groups: dict[Family, list[int]] = {}
    for index, table in tables.items():
        if table.series.bulk_reads:
            groups.setdefault(table.family, []).append(index)
    largest, *others = sorted(groups.values(), key=len, reverse=True) or [[]]
    alone = [[index] for index, table in tables.items() if not table.series.bulk_reads]
    return [tuple(group) for other in [*others, *alone] for group in (largest, other) if group] or [joints]
