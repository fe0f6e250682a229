"""A rig behind its guard, as the deck sees it: targets go out, states come back, and no call waits in the loop."""

import contextlib
import itertools
import os
import select
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields

import msgspec
import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits
from controller.loop.stop_state import STOP_DOOR, StopState
from controller.wire.messages.replies import OnPorts, Refused, Registers
from hardware.errors import RigError
from hardware.rig.counters import RigReport
from hardware.rig.rig_file import RigConfig
from hardware.rig.supervision.health import INCIDENTS_KEPT, Incident
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.run.guard import messages
from motiondeck.run.guard.messages import Begin, GuardLink, Note, States, Targets

Array = NDArray[np.float64]

_SILENT = 1.0  # s after which a guard is taken for gone
_REPORTS_WITHIN, _WATCHES_WITHIN, _CLOSES_WITHIN = 1.0, 5.0, 15.0  # s; closing waits for silent servos
Awaited = Callable[[], Registers | OnPorts | Refused | None]  # what servos are asked, once the guard has the answer
_GONE = "the guard of the rig has ended. The servos' own watchdogs stop them; restart the deck"


@dataclass
class GuardedWire:
    """The wired stop that the guard watches."""

    name: str
    pulled: bool = False
    pulls: int = 0


class GuardedRig:
    """A rig that is switched on, behind its guard; arrays follow the order of the rig file's joints."""

    def __init__(
        self, link: GuardLink[Note], process: subprocess.Popen[bytes], begin: Begin, ready: messages.Connected
    ) -> None:
        self.config = begin.config
        self.names = begin.config.names
        count = len(self.names)
        self._link, self._process = link, process
        self._targets, self._state = Targets(count), States(count)
        link.expect(self._state.values)
        rows = self._state.servos
        rows[:2] = ready.positions
        self.positions: Array = rows[1]  # last measured, shape (J,), rad
        self.states = ServoStates(*rows)  # pyright: ignore[reportArgumentType] (rows of numbers, as the page has them)
        self.incidents: deque[Incident] = deque(maxlen=INCIDENTS_KEPT)  # the latest, in order of time
        self.wire: GuardedWire | None = None  # the wired stop, if the guard watches one
        self.door_presses = 0  # how often an emergency stop came to the stop door
        self.stop = StopState()
        self._failure, self._watching = "", False
        self._heard, self._collected = time.monotonic(), 0
        self._numbers = itertools.count(1)
        self._asked: dict[int, list[Registers | OnPorts | Refused]] = {}
        self._report: RigReport | None = None
        self._closed: list[str] | None = None

    @property
    def held(self) -> Array | None:
        """Where the guard holds the joints on its own, shape (J,), rad; None while it follows targets."""
        return self._state.servos[0] if self.at_rest else None

    @property
    def at_rest(self) -> bool:
        """Whether the guard has brought the joints to rest, and holds them."""
        return self._state.phase in ("held", "latched")

    @property
    def age(self) -> float:
        """How old the measured positions are now, s."""
        return time.monotonic() - self._state.measured_at

    @property
    def recoveries(self) -> int:
        """How often something was recovered."""
        return self._state.recoveries

    @property
    def busy(self) -> float:
        """For how long the busiest port has been busy with goals and answers, s."""
        return self._state.busy

    def watch_stops(self, door: int, wired: str | None) -> None:
        """Has the guard take stops at a stop door and at a wired stop, and waits for that; RigError if one fails."""
        self._link.send(messages.WatchStops(door, wired))
        self._await(lambda: self._watching or bool(self._failure), _WATCHES_WITHIN)
        if not self._watching:
            raise RigError(self._failure or _GONE)
        self.wire = GuardedWire(wired) if wired is not None else None

    def collect_state(self) -> bool:
        """Takes what the guard has sent; whether anything new was measured."""
        state, collected = self._state, self._collected
        sets, notes = self._link.receive()
        for note in notes:
            self._take(note)
        if not sets:
            return False
        self._heard = time.monotonic()
        self.door_presses, pulls = state.presses
        if self.wire is not None:
            self.wire.pulls, self.wire.pulled = pulls, state.pulled
        self._collected = state.collected
        return self._collected != collected

    def write(self, targets: Array) -> None:
        """Sends the targets of this tick, shape (J,), rad; RigError if the rig has stopped, or its guard is gone."""
        now, stop, sent = time.monotonic(), self.stop, self._targets
        if self._failure:
            raise RigError(self._failure)
        if self._link.lost or now - self._heard > _SILENT:
            self._failure = _GONE
            raise RigError(_GONE)
        released = stop.released
        wire = self.wire.name if self.wire is not None else ""
        sent.set(now, stop.stopped, stop.phase == "braking", released.get(STOP_DOOR, 0), released.get(wire, 0))
        sent.joints[:] = targets
        self._link.send_numbers(sent.values)

    def switch_off(self, joint: int) -> None:
        """Has the torque taken off a joint."""
        self._link.send(messages.ServoDeed(joint, "switch_off"))

    def set_up_again(self, joint: int) -> None:
        """Has a joint set up again and switched on where it stands."""
        self._link.send(messages.ServoDeed(joint, "set_up_again"))

    def restart(self, joint: int) -> None:
        """Has the servo of a joint restarted, and set up again; raises a RigError if its model cannot be."""
        self.config.joints[joint].check_restartable()
        self._link.send(messages.ServoDeed(joint, "restart"))

    def ask(self, joint: int | None = None, write: tuple[str, int] | None = None) -> Awaited:
        """Has all registers of a servo read, and before that a count written into one of them; or all IDs asked."""
        self._link.send(messages.QueryServos(number := next(self._numbers), joint, write))
        came = self._asked[number] = []
        return lambda: came[0] if came else None

    @property
    def report(self) -> RigReport:
        """Counts and durations since the rig was switched on; it waits for the guard."""
        self._report = None
        self._link.send(messages.QueryReport())
        self._await(lambda: self._report is not None, _REPORTS_WITHIN)
        return self._report or RigReport(None, None, self.recoveries, 0, {})

    def close(self) -> list[str]:
        """Has the rig closed as its file says, once the joints are at rest; the joints that did not confirm it."""
        if self._closed is None:
            self._link.send(messages.CloseRig())
            self._await(lambda: self._closed is not None, _CLOSES_WITHIN)
            if self._closed is None:
                self._closed = list(self.names)
            self._link.close()
            _end(self._process, 2.0)
            return self._closed
        return []

    def _await(self, arrived: Callable[[], bool], seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while not arrived() and not self._link.lost and (left := deadline - time.monotonic()) > 0.0:
            select.select([self._link.fileno()], (), (), left)
            self.collect_state()

    def _take(self, note: Note) -> None:
        match note:
            case messages.RigFailed(reason=reason):
                self._failure = reason
            case messages.IncidentNote():
                self.incidents.append(note.incident)
            case messages.ServoAnswer(number=number, reply=reply):
                self._asked.pop(number).append(reply)
            case messages.ReportNote(report=report):
                self._report = report
            case messages.RigClosed(unconfirmed=unconfirmed):
                self._closed = unconfirmed
            case messages.Watching():
                self._watching = True
            case messages.Connected():
                pass


GuardProcess = tuple[GuardLink[Note], subprocess.Popen[bytes]]
"""The link to a guard that runs, and its process."""


@contextmanager
def guard_process() -> Iterator[GuardProcess]:
    """A guard that waits for its `Begin`; after the block it has gone, or is gone when the joints are at rest."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        command = [sys.executable, "-P", "-m", "motiondeck.run.guard.process", str(theirs.fileno())]
        one_thread = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
        process = subprocess.Popen(
            command,
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the deck
            env=os.environ | one_thread,
        )
    link = GuardLink[Note](ours, msgspec.json.Decoder(Note))
    try:
        yield link, process
    finally:
        link.close()
        _end(process, _CLOSES_WITHIN)


def _end(process: subprocess.Popen[bytes], patience: float) -> None:
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(patience)
    process.kill()
    process.wait()


def connect(
    link: GuardLink[Note],
    process: subprocess.Popen[bytes],
    config: RigConfig,
    limits: JointLimits,
    joints: Sequence[int],
    ports: Sequence[str],
    emulated: str | None,
) -> GuardedRig:
    """Has the guard connect a rig, whose joints have these places in the limits; RigError if it cannot be connected."""
    own = {kind.name: getattr(limits, kind.name)[list(joints)].tolist() for kind in fields(limits)}
    link.send(begin := Begin(config, list(ports), emulated, own))
    while not link.lost:
        select.select([link.fileno()], (), ())
        for note in link.receive()[1]:
            if isinstance(note, messages.RigFailed):
                raise RigError(note.reason)
            if isinstance(note, messages.Connected):
                return GuardedRig(link, process, begin, note)
    raise RigError("the guard of the rig has ended before the rig was connected")
