"""python -m motiondeck.run.guard.process FD: the guard's process; its deck is at the other end of the socket FD.

It ends with the deck: joints that move come to rest first. A deck that closes its rig has it closed as the rig file
says; where the deck is gone without that, the servos hold with torque on.
"""

import contextlib
import gc
import itertools
import select
import signal
import socket
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import msgspec
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.permissions import request_realtime
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.wire.messages.replies import OnPorts, Refused, Registers, ServoOnPort, ServoRegister
from controller.wire.stop_door import StopDoor
from hardware.bus.port import SerialPort, lasting_name
from hardware.families.table import meaning
from hardware.rig.driving.register_reading import WRITABLE, RegisterReading, shown_registers
from hardware.rig.rig_joint import RigJoint
from hardware.rig.supervision.board_rig import BAUD, BoardRig
from hardware.rig.supervision.health import Incident
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.identities import PortScan
from motiondeck.run.guard import messages
from motiondeck.run.guard.guard import RigGuard
from motiondeck.run.guard.messages import Begin, GuardLink, Request, States, Targets
from motiondeck_base.errors import MotiondeckError, in_words

_REST_WITHIN = 5.0  # s


class GuardService:
    """Runs a guard between its sockets and its rig."""

    def __init__(self, opening: ExitStack, link: GuardLink[Request], begin: Begin, rig: Rig | BoardRig) -> None:
        """Guards a rig from now on; `opening` closes what is opened later."""
        config = begin.config
        limits = JointLimits(**{kind: np.array(values) for kind, values in begin.limits.items()})
        self._opening, self._link, self._rig = opening, link, rig
        self._door: StopDoor | None = None
        self._targets, self._states = Targets(len(config.joints)), States(len(config.joints))
        link.expect(self._targets.values)
        period = 1.0 / config.rate_hz
        envelope = safety_envelope(limits, period)
        self.guard = RigGuard(rig, envelope, self._targets, period, time.monotonic())
        if isinstance(rig, BoardRig):
            rig.is_stopped = lambda: self.guard.stop.stopped
        self._asked: dict[int, RegisterReading | PortScan] = {}  # what servos have not answered yet, by its number
        self._last_incident: Incident | None = None  # that the deck was told of
        self._reported_failure = ""
        self.closing = self.stopped = False  # whether the deck, or a signal, has asked for the end

    def run(self) -> None:
        """Serves the deck until it closes the rig or is gone, and the joints are at rest."""
        guard, link = self.guard, self._link
        until: float | None = None
        while until is None or not (guard.at_rest or guard.failure or time.monotonic() > until):
            ears = [ear.fileno() for ear in (None if link.lost else link, self._door) if ear is not None]
            select.select(ears, (), (), max(0.0, guard.due - time.monotonic()))
            if self._door is not None:
                guard.press(self._door.poll())
            sets, requests = (0, []) if link.lost else link.receive()
            for request in requests:
                self._carry_out(request)
            now = time.monotonic()
            if sets:
                guard.receive(now)
            if now >= guard.due:
                guard.tick(now)
                self._report()
            if until is None and (link.lost or self.closing or self.stopped):
                if self.closing:
                    guard.end()
                else:
                    guard.lose_deck()
                until = now + _REST_WITHIN

    def _carry_out(self, request: Request) -> None:
        """Does what a deck asks beside its targets; none waits: answers of servos are sent when they have come."""
        link, rig = self._link, self._rig
        match request:
            case messages.CloseRig():
                self.closing = True
            case messages.QueryReport():
                link.send(messages.ReportNote(rig.report))
            case messages.WatchStops():
                self._watch(request)
            case messages.ServoDeed(joint=joint, method=method):
                getattr(rig, method)(joint)
            case messages.QueryServos(number=number, joint=joint, write=write):
                try:
                    self._asked[number] = rig.scan() if joint is None else rig.registers(joint, write)
                except MotiondeckError as error:
                    link.send(messages.ServoAnswer(number, Refused(str(error))))
            case Begin():
                pass  # it is the first message

    def _watch(self, request: messages.WatchStops) -> None:
        try:
            self._door = self._opening.enter_context(contextlib.closing(StopDoor(request.door)))
            if request.wired is not None:
                from hardware.tools.stop_input import open_stop_input

                self.guard.wired = self._opening.enter_context(contextlib.closing(open_stop_input(Path(request.wired))))
        except MotiondeckError as error:
            self._link.send(messages.RigFailed(str(error)))
        else:
            self._link.send(messages.Watching())

    def _report(self) -> None:
        """Sends the state of this tick, what has happened, and the answers of servos that have come."""
        link, states, guard = self._link, self._states, self.guard
        guard.report(states)
        for row, values in zip(states.servos, self._rig.states, strict=True):
            row[:] = values
        link.send_numbers(states.values)
        for number, asked in [*self._asked.items()]:
            if (reply := self._answer_to(asked)) is not None:
                del self._asked[number]
                link.send(messages.ServoAnswer(number, reply))
        incidents = self._rig.incidents
        if incidents and incidents[-1] is not self._last_incident:
            new = [*itertools.takewhile(lambda one: one is not self._last_incident, reversed(incidents))]
            self._last_incident = incidents[-1]
            for incident in reversed(new):
                link.send(messages.IncidentNote(incident))
        if guard.failure != self._reported_failure:
            self._reported_failure = guard.failure
            link.send(messages.RigFailed(guard.failure))

    def _answer_to(self, asked: RegisterReading | PortScan) -> Registers | OnPorts | Refused | None:
        """What servos have answered; None while they have not."""
        if isinstance(asked, RegisterReading):
            return _registers(self._rig.config.joints[asked.joint], asked) if asked.done else None
        if asked.found is None:
            return None
        return OnPorts([ServoOnPort(name, one.id, one.model, one.firmware) for name, one in asked.found], asked.missing)


