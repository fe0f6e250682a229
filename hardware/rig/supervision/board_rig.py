"""A board with an exported sketch as a rig: goals and states are lines over serial (goals.h of the sketch)."""

import re
import zlib
from collections import deque
from collections.abc import Callable
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from hardware.bus.port import Port
from hardware.errors import RigError, SerialPortError
from hardware.rig.counters import RigFaults, RigReport
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale
from hardware.rig.supervision.health import INCIDENTS_KEPT, LOST_AFTER, Incident
from hardware.rig.supervision.servo_states import CONDITIONS, ServoStates

BAUD = 1_000_000
GOALS, ANSWER = b">", b"<"  # what a line begins with
_STEP, _MIDDLE = 20e-6, 1 << 22  # rad; the count of angle 0
_LETTER = ord("?")  # for 6 bits of 0
_WEIGHTS = 64 ** np.arange(4)
_TAKEN, _OWN_STOP = 1, 2
_TRIES = 10  # until a board answers: some restart when their port is opened
_AGAIN = 0.5  # s from one request to take goals to the next
_SILENT = 1.0  # s


def identity(config: RigConfig) -> str:
    """What the sketch for a rig says of it: the number of joints, and a sum of all that it has of them."""
    rows = [(s.name, s.id, s.zero, s.mode, s.pulses_per_radian, s.lower, s.upper) for s in config.servos.joints]
    limits = [(joint.velocity, joint.acceleration) for joint in config.joints]
    known = repr((config.rate_hz, config.baud, config.watchdog_ms, rows, limits))
    return f"{len(config.joints)} joints, {zlib.crc32(known.encode()):08x}"


def line_of(mark: bytes, angles: Array, number: int) -> bytes:
    """A line with angles (J,), rad, and a number, with its end."""
    body = mark + _letters(np.append(2 * (np.rint(angles / _STEP).astype(np.int64) + _MIDDLE), number))
    return body + _letters(np.array([zlib.crc32(body) & 0xFFFFFF])) + b"\n"


def read_line(line: bytes, joints: int) -> tuple[Array, NDArray[np.bool_], int] | None:
    """The angles (J,), rad, NaN where unknown, their alerts and the number of a line; None if it is not whole."""
    letters = np.frombuffer(line[1:], np.uint8).astype(np.int64) - _LETTER
    if len(letters) != 4 * (joints + 2) or letters.min() < 0 or letters.max() > 63:
        return None
    *counts, number, checksum = letters.reshape(-1, 4) @ _WEIGHTS
    if checksum != zlib.crc32(line[:-4]) & 0xFFFFFF:
        return None
    known = np.array(counts)
    return np.where(known < 2, np.nan, _STEP * ((known >> 1) - _MIDDLE)), known % 2 == 1, int(number)


