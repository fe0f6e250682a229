"""One run of `motiondeck play`: everything is opened, the loop runs, everything is closed in the reverse order."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np

from controller.cli.session.child_process import child_process, kept_tty
from controller.cli.session.page import HEALTH_EVERY, PICTURE_HZ, Page, viewer
from controller.cli.session.recognition_watch import RecognitionWatch, Watching
from controller.cli.session.report import full_report
from controller.cli.session.robot_on_deck import FOLLOWER, RobotOnDeck, RobotSetup, open_body
from controller.cli.session.script import Timed
from controller.cli.session.tick_recorder import TickRecorder, recording
from controller.deck.interfaces import Retargeter
from controller.deck.recorded_deck import RecordedDeck
from controller.deck.switch import CommandedSwitch
from controller.library.motion_library import MotionLibrary
from controller.loop.clock import Clock, Ticker
from controller.loop.command_desk import Commandable, CommandDesk
from controller.loop.ensemble import Ensemble, all_limits
from controller.loop.loop import LoopState, run
from controller.loop.permissions import (
    Permission,
    handed_back,
    leave_core,
    request_core,
    request_one_blas_thread,
    request_realtime,
)
from controller.loop.run_phases import Player
from controller.loop.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest, stop_on_signals
from controller.mocap.encodings.joint_angles import JointBody
from controller.rotations import Array
from controller.wire.command_socket import CommandServer, Refused


@dataclass(frozen=True)
class Settings:
    """What a run is made of.

    Attributes:
        robot: who plays, and with which rig.
        rate: ticks a second.
        physics: whether robots move by servos and masses or exactly as they are told.
        realtime: whether to ask for real-time scheduling.
        command_port: where commands come in; 0 for a free port.
        page_port: where the page is, 0 for a free port, None for no page.
        terminal: whether there is a prompt.
        seconds: how long to play, or None for as long as nobody stops it.
        record: where every tick is recorded, if anywhere.
        core: the core that the loop is to run on, if it matters; all other processes then keep off it.
        follow: a second robot that mirrors the first, if any.
        listen: the address of another interface where commands are taken, sealed with the token.
        token: who has it may command.
        catch_up: whether ticks that were missed are made up for without waiting, or skipped.
        watching: how the motion that the joints make is to be recognized, if at all.
    """

    robot: RobotSetup
    rate: float
    physics: bool
    realtime: bool
    command_port: int
    page_port: int | None
    terminal: bool
    seconds: float | None
    record: Path | None = None
    core: int | None = None
    follow: RobotSetup | None = None
    catch_up: bool = False
    watching: Watching | None = None
    listen: str | None = None
    token: bytes | None = None


class Playable(Player, Commandable, Protocol):
    """A deck as a session needs it."""

    time: float

    @property
    def commanded_speed(self) -> float:
        """The tempo that was commanded."""
        ...

    @property
    def playing(self) -> str:
        """What is played now, perhaps on the way to another motion."""
        ...

    @property
    def switches(self) -> Sequence[CommandedSwitch]:
        """What was commanded."""
        ...

    @property
    def recues(self) -> int:
        """How often the network was lost and had to be started again."""
        ...


class Session:
    """Opens all that a run needs; use it as a context manager.

    Args:
        library: whose skeleton the robot is fitted to.
        make_deck: makes what is played, for the robot's retargeting.
        timeline: what is commanded when, in order.
        settings: the rest.
        clock: what the loop runs on, of the rate in the settings; by itself a `Ticker`.

    Attributes:
        bodies: who plays; there are some once it is open.
    """

    def __init__(
        self,
        library: MotionLibrary,
        make_deck: Callable[[Retargeter], Playable],
        timeline: list[Timed],
        settings: Settings,
        clock: Clock | None = None,
    ) -> None:
        self._library, self._make_deck, self._settings = library, make_deck, settings
        self._clock = clock or Ticker(settings.rate, "catch_up" if settings.catch_up else "skip")
        self._waiting = list(timeline)
        self.bodies: list[RobotOnDeck] = []
        self._refused: list[dict[str, object]] = []
        self._permissions: list[Permission] = []
        self._restore_tty: Callable[[], None] = lambda: None
        self._beside: list[tuple[str, subprocess.Popen[bytes]]] = []
        self._open = ExitStack()
        self._page: Page | None = None

    def __enter__(self) -> Session:
        with ExitStack() as opening:
            # From here on a signal asks for a stop: what has been opened is closed in order.
            self._stop = opening.enter_context(stop_on_signals())
            with handed_back():
                if self._settings.core is not None:
                    leave_core(self._settings.core)  # for the processes that are started now
                self._prepare(opening)
            self._open = opening.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._open.close()

    def _prepare(self, opening: ExitStack) -> None:
        settings = self._settings
        self._server = CommandServer(settings.command_port)
        servers = [self._server]
        if settings.listen is not None:
            servers.append(CommandServer(self._server.port, settings.listen, settings.token))
        for server in servers:
            opening.callback(server.close)
        # The view takes longest to start, so it starts first and waits for the rest.
        view: Path | None = None
        if settings.page_port is not None:
            view, process = opening.enter_context(viewer(self._server.port, settings.page_port))
            self._beside.append(("the page", process))
        casts = {"": settings.robot} | ({FOLLOWER: settings.follow} if settings.follow is not None else {})
        self.bodies = [
            open_body(opening, cast, self._library, settings.rate, physics=settings.physics, called=called)
            for called, cast in casts.items()
        ]
        self._body = self.bodies[0]
        self._deck = self._make_deck(Ensemble([body.retarget for body in self.bodies]))
        self._channels = RobotOnDeck.channels_of(self.bodies)
        self._envelope = SafetyEnvelope(all_limits([body.limits for body in self.bodies]), self._clock.period)
        self._watch = (
            RecognitionWatch.over(self._body, self._channels[0], self._library, settings.rate, settings.watching)
            if settings.watching
            else None
        )
        # Of a recorded run the human's root alone is known, and joints taught by hand were never a human's.
        skeleton = self._library.skeleton
        human = None if isinstance(self._deck, RecordedDeck) or isinstance(skeleton, JointBody) else skeleton
        if view is not None:
            page = Page.open(view, self._deck.motions, self.bodies, human, self._watch)
            self._page = opening.enter_context(page)
        self._recorder = self._open_recorder(opening) if settings.record else None
        self._desk = CommandDesk(
            self._deck,
            servers,
            self._recorder.note if self._recorder else None,
            (lambda watch=self._watch: watch.seen) if self._watch else None,
        )
        if settings.terminal:
            self._restore_tty = opening.enter_context(kept_tty())
            terminal = child_process("controller.cli.session.terminal", "--command-port", str(self._server.port))
            self._beside.append(("the prompt", opening.enter_context(terminal)))

    def run(self) -> dict[str, Any]:
        """Plays until the time is over or somebody stops it, and says how it went."""
        settings = self._settings
        with handed_back():
            if settings.core is not None:
                self._permissions.append(request_core(settings.core))
            if settings.realtime:
                self._permissions += [*request_realtime(), request_one_blas_thread()]
            for permission in self._permissions:
                print(permission, file=sys.stderr)
            report = run(
                self._deck,
                self._channels,
                self._clock,
                self._envelope,
                seconds=settings.seconds if settings.seconds is not None else float("inf"),
                rest=np.concatenate([body.robot.rest for body in self.bodies]),
                commands=self._commands,
                publish=self._publish if self._page or self._recorder or self._watch else None,
                publish_every=1 if self._recorder or self._watch else self._ticks_a_picture,
                stop=self._stop,
            )
        # The joints first: what else is closed may take its time.
        for channel in self._channels:
            channel.output.close()
        if self._page:
            self._page.close()
        names = [name for body in self.bodies for name in body.joints]
        said = full_report(report, names, self._deck.switches, self._permissions)
        said |= {"refused": self._refused, "recues": self._deck.recues}
        guards = {body.called: body.guard for body in self.bodies if body.guard is not None}
        kept = {called + pair: count for called, guard in guards.items() for pair, count in guard.kept_apart.items()}
        said |= {"kept_apart": kept} if guards else {}
        said |= {"recognition": self._watch.report()} if self._watch else {}
        return said | {"library": self._library.info.name, "robot": self._body.robot.name}

    def _commands(self, stop: StopRequest) -> None:
        """What comes in over the socket, and the timeline's commands when their time has come."""
        while self._waiting and self._waiting[0].at <= self._deck.time:
            timed = self._waiting.pop(0)
            reply, _ = self._desk.carry_out(timed.message, stop)
            if isinstance(reply, Refused):
                self._refused.append({"at": timed.at, "reason": reply.reason})
        if isinstance(self._deck, RecordedDeck) and self._deck.over:
            stop.ask("replayed to the end")
        for body in self.bodies:
            if body.rig is not None and body.rig.parked:
                stop.ask(f"the rig is lost: {body.rig.fault}")
        self._desk(stop)

    def _measured(self) -> Array | None:
        """Where the joints of the first robot are, as far as it is known, rad."""
        measured = self._channels[0].measured
        return None if measured is None else measured[: len(self._body.joints)]

    def _look_beside(self) -> None:
        """Says so when the page or the prompt has died: the deck plays on without them."""
        for name, process in [*self._beside]:
            if process.poll() is not None:
                self._beside.remove((name, process))
                if process.returncode != 0:
                    self._restore_tty()
                    print(f"motiondeck: {name} has ended; the deck plays on", file=sys.stderr)

    def _publish(self, state: LoopState) -> None:
        """Hands the state to the watch, to the recorder and, now and then, to the page."""
        if self._watch is not None:
            self._watch.look(state, self._deck, self._stop)
        if self._recorder is not None:
            deck = self._deck
            seen = self._watch.seen if self._watch is not None else None
            self._recorder.record(
                state,
                self._stop,
                self._measured(),
                self._body.stage.placed,
                time_s=deck.time,
                motion=deck.motions.index(deck.playing),
                speed=deck.speed,
                switching=not deck.settled,
                seen=deck.motions.index(seen[0]) if seen is not None else -1.0,
                confidence=seen[1] if seen is not None else 0.0,
            )
        if self._page is not None and state.tick % self._ticks_a_picture == 0:
            self._page.show(
                state, self._stop, self._deck, health=state.tick // self._ticks_a_picture % HEALTH_EVERY == 0
            )
        if state.tick // self._ticks_a_picture % HEALTH_EVERY == 0:
            self._look_beside()

    def _open_recorder(self, opening: ExitStack) -> TickRecorder:
        settings, joints = self._settings, list(self._body.joints)
        assert settings.record is not None
        description = {
            "library": self._library.info.name,
            "robot": self._body.robot.name,
            "joints": joints,
            "motions": list(self._deck.motions),
            "rate": settings.rate,
            "root": settings.robot.root,
            "balance": settings.robot.balance,
        }
        return opening.enter_context(recording(settings.record, description, len(joints), settings.rate))

    @property
    def _ticks_a_picture(self) -> int:
        return max(1, round(self._settings.rate / PICTURE_HZ))