def _registers(joint: RigJoint, reading: RegisterReading) -> Registers | Refused:
    """What was read of a joint's servo, in order of address."""
    if reading.failure:
        return Refused(reading.failure)
    rows = [
        ServoRegister(row.name, row.address, count, meaning(joint.table, row, count), row.name in WRITABLE)
        for row in shown_registers(joint.table)
        for count in (reading.counts[row.name],)
    ]
    return Registers(joint.name, joint.model, rows)


def guard(link: GuardLink[Request], begin: Begin) -> None:
    """Guards the rig until the deck is gone or closes it; MotiondeckError if the rig or a stop cannot be opened."""
    with ExitStack() as opening:
        ports = begin.ports
        if begin.emulated is not None:
            from hardware.emulator.process import start_emulator

            ports = opening.enter_context(start_emulator(begin.emulated)).ports
        if begin.config.board and begin.emulated is None:
            rig = BoardRig(begin.config, SerialPort(lasting_name(begin.config.board), BAUD))
        else:
            rig = Rig.connect(begin.config, ports, spare=1.0, emulated=begin.emulated is not None)
        running: GuardService | None = None
        try:
            # Emulated servos are an ordinary process, which a guard in real time would hold up.
            if begin.emulated is None:
                request_realtime()
            running = GuardService(opening, link, begin, rig)
            signal.signal(signal.SIGTERM, lambda number, frame: setattr(running, "stopped", True))
            gc.collect()
            gc.freeze()
            gc.disable()
            link.send(messages.Connected(rig.positions.tolist()))
            running.run()
        finally:
            left = running is not None and not running.closing
            link.send(messages.RigClosed(rig.close(hold=left)))
            if left and link.lost:
                print(
                    "motiondeck: the deck has ended without closing its rig. The joints hold, with torque on; take it "
                    "off with: motiondeck rig stop RIG",
                    file=sys.stderr,
                )


def main() -> int:
    """Guards the rig of the deck at the socket whose number is on the command line."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # what ends the deck must not end its guard before
    end = socket.socket(fileno=int(sys.argv[1]))
    link: GuardLink[Request] = GuardLink(end, msgspec.json.Decoder(Request))
    begin: Request | None = None
    while begin is None and not link.lost:
        select.select([link.fileno()], (), ())
        _, requests = link.receive()
        begin = requests[0] if requests else None
    if not isinstance(begin, Begin):
        return 0
    try:
        guard(link, begin)
    except MotiondeckError as error:
        link.send(messages.RigFailed(str(error)))
        return 1
    except Exception as error:
        link.send(messages.RigFailed(f"the guard of the rig has failed: {in_words(error)}"))
        raise
    return 0


if __name__ == "__main__":
    sys.exit(main())
