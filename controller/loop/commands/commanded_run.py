"""Carries out commands on a run: on its deck, servos, body, or its end. A command without a case is a type error."""

import math
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, assert_never

import msgspec

from controller.deck.deck import Deck
from controller.deck.recorded_deck import RecordedDeck
from controller.deck.switch import CommandedSwitch
from controller.loop.clock import Ticker
from controller.loop.commands.interfaces import Client, Look, PlayableDeck, Pushable, RigServos
from controller.loop.commands.snapshots import SnapshotSource
from controller.loop.stop_requests import StopRequest
from controller.loop.stop_state import EmergencyStopError
from controller.wire.messages import commands
from controller.wire.messages.commands import AtTime, DeckCommand
from controller.wire.messages.deck_snapshot import Mode
from controller.wire.messages.replies import Accepted, Event, PhaseNow, Refused, Reply, State
from motiondeck_base.errors import MotiondeckError, in_words


def refusal(error: Exception, number: int) -> Refused:
    """The reply to a command that has raised; what JSON cannot carry of the reason is replaced."""
    return Refused(in_words(error).encode(errors="replace").decode(), number)


def mode_events(
    deck: PlayableDeck, mode: Mode, before: tuple[Mode, bool], presses: int = 0, *, pressed: bool = False
) -> Iterator[Event]:
    """The events of a change of mode or pause since `before`, or of the emergency stop `pressed` once more."""
    mode_before, paused_before = before
    if mode != mode_before or pressed:
        yield Event("mode", mode, at=deck.time, presses=presses)
    if deck.paused != paused_before:
        kind, text = ("paused", "paused") if deck.paused else ("resumed", "plays on")
        yield Event(kind, text, deck.motion, deck.time)


class Outcome(NamedTuple):
    """The reply to a command, and what its second reply waits for: the progress of a switch, or a look at servos."""

    reply: Reply
    progress: CommandedSwitch | None = None
    look: Look | None = None


