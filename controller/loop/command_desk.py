"""The command desk: carries out the commands of sockets on a deck, and tells who wants to know what happens."""

from __future__ import annotations

import math
import random
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import msgspec

from controller.loop.commandable import Commandable, Progress
from controller.loop.stop_requests import EmergencyStopError, StopRequest
from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.command_table import row_of
from controller.wire.messages.commands import (
    AlignTicks,
    AtTime,
    Blend,
    DeckCommand,
    EmergencyStop,
    GetPhase,
    GetStatus,
    GiveBeat,
    Heartbeat,
    Home,
    Jump,
    LoadLibrary,
    LockPhase,
    Push,
    Queue,
    ReadRegisters,
    Reset,
    RestartServo,
    Resume,
    ScanPorts,
    ServoTorque,
    SetInput,
    SetTempo,
    Side,
    StepOn,
    Stop,
    Subscribe,
    Switch,
    Unlock,
    WriteRegister,
)
from controller.wire.messages.events import Event, EventKind
from controller.wire.messages.replies import Accepted, Mode, PhaseNow, Refused, Reply, SecondReply, Settled, State
from motiondeck_base.errors import MotiondeckError


class Look(Protocol):
    """A look at servos that is under way."""

    def answer(self) -> SecondReply | None:
        """What came of it, or None as long as nothing has."""
        ...


class RigServos(Protocol):
    """The servos of a rig, as commands need them; no call waits."""

    def switch(self, joint: str, *, on: bool) -> None:
        """Takes the torque off a joint, or has it set up again."""
        ...

    def restart(self, joint: str) -> None:
        """Has the servo of a joint restarted."""
        ...

    def registers(self, joint: str, write: tuple[str, int] | None = None) -> Look:
        """Has all registers of a servo read, and before that one of them written."""
        ...

    def scan(self) -> Look:
        """Has everybody asked who is on the ports."""
        ...


@runtime_checkable
class Pushable(Protocol):
    """A simulated body that can be pushed; the call does not wait."""

    fallen: bool
    clock: Callable[[], float]

    def push_from(self, side: Side, impulse: float, towards: float | None) -> float:
        """Pushes it from a side, or towards a direction, with an impulse, N s, 0 for its own choice; that impulse."""
        ...


class RealTime(Protocol):
    """The clock of a loop in real time; no call waits."""

    @property
    def period(self) -> float:
        """Seconds from tick to tick."""
        ...

    def due(self) -> float:
        """When the present tick was due, by the machine's steady clock, s."""
        ...

    def align(self, here: int, there: int) -> None:
        """Moves them onto those of a clock that shows `there` when this one shows `here`, ns."""
        ...


Awaited = Switch | Queue | Blend
"""Commands that are answered once more when they have settled."""
_LOOKED_WITHIN = 15.0  # s, for a look at servos
_AHEAD = 60.0  # s, of a command that is given ahead of its time

_MOST_TIMED = 64  # commands whose time is still to come
_MOST_AWAITED = 256  # switches, or looks, whose second reply is still to come
_MOST_LISTENERS = 64
_FORGOTTEN_AFTER = 60.0  # s that a subscriber over a network may be silent


@dataclass
class _Listener:
    """A client that is told what happens, or has to be heard from.

    Attributes:
        server, sender: how to reach it.
        heard: when it was last heard from, s.
        subscribed: whether it gets events.
        within: s of silence after which the deck pauses; 0 for never.
    """

    server: CommandServer
    sender: Address
    heard: float
    subscribed: bool = False
    within: float = 0.0