def _letters(counts: NDArray[np.int64]) -> bytes:
    return (counts[:, None] // _WEIGHTS % 64 + _LETTER).astype(np.uint8).tobytes()


def ask(port: Port, command: str, seconds: float = _SILENT) -> tuple[str, bytes]:
    """A board's reply to a command, empty if none came in time, and all that came."""
    end, received, found = port.now() + seconds, b"", None
    port.send(f"\n{command}\n".encode())
    while found is None and (left := end - port.now()) > 0.0 and port.wait(left):
        received += port.receive()
        found = re.search(rb"^((ok|refused)[^\r\n]*)\r?\n", received, re.MULTILINE)
    return ("" if found is None else found[1].decode(errors="replace")), received


class BoardRig:
    """A board that plays goals; with the guard's side of `hardware.rig.supervision.rig.Rig`."""

    def __init__(self, config: RigConfig, port: Port) -> None:
        """Has the board take goals where its joints stand; RigError if it is silent, or of another rig."""
        self.config, self.names, self._port = config, config.names, port
        count, own, reply = len(self.names), identity(config), ""
        self.faults, self.recoveries, self._scale = RigFaults.none(count), 0, RigScale(config)
        self.incidents: deque[Incident] = deque(maxlen=INCIDENTS_KEPT)
        self.busy = 0.0  # for how long goals have taken the line to the board, s; answers go the other way
        self.is_stopped: Callable[[], bool] = lambda: False  # whether the emergency stop is on
        self.positions, self.goals, self._seen = np.zeros(count), np.zeros(count), np.full(count, -np.inf)
        self._alert, self._unread, self._flags, self._heard = np.zeros(count, np.bool_), b"", _TAKEN, port.now()
        self._board, self._request = f"the board at {port.name}", f"goals {1e-3 * config.watchdog_ms:g}"
        for _ in range(_TRIES):
            reply, received = ask(port, self._request, _AGAIN)
            self._read(received)
            if reply not in ("", f"ok {own}") or np.isfinite(self._seen).all():
                break
        if reply != f"ok {own}":
            also = "; write its sketch again with motiondeck export --for arduino" * reply.startswith("ok")
            raise RigError(f"{self._board} takes no goals of this rig ({own}): {reply or 'it does not answer'}{also}")
        self._asked = port.now()
        self.collect_state()
        self.goals[:] = self.positions

    @property
    def states(self) -> ServoStates:
        """The goal, the measured angle and the condition of each joint; a board tells no more."""
        none, unknown = np.zeros(len(self.names)), np.full(len(self.names), np.nan)
        conditions = np.where(self._seen < self._heard, CONDITIONS.index("does not answer"), 0)
        last = none.astype(np.int64), none == 0.0, conditions
        return ServoStates(self.goals, self.positions, none, unknown, unknown, *last)

    @property
    def report(self) -> RigReport:
        """Counts since the board takes goals."""
        return RigReport(None, None, self.recoveries, self.faults.total, self.faults.by_joint(self.names))

    def write(self, targets: Array) -> None:
        """Sends the targets (J,), rad, within the limits of the joints; NaN leaves a joint's goal."""
        finite = np.isfinite(targets)
        wanted = np.where(finite, targets, self.goals)
        self.goals[:] = self._scale.within(wanted)
        self.faults.refused[:] += ~finite
        self.faults.clipped[:] += wanted != self.goals
        line = line_of(GOALS, self.goals, int(self.is_stopped()))
        self.busy += 10 * len(line) / BAUD
        self.faults.unsent[:] += not self._port.send(line)

    def collect_state(self) -> bool:
        """Takes the answers that have come; whether there were any. RigError if the board is silent or has stopped."""
        heard, now = self._heard, self._port.now()
        self._read(self._port.receive())
        lost = np.flatnonzero(self._heard - self._seen > LOST_AFTER)
        if self._flags & _OWN_STOP:
            raise RigError(f"the rig has stopped: the emergency stop of {self._board} is on. Reset it there")
        if now - self._heard > _SILENT:
            raise RigError(f"the rig has stopped: {self._board} does not answer. Mend the cause and start anew.")
        if len(lost) and (self.config.on_loss == "stop" or np.isinf(self._seen[lost]).any()):
            raise RigError(
                f"the rig has stopped: {self._board} gets no answer from {self.config.joints[lost[0]].label}."
            )
        if self._heard != heard and not self._flags & _TAKEN and now - self._asked > _AGAIN:
            # It holds its joints for want of goals: it is asked to take them again, from where it stands.
            self.incidents.append(Incident(now, self._board, "has got no goals in time"))
            self._asked, self.recoveries = now, self.recoveries + 1
            self._port.send(f"\n{self._request}\n".encode())
            self.goals[:] = self.positions
        return self._heard != heard

    def switch_off(self, joint: int) -> None:
        """Is not done: a board has torque on all its servos, or on none; an incident says so."""
        self.incidents.append(
            Incident(self._port.now(), self.config.joints[joint].label, "is switched by its board alone", False)
        )

    set_up_again = restart = switch_off

    def registers(self, joint: int = 0, write: tuple[str, int] | None = None) -> NoReturn:
        """Raises a RigError: a board reads no registers, and scans no ports."""
        raise RigError("the servos are behind a board: connect them to the port of the rig file")

    scan = registers

    def close(self, *, hold: bool = False) -> list[str]:
        """Has the board take torque off, or hold, as the rig file asks or as given; the joints unless it confirms."""
        command = "goals 0" if hold or self.config.on_exit == "hold" else "off"
        try:
            return [] if ask(self._port, command)[0].startswith("ok") else list(self.names)
        except SerialPortError:
            return list(self.names)
        finally:
            self._port.close()

    def _read(self, received: bytes) -> None:
        """Takes the states among what has come."""
        *lines, unread = (self._unread + received).split(b"\n")
        self._unread, now = unread[-4096:], self._port.now()
        for line in (line[line.rfind(ANSWER) :].rstrip() for line in lines if ANSWER in line):
            if (state := read_line(line, len(self.names))) is None:
                self.faults.corrupt[:] += 1
                continue
            angles, alert, self._flags = state
            known = np.isfinite(angles)
            for joint in np.flatnonzero(alert & ~self._alert).tolist():
                self.incidents.append(Incident(now, self.config.joints[joint].label, "reports a hardware error"))
            self.positions[known], self._seen[known], self._heard = angles[known], now, now
            self.faults.missed[:] += ~known
            self.faults.alert[:] += alert
            self._alert = alert | (self._alert & ~known)