@dataclass
class CommandedRun:
    """A run that commands are carried out on; none waits or raises."""

    deck: PlayableDeck
    servos: RigServos | None = None
    body: Pushable | None = None  # what is simulated, if it can be pushed
    restarts: bool = False  # whether the run can be started again with another library
    ticks: Ticker | None = None  # the clock of a loop in real time
    snapshots: SnapshotSource | None = None  # of the run, for status replies; by default of the deck and the body

    def __post_init__(self) -> None:
        self._snapshots = self.snapshots or SnapshotSource(self.deck, self.body)
        self.timed = TimedCommands(self.ticks)
        self._code = 0.0  # confirms the reset of the present emergency stop from another machine

    def carry_out(self, message: DeckCommand, stop: StopRequest, *, remote: bool) -> Outcome:
        """Carries out one command, of another machine if it is `remote`; whatever goes wrong refuses it."""
        try:
            if stop.mode not in message.row.modes:
                stop.state.check_released()
            if isinstance(self.deck, RecordedDeck):
                message.row.check_use("replay")
            return self._carry_out(message, stop, remote)
        except Exception as error:
            return Outcome(refusal(error, message.id))

    def halt(self) -> None:
        """Has the deck pause at a press of the emergency stop; a remote reset has to be confirmed anew."""
        self._code = 0.0
        self.deck.pause()

    def _carry_out(self, message: DeckCommand, stop: StopRequest, remote: bool) -> Outcome:
        deck, done = self.deck, Outcome(Accepted(message.id))
        match message:
            case commands.GetStatus():
                return Outcome(State.of(self._snapshots.take(stop), deck.motions, message.id))
            case commands.GetPhase():
                return Outcome(PhaseNow(deck.motion, deck.phase, deck.phase_rate, message.id, deck.phase_at))
            case commands.ReadRegisters(joint=joint):
                return done._replace(look=self._rig.registers(joint))
            case commands.WriteRegister(joint=joint, register=register, count=count):
                return done._replace(look=self._rig.registers(joint, (register, count)))
            case commands.ScanPorts():
                return done._replace(look=self._rig.scan())
            case commands.Switch(to=to, direct=direct):
                return self._played(message, self._deck.switch(to, direct=direct), stop)
            case commands.Queue(to=to):
                return self._played(message, self._deck.enqueue(to), stop)
            case commands.Blend(first=first, second=second, weight=weight, also=also):
                return self._played(message, self._deck.blend_in(first, second, weight, also), stop)
            case commands.SetTempo(factor=factor, over=over):
                deck.set_tempo(factor, over)
            case commands.Jump(phase=phase):
                self._deck.jump(phase)
            case commands.SetInput(name=name, value=value, seconds=seconds):
                self._deck.set_input(name, value, seconds)
            case commands.Gaze(left=left, up=up, ahead=ahead, seconds=seconds):
                self._deck.gaze(left, up, ahead, seconds)
            case commands.Layer(group=group, to=to, weight=weight, tempo=tempo):
                self._deck.layer(group, to, weight, tempo)
            case commands.GiveBeat(ago=ago):
                self._deck.beat(ago)
            case commands.LockPhase(source=source, phase=phase, steps=steps):
                self._deck.lock(source, phase, steps)
            case commands.FollowPerson(to=to, phase=phase, tempo=tempo, ago=ago, body=body):
                self._deck.follow(to, phase, tempo, ago, body)
            case commands.Unlock():
                self._deck.unlock()
            case commands.Pause():
                deck.pause()
            case commands.StepOn(seconds=seconds):
                deck.step_on(seconds)
            case commands.Resume():
                stop.play()
                deck.resume()
            case commands.Home():
                stop.go_home()
                deck.pause()
            case commands.EmergencyStop():
                stop.state.press("command")
                self.halt()
            case commands.Reset():
                if remote:
                    self._check_code(message, stop)
                stop.state.reset()
                self._code = 0.0
            case commands.Stop():
                stop.ask("stopped on command")
            case commands.Heartbeat() | commands.Subscribe():
                pass  # noted by `Listeners`
            case commands.AlignTicks(here=here, there=there):
                if self.ticks is None or remote:
                    raise MotiondeckError("ticks are aligned by programs of this machine, on a deck in real time")
                self.ticks.align(round(1e9 * here), round(1e9 * there))
            case commands.AtTime():
                self.timed.check(message, remote=remote)
            case commands.ServoTorque(joint=joint, to=to):
                if to == "on":
                    stop.state.check_released()
                self._rig.switch(joint, on=to == "on")
            case commands.RestartServo(joint=joint):
                self._rig.restart(joint)
            case commands.LoadLibrary():
                self._load(message, stop, remote)
            case commands.Push():
                self._push(message)
            case _:
                assert_never(message)
        return done

    @property
    def _deck(self) -> Deck:
        assert not isinstance(self.deck, RecordedDeck), "rows keep a replay from such commands"
        return self.deck

    def _played(self, message: DeckCommand, progress: CommandedSwitch, stop: StopRequest) -> Outcome:
        if stop.mode != "playing":
            stop.play()
            self.deck.resume()
        return Outcome(Accepted(message.id, progress.after, list(progress.via)), progress)

    def _check_code(self, message: commands.Reset, stop: StopRequest) -> None:
        """Refuses a reset from another machine that does not repeat the code of this emergency stop."""
        if not stop.emergency:
            return
        if not self._code or message.code != self._code:
            self._code = float(random.randrange(1000, 10000))
            raise EmergencyStopError(
                f"a reset from another machine has to be confirmed: if the robot is clear, give reset {self._code:.0f}"
            )

    def _load(self, message: commands.LoadLibrary, stop: StopRequest, remote: bool) -> None:
        if remote:
            raise MotiondeckError("a library is loaded from this machine only")
        if not self.restarts:
            raise MotiondeckError("this deck takes no other library: start it with motiondeck play, with a page")
        if not Path(message.library).is_file():
            raise MotiondeckError(f"{message.library}: there is no such file; give the whole path")
        stop.ask(f"starts again with {message.to} of {Path(message.library).name}")
        stop.then = message.library, message.to

    def _push(self, push: commands.Push) -> None:
        if self.body is None:
            raise MotiondeckError("nothing can be pushed here: play with a robot in simulated physics")
        given = self.body.push_from(push.side, push.impulse, push.towards)
        where = f"from the {push.side}" if push.towards is None else f"towards {math.degrees(push.towards):.0f}°"
        text = f"pushed {where} with {given:.3g} N s"
        self.deck.events.append(Event("push", text, self.deck.motion, self.deck.time))

    @property
    def _rig(self) -> RigServos:
        if self.servos is None:
            raise MotiondeckError("no servos are driven here; play with --rig")
        return self.servos


_AHEAD = 60.0  # s, the most ahead of its time
_MOST_TIMED = 64  # commands whose time is still to come


class TimedCommands:
    """The commands whose time is still to come, by the loop's clock; without one (not in real time) none is taken."""

    def __init__(self, ticks: Ticker | None) -> None:
        self._ticks = ticks
        self.waiting: list[tuple[Client, AtTime]] = []

    def check(self, message: AtTime, *, remote: bool) -> None:
        """Checks that one more can be kept; the MotiondeckError says why not."""
        if self._ticks is None or remote:
            raise MotiondeckError("commands for a time are given by programs of this machine, on a deck in real time")
        if message.when > self._ticks.due() + _AHEAD:
            raise MotiondeckError(f"a command is given at most {_AHEAD:g} s ahead of its time")
        if len(self.waiting) >= _MOST_TIMED:
            raise MotiondeckError(f"{_MOST_TIMED} commands wait for their time already")

    def take_due(self) -> Iterator[tuple[Client, DeckCommand]]:
        """Takes those whose time is nearer to this tick than to the next one, in order, of clients still connected."""
        # A command has the number with which it was given.
        assert self._ticks is not None, "else none is taken"
        until = self._ticks.due() + 0.5 * self._ticks.period
        due = sorted((timed for timed in self.waiting if timed[1].when <= until), key=lambda timed: timed[1].when)
        self.waiting = [timed for timed in self.waiting if timed[1].when > until]
        for client, message in due:
            if client.connected:
                yield client, msgspec.structs.replace(message.say, id=message.id)