class CommandDesk:
    """Carries out the commands that have arrived, once a tick; it never waits, and no client can make it raise.

    Args:
        deck: the deck that is commanded.
        servers: the sockets that commands arrive at.
        note: called with each command and its reply.
        seen: the motion that is recognized and the confidence, or None.
        now: a steady clock, s.
        servos: of the rig, if there is one.
        body: what is simulated, if it can be pushed.
        restarts: whether the run can be started again with another library.
        ticks: the clock of the loop, in real time.
    """

    def __init__(
        self,
        deck: Commandable,
        servers: Sequence[CommandServer],
        note: Callable[[DeckCommand, Reply], None] | None = None,
        seen: Callable[[], tuple[str, float] | None] | None = None,
        now: Callable[[], float] = time.monotonic,
        servos: RigServos | None = None,
        body: Pushable | None = None,
        restarts: bool = False,
        ticks: RealTime | None = None,
    ) -> None:
        self._deck = deck
        self._ticks = ticks
        self._restarts = restarts
        self._servos, self._body = servos, body
        self._servers = servers
        self._note = note
        self._seen = seen
        self._now = now
        self._awaited: deque[tuple[CommandServer, Address, Awaited, Progress]] = deque(maxlen=_MOST_AWAITED)
        self._timed: list[tuple[CommandServer, Address, AtTime]] = []
        self._looks: deque[tuple[CommandServer, Address, int, Look, float]] = deque(maxlen=_MOST_AWAITED)
        self._listeners: dict[Address, _Listener] = {}
        self._number = 0
        self._told: tuple[Mode, bool] = ("playing", deck.paused)
        self._code = 0.0
        self._fallen = False
        self._look: Look | None = None  # that the command being carried out has begun

    def __call__(self, stop: StopRequest) -> None:
        """Carries out new commands, and tells what has happened since the last call."""
        for server in self._servers:
            for message, sender in server.poll():
                self._listen(message, server, sender)
                reply, progress = self.carry_out(message, stop, remote=server.remote)
                if self._look is not None:
                    self._looks.append((server, sender, message.id, self._look, self._now()))
                if progress is not None and isinstance(message, Awaited):
                    self._awaited.append((server, sender, message, progress))
                if isinstance(message, AtTime) and isinstance(reply, Accepted):
                    self._timed.append((server, sender, message))
                server.reply(sender, reply)
        if self._timed:
            self._carry_out_timed(stop)
        if self._awaited:
            self._reply_again()
        if self._looks:
            self._tell_looks()
        if self._listeners:
            self._miss_heartbeats()
        events = self._deck.events
        while events:
            self._send(events.popleft())
        if self._body is not None and self._body.fallen != self._fallen:
            self._tell_fall(self._body.fallen)
        if (stop.mode, self._deck.paused) != self._told:
            self._tell_mode(stop.mode, self._deck.paused)

    def tell(self, kind: EventKind, text: str, motion: str = "") -> None:
        """Tells all subscribers that something has happened."""
        self._send(Event(kind, text, motion, self._deck.time))

    def carry_out(
        self, message: DeckCommand, stop: StopRequest, *, remote: bool = False
    ) -> tuple[Reply, Progress | None]:
        """Carries out one command; its reply, and for a switch its progress."""
        self._look = None
        reply, progress = self._do(message, stop, remote)
        if self._note is not None:
            self._note(message, reply)
        return reply, progress

    def _carry_out_timed(self, stop: StopRequest) -> None:
        """Carries out the commands whose time is nearer to this tick than to the next one."""
        assert self._ticks is not None, "else none is accepted"
        if stop.emergency:
            self._timed.clear()
        until = self._ticks.due() + 0.5 * self._ticks.period
        due = [timed for timed in self._timed if timed[2].when <= until]
        for timed in sorted(due, key=lambda timed: timed[2].when):
            self._timed.remove(timed)
            server, sender, message = timed
            if not server.connected(sender):
                continue
            say = msgspec.structs.replace(message.say, id=message.id)
            reply, progress = self.carry_out(say, stop)
            if progress is not None and isinstance(say, Awaited):
                self._awaited.append((server, sender, say, progress))
            if isinstance(reply, Refused):
                server.reply(sender, reply)

    def _reply_again(self) -> None:
        """Sends the second replies of switches that have settled, were given up or overtaken."""
        for _ in range(len(self._awaited)):
            server, sender, message, progress = self._awaited.popleft()
            if progress.settled_s is not None:
                took = progress.settled_s - progress.commanded_s
                server.reply(sender, Settled(_destination(message), took, message.id))
            elif progress.fell_back:
                server.reply(sender, Refused(progress.fell_back, message.id))
            elif progress.overtaken:
                server.reply(sender, Refused(f"another command has overtaken {_destination(message)}", message.id))
            else:
                self._awaited.append((server, sender, message, progress))

    def _tell_looks(self) -> None:
        """Sends what looks at servos have found, or that nothing came of them."""
        for _ in range(len(self._looks)):
            server, sender, number, look, began = self._looks.popleft()
            answer = look.answer()
            if answer is None and self._now() - began > _LOOKED_WITHIN:
                answer = Refused("the rig has not answered")
            if answer is None:
                self._looks.append((server, sender, number, look, began))
            else:
                server.reply(sender, msgspec.structs.replace(answer, id=number))

    def _listen(self, message: DeckCommand, server: CommandServer, sender: Address) -> None:
        """Notes that a client was heard from, and what it wants to be told or not to be missed for."""
        listener = self._listeners.get(sender)
        if listener is None:
            if not isinstance(message, Subscribe | Heartbeat) or len(self._listeners) >= _MOST_LISTENERS:
                return
            listener = self._listeners[sender] = _Listener(server, sender, 0.0)
        listener.sender, listener.heard = sender, self._now()
        if isinstance(message, Subscribe):
            listener.subscribed = True
        elif isinstance(message, Heartbeat):
            listener.within = message.within

    def _miss_heartbeats(self) -> None:
        """Pauses the deck if somebody is gone who had promised to be heard from, and forgets who is gone."""
        now = self._now()
        for listener in [*self._listeners.values()]:
            gone = not listener.server.connected(listener.sender)
            silent = now - listener.heard
            if listener.within and (gone or silent > listener.within):
                self._deck.pause()
                del self._listeners[listener.sender]
                self.tell("lost", f"paused: a client has {'gone' if gone else f'been silent for {silent:.2f} s'}")
            elif gone or (listener.server.remote and silent > _FORGOTTEN_AFTER):
                del self._listeners[listener.sender]

    def _tell_fall(self, fallen: bool) -> None:
        self._fallen = fallen
        self.tell(
            *(("fell", "the robot has fallen") if fallen else ("stands", "the robot stands again")), self._deck.motion
        )

    def _tell_mode(self, mode: Mode, paused: bool) -> None:
        mode_before, paused_before = self._told
        self._told = mode, paused
        if mode != mode_before:
            self.tell("mode", mode)
        if paused != paused_before:
            self.tell("paused" if paused else "resumed", "paused" if paused else "plays on", self._deck.motion)

    def _send(self, event: Event) -> None:
        self._number += 1
        event = msgspec.structs.replace(event, number=self._number)
        for listener in self._listeners.values():
            if listener.subscribed:
                listener.server.reply(listener.sender, event)

    def _check_code(self, message: Reset, stop: StopRequest) -> None:
        """Refuses a reset from another machine that does not repeat the code of this emergency stop."""
        if not stop.emergency:
            return
        if not self._code or message.code != self._code:
            self._code = float(random.randrange(1000, 10000))
            raise EmergencyStopError(
                f"a reset from another machine has to be confirmed: see that nobody is near, then give "
                f"reset {self._code:.0f}"
            )

    def _do(self, message: DeckCommand, stop: StopRequest, remote: bool) -> tuple[Reply, Progress | None]:
        deck = self._deck
        progress: Progress | None = None
        try:
            if stop.mode not in row_of(message).modes:
                stop.check_released()
            match message:
                case GetStatus():
                    return self._state(message, stop), None
                case Heartbeat() | Subscribe():
                    pass
                case AlignTicks(here=here, there=there):
                    if self._ticks is None or remote:
                        raise MotiondeckError("ticks are aligned by programs of this machine, on a deck in real time")
                    self._ticks.align(round(1e9 * here), round(1e9 * there))
                case AtTime():
                    self._check_timed(message, remote)
                case GetPhase():
                    return PhaseNow(deck.motion, deck.phase, deck.phase_rate, message.id, deck.phase_at), None
                case EmergencyStop():
                    stop.emergency_stop()
                    deck.pause()
                case Reset():
                    if remote:
                        self._check_code(message, stop)
                    stop.reset()
                    self._code = 0.0
                case Stop():
                    stop.ask("stopped on command")
                case Home():
                    stop.go_home()
                    deck.pause()
                case Resume():
                    stop.play()
                    deck.resume()
                case ServoTorque(joint=joint, to=to):
                    if to == "on":
                        stop.check_released()
                    self._rig.switch(joint, on=to == "on")
                case LoadLibrary():
                    self._load(message, stop, remote)
                case RestartServo(joint=joint):
                    self._rig.restart(joint)
                case ReadRegisters(joint=joint):
                    self._look = self._rig.registers(joint)
                case WriteRegister(joint=joint, register=register, count=count):
                    self._look = self._rig.registers(joint, (register, count))
                case ScanPorts():
                    self._look = self._rig.scan()
                case Push():
                    self._push(message)
                case _:
                    progress = self._play(message, stop)
        except MotiondeckError as error:
            return Refused(str(error), message.id), None
        if progress is None:
            return Accepted(message.id), None
        return Accepted(message.id, progress.after, list(progress.via)), progress

    def _check_timed(self, message: AtTime, remote: bool) -> None:
        if self._ticks is None or remote:
            raise MotiondeckError("commands for a time are given by programs of this machine, on a deck in real time")
        if message.when > self._ticks.due() + _AHEAD:
            raise MotiondeckError(f"a command is given at most {_AHEAD:g} s ahead of its time")
        if len(self._timed) >= _MOST_TIMED:
            raise MotiondeckError(f"{_MOST_TIMED} commands wait for their time already")

    def _load(self, message: LoadLibrary, stop: StopRequest, remote: bool) -> None:
        """Asks for a controlled end, after which another library is started."""
        if remote:
            raise MotiondeckError("a library is loaded from this machine only")
        if not self._restarts:
            raise MotiondeckError("this deck takes no other library: start it with motiondeck play, with a page")
        if not Path(message.library).is_file():
            raise MotiondeckError(f"{message.library}: there is no such file; give the whole path")
        stop.ask(f"starts again with {message.to} of {Path(message.library).name}")
        stop.then = message.library, message.to

    def _push(self, push: Push) -> None:
        if self._body is None:
            raise MotiondeckError("nothing can be pushed here: play with a robot in simulated physics")
        given = self._body.push_from(push.side, push.impulse, push.towards)
        where = f"from the {push.side}" if push.towards is None else f"towards {math.degrees(push.towards):.0f}°"
        self.tell("push", f"pushed {where} with {given:.3g} N s", self._deck.motion)

    @property
    def _rig(self) -> RigServos:
        if self._servos is None:
            raise MotiondeckError("no servos are driven here; play with --rig")
        return self._servos

    def _play(self, message: DeckCommand, stop: StopRequest) -> Progress | None:
        """Carries out a command of the deck alone; a command for a motion also lets the joints follow it again."""
        deck = self._deck
        match message:
            case Switch(to=to, direct=direct):
                progress = deck.switch(to, direct=direct)
            case Queue(to=to):
                progress = deck.enqueue(to)
            case Blend(first=first, second=second, weight=weight, also=also):
                progress = deck.blend_in(first, second, weight, also)
            case SetTempo(factor=factor, over=over):
                return deck.set_tempo(factor, over)
            case Jump(phase=phase):
                return deck.jump(phase)
            case SetInput(name=name, value=value):
                return deck.set_input(name, value)
            case GiveBeat(ago=ago):
                return deck.beat(ago)
            case LockPhase(source=source, phase=phase, steps=steps):
                return deck.lock(source, phase, steps)
            case Unlock():
                return deck.unlock()
            case StepOn(seconds=seconds):
                return deck.step_on(seconds)
            case _:
                return deck.pause()
        if stop.mode != "playing":
            stop.play()
            deck.resume()
        return progress

    def _state(self, message: DeckCommand, stop: StopRequest) -> State:
        deck = self._deck
        return State(
            motion=deck.motion,
            motions=list(deck.motions),
            tempo=deck.tempo,
            paused=deck.paused,
            switching=not deck.settled,
            id=message.id,
            queue=deck.queue,
            mode=stop.mode,
            blend=deck.blend,
            fell_back=deck.fell_back,
            seen=self._seen() if self._seen is not None else None,
            phase=deck.phase,
            inputs=deck.inputs,
            lock=deck.lock_state,
            at=deck.time,
            fallen=self._fallen,
            approaching=stop.approaching,
        )


def _destination(message: Awaited) -> str:
    """What is played when the command has settled."""
    return " + ".join(message.motions) if isinstance(message, Blend) else message.to
