"""The link between a deck and the guard of its rig: targets and states in numbers, all else in JSON.

It is a pair of local sockets that carry datagrams, whole and in order.
"""

import socket
from collections import deque
from collections.abc import Callable
from typing import Generic, Literal, TypeVar, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.loop.stop_state import STOP_DOOR, Phase, StopState
from controller.wire.messages.replies import OnPorts, Refused, Registers
from hardware.rig.counters import RigReport
from hardware.rig.rig_file import RigConfig
from hardware.rig.supervision.health import Incident

T = TypeVar("T")
PHASES: tuple[Phase, ...] = get_args(Phase)
SERVO_ROWS = 8  # of `ServoStates`
_STATE_NUMBERS = 8


class Begin(msgspec.Struct, frozen=True, tag="begin"):
    """Connects the rig; the deck's first message."""

    config: RigConfig
    ports: list[str]  # in place of the rig file's own
    emulated: str | None  # the rig file whose servos are to be emulated, or None
    limits: dict[str, list[float]]  # of the rig's joints, by the names in `JointLimits`


class WatchStops(msgspec.Struct, frozen=True, tag="watch"):
    """Takes emergency stops at the stop door of a command port, and of the device of a wired stop if there is one."""

    door: int
    wired: str | None


class ServoDeed(msgspec.Struct, frozen=True, tag="deed"):
    """Does with a joint what the rig's method of this name does."""

    joint: int
    method: Literal["switch_off", "set_up_again", "restart"]


class QueryServos(msgspec.Struct, frozen=True, tag="query"):
    """Reads all registers of a joint's servo, after a count is written into one; or scans the ports for servos."""

    number: int
    joint: int | None = None  # None for a scan
    write: tuple[str, int] | None = None


class QueryReport(msgspec.Struct, frozen=True, tag="report?"):
    """Asks for the report of the rig so far."""


class CloseRig(msgspec.Struct, frozen=True, tag="close"):
    """Ends the rig as its file says, once the joints are at rest."""


Request = Begin | WatchStops | ServoDeed | QueryServos | QueryReport | CloseRig


class Connected(msgspec.Struct, frozen=True, tag="ready"):
    """The rig is switched on where it stands, each joint at an angle, rad."""

    positions: list[float]


class Watching(msgspec.Struct, frozen=True, tag="watching"):
    """The stop door is open, and the wired stop."""


class RigFailed(msgspec.Struct, frozen=True, tag="failed"):
    """The rig could not be connected, a stop not be watched, or the rig has stopped for good."""

    reason: str


class IncidentNote(msgspec.Struct, frozen=True, tag="happened"):
    """An incident of the rig."""

    incident: Incident


class ServoAnswer(msgspec.Struct, frozen=True, tag="answer"):
    """What servos have answered to a query, by its number, or why not."""

    number: int
    reply: Registers | OnPorts | Refused


class ReportNote(msgspec.Struct, frozen=True, tag="report"):
    """The report of the rig so far."""

    report: RigReport


class RigClosed(msgspec.Struct, frozen=True, tag="closed"):
    """The rig is closed; the joints that did not confirm it."""

    unconfirmed: list[str]


Note = Connected | Watching | RigFailed | IncidentNote | ServoAnswer | ReportNote | RigClosed


class _Number(Generic[T]):
    """One of the numbers of an object's `values`, by its place, as a value of a type."""

    def __init__(self, place: int, kind: Callable[[float], T]) -> None:
        self._place, self._kind = place, kind

    def __get__(self, of: "Targets | States", kind: type) -> T:
        return self._kind(of.values[self._place])


class Targets:
    """The targets of one tick, from the deck; all numbers are views of one array, as it is sent."""

    sent = _Number(0, float)  # when, by the machine's steady clock, s
    stopped = _Number(1, bool)  # whether the emergency stop is on at the deck
    braking = _Number(2, bool)  # whether the deck brakes, for whatever reason: its joints are to come to rest

    def __init__(self, joints: int) -> None:
        self.values = np.zeros(5 + joints)  # shape (5 + J,)
        self.joints = self.values[5:]  # shape (J,), rad

    def set(self, now: float, stopped: bool, braking: bool, door: int, wire: int) -> None:
        """Sets all but the joints: what the numbers are, and what `released` is."""
        self.values[:5] = now, stopped, braking, door, wire

    @property
    def released(self) -> tuple[int, int]:
        """Presses at the stop door and pulls of the wire that resets have released."""
        return int(self.values[3]), int(self.values[4])


