"""Reading the state of a port's servos: whom to ask for what in each tick, and what they have answered.

Every request brings the position of every servo that answers. Health (error, temperature, torque, voltage) comes with
it where a servo's indirect cells are arranged (see `state_block`). The others are asked for it in turns, one in each
request, and at once where the alert bit of an answer reports a problem.

Servos of Protocol 1.0 have no sync read. On a port with some, requests go in turns: MX servos together in a bulk read,
each AX and RX on its own, and between any two of these the servos of Protocol 2.0 if there are any.

When somebody wants to see all registers of a servo, now and then a request asks for a few of those instead (see
`register_reading`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.group_read import Blocks
from hardware.control_table.models import MODELS
from hardware.protocol2.frames import ALERT
from hardware.protocol2.group_reply import GroupReply, WholeReply
from hardware.rig.driving.register_reading import EVERY, RegisterReading
from hardware.rig.driving.state_block import StateBlock, everything, row_layout
from hardware.rig.faults import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale

_PATIENCE = 3  # replies in a row that a servo may miss before it is asked only now and then
_ASK_AGAIN = 0.3  # s from one such question to the next: several before a silent servo is lost
_VOLT = 0.1  # V, one count
_XL_320 = np.array([MODELS["XL-320"].problems(bits) for bits in range(256)])


class Question(NamedTuple):
    """What one request asks.

    Attributes:
        joints: their indices, in the order asked.
        blocks: what each is asked for.
        asked: the same for the bus.
        layout: of every block, None where they differ.
        all: whether every joint is asked, in the order of the rig file.
        rows: a buffer for the rows of whole replies and its view as records, by how the rows are laid out.
    """

    joints: NDArray[np.int64]
    blocks: tuple[StateBlock, ...]
    asked: Blocks
    layout: np.dtype[Any] | None
    all: bool
    rows: dict[tuple[int, int, int], tuple[bytearray, NDArray[Any]]]


class Readings:
    """The latest measurements of J joints on one port.

    Attributes:
        positions, velocities, currents: shape (J,), rad, rad/s, A, positive in the joint's direction.
        temperatures, voltages: shape (J,), degC, V; NaN until first read.
        errors: hardware error bits, shape (J,).
        torque: whether torque is on, shape (J,).
        read_at: when each joint's position was last read, shape (J,), s.
        health_at: when each joint's error, temperature, torque and voltage were last read, shape (J,), s.
        missed_in_a_row: replies that each joint has missed since its last one, shape (J,).
        looks: whose registers are wanted, in order.
    """

    def __init__(self, config: RigConfig, scale: RigScale, faults: RigFaults) -> None:
        count = len(config.joints)
        self._config = config
        self._scale = scale
        self._faults = faults
        self._ids = [joint.id for joint in config.joints]
        self._everybody = tuple(range(count))
        self._is_old = [joint.table.protocol == 1 for joint in config.joints]
        self._index = {id: index for index, id in enumerate(self._ids)}
        self._everything = [everything(joint.table) for joint in config.joints]
        self._blocks: list[StateBlock] = []
        self._in_turns: list[int] = []
        self._questions: dict[tuple[tuple[int, ...], frozenset[int]], Question] = {}
        self._requests = 0
        self._alerted: set[int] = set()
        self._question: Question | None = None
        self.looks: deque[RegisterReading] = deque()
        self._look: RegisterReading | None = None  # the one that the last question was for
        self._turns = _turns(config)
        self._ask_again = round(_ASK_AGAIN * (config.read_hz or config.rate_hz))  # requests
        self.positions, self.velocities, self.currents = np.zeros(count), np.zeros(count), np.zeros(count)
        self.temperatures, self.voltages = np.full(count, np.nan), np.full(count, np.nan)
        self.errors = np.zeros(count, dtype=np.int64)
        self.torque = np.ones(count, dtype=np.bool_)
        self.read_at, self.health_at = np.zeros(count), np.zeros(count)
        self.missed_in_a_row = np.zeros(count, dtype=np.int64)

    def start(self, joints: Sequence[int], positions: Array, blocks: Sequence[StateBlock], now: float) -> None:
        """Takes joints as just switched on at these positions, rad, with torque and without an error.

        Args:
            joints: their indices.
            positions: of these joints.
            blocks: what each of these joints is asked for.
            now: the time, s.
        """
        where = np.array(joints, dtype=np.int64)
        self._blocks = self._blocks or list(self._everything)
        for index, block in zip(joints, blocks, strict=True):
            self._blocks[index] = block
        self._in_turns = [index for index, block in enumerate(self._blocks) if not block.healthy]
        self._questions.clear()
        self._question = self._look = None
        self.positions[where] = positions
        self.velocities[where] = self.currents[where] = 0.0
        self.missed_in_a_row[where] = self.errors[where] = 0
        self.torque[where] = True
        self.read_at[where] = self.health_at[where] = now

    def next_question(self) -> Question:
        """What to ask for in the next request; see `asked`."""
        line = self._line(self._turns[self._requests % len(self._turns)])
        wide = frozenset(self._alerted)
        if self._in_turns:
            wide |= {self._in_turns[self._requests % len(self._in_turns)]}
        return self._questions.get((line, wide)) or self._ask(line, wide)

    def every_question(self) -> Iterator[Question]:
        """Each that comes up while all servos answer and none reports a problem."""
        for turn in self._turns:
            line = self._line(turn)
            for wide in [frozenset({index}) for index in self._in_turns] or [frozenset[int]()]:
                yield self._ask(line, wide)

    def next_look(self) -> RegisterReading | None:
        """The servo whose registers the next request may ask for in place of `next_question`, if one is wanted."""
        while self.looks and self.looks[0].done:
            self.looks.popleft()
        return self.looks[0] if self.looks and self._requests % EVERY == 0 else None

    def asked(self, question: Question | RegisterReading) -> None:
        """Notes that a question was sent: the next reply answers it."""
        self._requests += 1
        if isinstance(question, RegisterReading):
            self._question, self._look = None, question
            return
        self._question, self._look = question, None
        self._alerted.clear()

    def take(self, reply: WholeReply | GroupReply, now: float) -> bool:
        """Keeps what a reply to the last question brings and counts what is missing; whether anything was measured."""
        if self._look is not None:
            self._take_registers(self._look, reply)
            return False
        question = self._question
        if question is None:
            return False
        if isinstance(reply, WholeReply):
            if question.layout is not None and self._take_whole(reply, question, question.layout, now):
                return True
            reply = GroupReply(reply.statuses([id for id, _, _ in question.asked]), [], [], [])
        return self._take_each(reply, question, now)

    def _take_registers(self, look: RegisterReading, reply: WholeReply | GroupReply) -> None:
        """Hands over what a servo has answered about its registers."""
        id, self._look = look.block[0], None
        status = (reply.statuses([id]) if isinstance(reply, WholeReply) else reply.statuses).get(id)
        look.take(None if status is None or status.error else status.params)

    def _take_whole(self, reply: WholeReply, question: Question, layout: np.dtype[Any], now: float) -> bool:
        """All servos at once; False where one of them answered with an error number."""
        place = (reply.stride, reply.error, reply.data)
        if place not in question.rows:
            buffer = bytearray(len(reply.rows))
            question.rows[place] = buffer, np.frombuffer(buffer, dtype=row_layout(layout, *place))
        buffer, rows = question.rows[place]
        buffer[:] = reply.rows
        error = rows["error"]
        if np.logical_or.reduce(error & ~np.uint8(ALERT)):
            return False
        joints = slice(None) if question.all else question.joints
        self.missed_in_a_row[joints] = 0
        self._note_alerts(question.joints, error >= ALERT)
        self._keep(joints, rows, now)
        return True

    def _take_each(self, reply: GroupReply, question: Question, now: float) -> bool:
        """Servo by servo, where some are missing or their blocks differ."""
        for id in reply.silent:
            self.missed_in_a_row[self._index[id]] += 1
        for id in (*reply.silent, *reply.unheard):
            self._faults.missed[self._index[id]] += 1
        for id in reply.corrupt:
            self._faults.corrupt[self._index[id]] += 1
        block_of = dict(zip(question.joints.tolist(), question.blocks, strict=True))
        groups: dict[np.dtype[Any], tuple[list[int], list[bytes]]] = {}
        alerts = np.zeros(len(self._ids), dtype=np.bool_)
        for id, status in reply.statuses.items():
            index = self._index[id]
            self.missed_in_a_row[index] = 0
            alerts[index] = status.alert
            if self._is_old[index]:
                self.errors[index] = status.hardware
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
            self._faults.alert[joints] += alert
            self._alerted.update(index for index in joints[alert].tolist() if index in self._in_turns)

    def _keep(self, joints: NDArray[np.int64] | slice, rows: NDArray[Any], now: float) -> None:
        """Takes over what joints measured; an arranged servo that has restarted shows nothing but zeros."""
        self.read_at[joints] = now
        positions, velocities, currents = self._scale.motion(joints, rows)
        names = rows.dtype.names or ()
        if "torque_enable" in names:
            torque = rows["torque_enable"] != 0
            if "torque_limit" in names:
                torque &= rows["torque_limit"] != 0
            blank = ~torque & (rows["present_temperature"] == 0) & (rows["present_input_voltage"] == 0)
            self.torque[joints] = torque
            self.health_at[joints] = now
            if np.logical_or.reduce(blank):
                indices, known = np.arange(len(self._ids))[joints], ~blank
                self.errors[indices[blank]] = 0
                joints, rows = indices[known], rows[known]
                positions, velocities, currents = positions[known], velocities[known], currents[known]
            if "hardware_error_status" in names:
                self.errors[joints] = rows["hardware_error_status"]
            elif "own_error_status" in names:
                self.errors[joints] = _XL_320[rows["own_error_status"]]
            self.temperatures[joints] = rows["present_temperature"]
            self.voltages[joints] = rows["present_input_voltage"] * _VOLT
        self.positions[joints], self.velocities[joints], self.currents[joints] = positions, velocities, currents

    def _ask(self, line: tuple[int, ...], wide: frozenset[int]) -> Question:
        """The question to a line of joints, those in `wide` for everything; kept, since a loop asks the same again."""
        blocks = tuple(self._everything[index] if index in wide else self._blocks[index] for index in line)
        asked = tuple(
            (self._ids[index], block.address, block.length) for index, block in zip(line, blocks, strict=True)
        )
        layouts = {block.layout for block in blocks}
        layout = blocks[0].layout if len(layouts) == 1 else None
        question = Question(np.array(line), blocks, asked, layout, line == self._everybody, {})
        if len(self._questions) > 4 * len(self._ids):
            self._questions.clear()
        self._questions[line, wide] = question
        return question

    def _line(self, turn: NDArray[np.int64] | None) -> tuple[int, ...]:
        """Which joints to ask, in which order: of all, or of those whose turn it is.

        A silent servo may silence all that stand behind it, so who missed a reply stands last; who missed several is
        asked only now and then, one at a time, because waiting for it makes everybody's state older.
        """
        missed = self.missed_in_a_row
        if not np.logical_or.reduce(missed):
            return self._everybody if turn is None else tuple(turn.tolist())
        joints = np.arange(len(missed)) if turn is None else turn
        missed = missed[joints]
        good = joints[missed == 0].tolist()
        doubtful = joints[(missed > 0) & (missed < _PATIENCE)].tolist()
        lost = joints[missed >= _PATIENCE].tolist()
        # Each of them as often, however many they are; counted in requests to this line, so that none falls between.
        asked = self._requests // len(self._turns)
        number, rest = divmod(asked, max(1, self._ask_again // (len(self._turns) * max(1, len(lost)))))
        again = [lost[number % len(lost)]] if lost and (rest == 0 or not good + doubtful) else []
        return tuple(good + doubtful + again)


def _turns(config: RigConfig) -> list[NDArray[np.int64] | None]:
    """Which joints each request asks, in turns; None for all of them at once."""
    tables = [joint.table for joint in config.joints]
    newer = [index for index, table in enumerate(tables) if table.protocol == 2]
    if len(newer) == len(tables):
        return [None]
    together = [index for index, table in enumerate(tables) if table.protocol == 1 and table.model.startswith("MX")]
    alone = [[index] for index in range(len(tables)) if index not in newer and index not in together]
    turns = [line for old in [together, *alone] if old for line in (newer, old) if line]
    return [np.array(line) for line in turns]
