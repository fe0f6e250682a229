"""The run that is commanded: carries out one command on its deck, its servos, its body or its end."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from controller.loop.commands.interfaces import Commandable, Look, Progress, Pushable, RealTime, RigServos
from controller.loop.commands.timed_commands import TimedCommands
from controller.loop.stop_requests import EmergencyStopError, StopRequest
from controller.wire.messages import commands
from controller.wire.messages.command_table import row_of
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.deck_snapshot import SnapshotSource
from controller.wire.messages.events import Event
from controller.wire.messages.replies import Accepted, PhaseNow, Refused, Reply, State
from motiondeck_base.errors import MotiondeckError


class Outcome(NamedTuple):
    """What a command has led to: its reply; of a switch its progress; of a look at servos that look."""

    reply: Reply
    progress: Progress | None = None
    look: Look | None = None


@dataclass
class CommandedRun:
    """A run whose deck, servos, body and end are commanded; no command waits or raises.

    Attributes:
        deck: the deck that is commanded.
        servos: of the rig, if there is one.
        body: what is simulated, if it can be pushed.
        restarts: whether the run can be started again with another library.
        ticks: the clock of the loop, in real time.
        snapshots: of the run, for status replies; by default of the deck and the body.
        timed: the commands whose time is still to come.
    """

    deck: Commandable
    servos: RigServos | None = None
    body: Pushable | None = None
    restarts: bool = False
    ticks: RealTime | None = None
    snapshots: SnapshotSource | None = None

    def __post_init__(self) -> None:
        self._snapshots = self.snapshots or SnapshotSource(self.deck, self.body)
        self.timed = TimedCommands(self.ticks)
        self._code = 0.0  # that confirms the reset of the present emergency stop from another machine

    def carry_out(self, message: DeckCommand, stop: StopRequest, *, remote: bool) -> Outcome:
        """Carries out one command, of another machine if it is `remote`."""
        try:
            if stop.mode not in row_of(message).modes:
                stop.check_released()
            return self._carry_out(message, stop, remote)
        except MotiondeckError as error:
            return Outcome(Refused(str(error), message.id))

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
            case commands.Switch() | commands.Queue() | commands.Blend():
                progress = self._play(message, stop)
                return Outcome(Accepted(message.id, progress.after, list(progress.via)), progress)
            case commands.Heartbeat() | commands.Subscribe():
                pass
            case commands.AlignTicks(here=here, there=there):
                if self.ticks is None or remote:
                    raise MotiondeckError("ticks are aligned by programs of this machine, on a deck in real time")
                self.ticks.align(round(1e9 * here), round(1e9 * there))
            case commands.AtTime():
                self.timed.check(message, remote=remote)
            case commands.EmergencyStop():
                stop.emergency_stop()
                deck.pause()
            case commands.Reset():
                if remote:
                    self._check_code(message, stop)
                stop.reset()
                self._code = 0.0
            case commands.Stop():
                stop.ask("stopped on command")
            case commands.Home():
                stop.go_home()
                deck.pause()
            case commands.Resume():
                stop.play()
                deck.resume()
            case commands.ServoTorque(joint=joint, to=to):
                if to == "on":
                    stop.check_released()
                self._rig.switch(joint, on=to == "on")
            case commands.RestartServo(joint=joint):
                self._rig.restart(joint)
            case commands.LoadLibrary():
                self._load(message, stop, remote)
            case commands.Push():
                self._push(message)
            case _:
                self._steer(message)
        return done

    def _play(self, message: commands.Switch | commands.Queue | commands.Blend, stop: StopRequest) -> Progress:
        """Plays another motion, which lets the joints follow the deck again."""
        match message:
            case commands.Switch(to=to, direct=direct):
                progress = self.deck.switch(to, direct=direct)
            case commands.Queue(to=to):
                progress = self.deck.enqueue(to)
            case commands.Blend(first=first, second=second, weight=weight, also=also):
                progress = self.deck.blend_in(first, second, weight, also)
        if stop.mode != "playing":
            stop.play()
            self.deck.resume()
        return progress

    def _steer(self, message: DeckCommand) -> None:
        """Changes how the motion is played."""
        deck = self.deck
        match message:
            case commands.SetTempo(factor=factor, over=over):
                deck.set_tempo(factor, over)
            case commands.Jump(phase=phase):
                deck.jump(phase)
            case commands.SetInput(name=name, value=value):
                deck.set_input(name, value)
            case commands.GiveBeat(ago=ago):
                deck.beat(ago)
            case commands.LockPhase(source=source, phase=phase, steps=steps):
                deck.lock(source, phase, steps)
            case commands.Unlock():
                deck.unlock()
            case commands.StepOn(seconds=seconds):
                deck.step_on(seconds)
            case _:
                deck.pause()

    def _check_code(self, message: commands.Reset, stop: StopRequest) -> None:
        """Refuses a reset from another machine that does not repeat the code of this emergency stop."""
        if not stop.emergency:
            return
        if not self._code or message.code != self._code:
            self._code = float(random.randrange(1000, 10000))
            raise EmergencyStopError(
                f"a reset from another machine has to be confirmed: see that nobody is near, then give "
                f"reset {self._code:.0f}"
            )

    def _load(self, message: commands.LoadLibrary, stop: StopRequest, remote: bool) -> None:
        """Asks for a controlled end, after which another library is started."""
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