class States:
    """The state of guard and servos in one tick; all numbers are views of one array, as it is sent."""

    phase = _Number(0, lambda place: PHASES[int(place)])  # of the guard's stop state
    pulled = _Number(3, bool)  # whether the wired stop is pulled now
    collected = _Number(4, int)  # how often the rig has measured something new
    recoveries = _Number(5, int)  # how often something was recovered
    measured_at = _Number(6, float)  # when the latest was measured, by the machine's steady clock, s
    busy = _Number(7, float)  # for how long the busiest port has been busy, s

    def __init__(self, joints: int) -> None:
        self.values = np.zeros(_STATE_NUMBERS + SERVO_ROWS * joints)  # shape (8 + 8 J,)
        self.values[0] = PHASES.index("held")
        # The rows of `ServoStates`, shape (8, J).
        self.servos = self.values[_STATE_NUMBERS:].reshape(SERVO_ROWS, joints)

    def set(
        self, state: StopState, wire: str, collected: int, recoveries: int, measured_at: float, busy: float
    ) -> None:
        """Sets all but the servos; `wire` names the wired stop."""
        door, wired = state.presses.get(STOP_DOOR, 0), state.presses.get(wire, 0)
        phase = PHASES.index(state.phase)
        numbers = phase, door, wired, wire in state.pulled, collected, recoveries, measured_at, busy
        self.values[:_STATE_NUMBERS] = numbers

    @property
    def presses(self) -> tuple[int, int]:
        """Presses at the stop door, and pulls of the wire."""
        return int(self.values[1]), int(self.values[2])


_MOST_BYTES = 1 << 18
_MOST_PENDING = 1024  # messages; of more the oldest are dropped
_encoder = msgspec.json.Encoder()

M = TypeVar("M", bound=msgspec.Struct)


class GuardLink(Generic[M]):
    """One end of the pair of sockets; no call waits. Either end notices at once when the other is gone.

    Numbers are sent as they lie in memory, in a multiple of 8 bytes; JSON is padded to any other length. Numbers that
    a full buffer does not take are dropped, as newer ones follow; messages wait.
    """

    def __init__(self, end: socket.socket, decoder: msgspec.json.Decoder[M]) -> None:
        end.setblocking(False)
        self._socket, self._decoder = end, decoder
        self._numbers, self._buffer = memoryview(b""), memoryview(bytearray(_MOST_BYTES))
        self._pending: deque[bytes] = deque(maxlen=_MOST_PENDING)
        self.lost = False  # whether the other end is gone

    def expect(self, numbers: NDArray[np.float64]) -> None:
        """The latest numbers of the other end are put into this array."""
        self._numbers = numbers.data.cast("B")

    def fileno(self) -> int:
        """Readable when something has come, or the other side is gone."""
        return self._socket.fileno()

    def receive(self) -> tuple[int, list[M]]:
        """Takes what has come: how many sets of numbers (the latest is kept), and the messages in order."""
        numbers, messages = 0, list[M]()
        while True:
            try:
                size = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                break
            except OSError:
                size = 0
            if size == 0:
                self.lost = True
                break
            if size == len(self._numbers):
                self._numbers[:] = self._buffer[:size]
                numbers += 1
            elif size % 8:
                messages.append(self._decoder.decode(self._buffer[:size]))
        return numbers, messages

    def send_numbers(self, values: NDArray[np.float64]) -> bool:
        """Sends a set of numbers; whether it was taken."""
        if self._pending:
            self._send_pending()
        return self._send(values.data)

    def send(self, message: msgspec.Struct) -> None:
        """Sends a message, after those that wait."""
        data = _encoder.encode(message)
        self._pending.append(data if len(data) % 8 else data + b" ")
        self._send_pending()

    def close(self) -> None:
        """Closes this end; the other side notices."""
        self._socket.close()
        self.lost = True

    def _send_pending(self) -> None:
        while self._pending and self._send(self._pending[0]):
            self._pending.popleft()

    def _send(self, data: bytes | memoryview) -> bool:
        try:
            self._socket.send(data)
        except BlockingIOError:
            return False
        except OSError:
            self.lost = True
            return False
        return True
