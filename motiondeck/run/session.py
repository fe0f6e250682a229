"""One run: everything is opened, the loop runs, everything is closed in the reverse order."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np

from controller.deck.interfaces import Retargeter
from controller.deck.lockable import Lockable
from controller.deck.recorded_deck import RecordedDeck
from controller.deck.switch import CommandedSwitch
from controller.library.motion_library import MotionLibrary
from controller.loop.clock import Clock, Ticker
from controller.loop.commands.command_desk import CommandDesk
from controller.loop.commands.commanded_run import CommandedRun, Playback
from controller.loop.ensemble import all_limits, together
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
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest, stop_on_signals
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from controller.wire.messages.deck_snapshot import SnapshotSource, TickHealth
from controller.wire.messages.replies import Refused
from motiondeck.run.beside.child_process import Children, child_process, kept_tty, page_process
from motiondeck.run.beside.show_member import ShowMember, show_member
from motiondeck.run.beside.tick_recorder import TickRecorder
from motiondeck.run.openings import lock_deck, open_recorder, open_servers
from motiondeck.run.page.contents import PageContents, ShownDeck
from motiondeck.run.page.page import HEALTH_EVERY, PICTURE_HZ, Page
from motiondeck.run.plugin_outputs import open_outputs
from motiondeck.run.progress_line import progress_line
from motiondeck.run.recognition.body_watch import BodyWatch
from motiondeck.run.recognition.recognition_watch import RecognitionWatch
from motiondeck.run.recognition.watch import Watch
from motiondeck.run.report import RunNews, run_report
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck.run.robots.robot_on_deck import RobotOnDeck, channels_of
from motiondeck.run.run_settings import RunSettings
from motiondeck.run.script import Timed
from motiondeck.run.wired_stop import WiredStopWatch


class PlayableDeck(Player, Playback, ShownDeck, Protocol):
    """A deck as a session needs it."""

    @property
    def switches(self) -> Sequence[CommandedSwitch]:
        """What was commanded."""
        ...


class Session:
    """Opens all that a run needs; use it as a context manager.

    Args:
        source: what is played; a session needs its name and its skeleton, recognition its motions.
        open_robots: opens the robots, at least one; the stack that it gets closes them.
        make_deck: makes what is played, for the robots' retargeting.
        settings: the rest.
        timeline: what is commanded when, in order.
        clock: what the loop runs on, of the rate in the settings; a `Ticker` by default.

    Attributes:
        robots: those that play, once it is open.
        command_port: where commands are taken, once it is open.
        page_port: where the page is, once it is open, if there is one.
    """

    def __init__(
        self,
        source: MotionLibrary | Clip,
        open_robots: Callable[[ExitStack], list[RobotOnDeck]],
        make_deck: Callable[[Retargeter], PlayableDeck],
        settings: RunSettings,
        timeline: Sequence[Timed] = (),
        clock: Clock | None = None,
    ) -> None:
        self._source, self._open_robots, self._make_deck, self._settings = source, open_robots, make_deck, settings
        self._clock = clock or Ticker(settings.rate, "catch_up" if settings.catch_up else "skip")
        self._timeline = list(timeline)
        self.robots: list[RobotOnDeck] = []
        self.command_port = 0
        self.page_port: int | None = None
        self._refused: list[dict[str, object]] = []
        self._permissions: list[Permission] = []
        self._children = Children()
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
        """Opens everything; the page takes longest to start, so it starts first and waits for the rest."""
        settings = self._settings
        if settings.stop_input is not None:
            opening.callback(settings.stop_input.close)
        servers, self.command_port = open_servers(opening, settings.command_port, settings.listen, settings.token)
        page_state = self._start_page(opening)
        member = self._take_part(opening)
        self.robots = self._open_robots(opening)
        self._first = self.robots[0]
        rig = self._first.rig.output if self._first.rig is not None else None
        servos = rig if isinstance(rig, RigOutput) else None
        self._deck = self._make_deck(together([robot.retarget for robot in self.robots]))
        names = [name for robot in self.robots for name in robot.joints]
        outputs = open_outputs(opening, settings.outputs, names, settings.rate)
        self._channels = [*channels_of(self.robots), *outputs]
        for body in filter(None, (robot.pushable for robot in self.robots)):
            body.clock = lambda: self._deck.time  # as events do; the approach comes before
            body.holds = lambda: self._stop.holds
        if isinstance(self._deck, Lockable):
            self._deck.measured = self._measured
            if isinstance(self._clock, Ticker):
                self._deck.due = self._clock.due
            lock_deck(opening, self._deck, settings.lock_to)
            if member is not None:
                member.lead(opening, self._deck)
        self._envelope = SafetyEnvelope(all_limits([robot.limits for robot in self.robots]), self._clock.period)
        self._watch = self._open_watch()
        if page_state is not None:
            contents = PageContents(
                self._deck,
                self.robots,
                self._shown_human(),
                self._watch,
                self.command_port,
                settings.library,
                servos,
                learns=settings.restarts,
            )
            self._page = opening.enter_context(Page.open(page_state, contents))
        self._recorder = self._open_recorder(opening)
        seen = (lambda watch=self._watch: watch.seen) if self._watch else None
        ticks = self._clock if isinstance(self._clock, Ticker) else None
        guards = [robot.guard for robot in self.robots if robot.guard is not None]
        self._snapshots = SnapshotSource(
            self._deck,
            self._first.pushable,
            self._watch,
            (lambda: sum(guard.kept_apart.total() for guard in guards)) if guards else None,
        )
        commanded = CommandedRun(
            self._deck, servos, self._first.pushable, settings.restarts, ticks, snapshots=self._snapshots
        )
        self._desk = CommandDesk(commanded, servers, self._recorder.note if self._recorder else None)
        self._wired_stop = WiredStopWatch(settings.stop_input, self._desk) if settings.stop_input is not None else None
        self._news = RunNews(self._desk, self._clock, self._channels, servers, seen)
        self._start_terminal(opening)

    def _start_page(self, opening: ExitStack) -> Path | None:
        """The state file that the page waits for, if there is a page."""
        page = self._settings.page
        if page is None:
            if self._settings.page_port is None:
                return None
            page = opening.enter_context(page_process(self._settings.page_port, self._settings.command_port))
        self.page_port = page.port
        self._children.add("the page", page.process)
        return page.state

    def _open_watch(self) -> Watch | None:
        settings = self._settings
        if settings.recognizer is not None:
            return BodyWatch(settings.recognizer, self._source.skeleton)
        if settings.mismatch is None or not isinstance(self._source, MotionLibrary):
            return None
        return RecognitionWatch.over(self._first, self._channels[0], self._source, settings.rate, settings.mismatch)

    def _open_recorder(self, opening: ExitStack) -> TickRecorder | None:
        file, rate = self._settings.record, self._settings.rate
        if file is None:
            return None
        names = self._watch.names if self._watch is not None else ()
        recorder = open_recorder(opening, file, self._first, self._source_name, self._deck.motions, names, rate)
        self._children.add("the recorder", recorder.process)
        return recorder

    def _take_part(self, opening: ExitStack) -> ShowMember | None:
        """Starts the part in a show, if there is one; it opens while the robots do."""
        show, source = self._settings.show, self._source
        if show is None or not isinstance(source, MotionLibrary):
            return None
        member = opening.enter_context(
            show_member(show, self.command_port, source, self._settings.robot, self._settings.rate)
        )
        then = "no cue and no emergency stop of the show reaches this deck until it is started again"
        self._children.add("the part in the show", member.process, then)
        return member

    def _start_terminal(self, opening: ExitStack) -> None:
        if not self._settings.terminal:
            return
        self._children.restore_tty = opening.enter_context(kept_tty())
        terminal = child_process("motiondeck.run.terminal", "--command-port", str(self.command_port))
        self._children.add("the prompt", opening.enter_context(terminal))

    @property
    def _source_name(self) -> str:
        return self._source.info.name if isinstance(self._source, MotionLibrary) else self._source.name

    def _shown_human(self) -> Skeleton | None:
        """Whose motion the page shows beside the robot.

        Of a recorded run the human's root alone is known, and joints taught by hand were never a human's.
        """
        skeleton = self._source.skeleton
        unknown = isinstance(self._deck, RecordedDeck) or skeleton.is_rig
        return None if unknown else skeleton

    @property
    def then(self) -> tuple[str, str] | None:
        """The library file and the motion to start again with, if that was asked for."""
        return self._stop.then

    def run(self) -> dict[str, Any]:
        """Plays until the time is over or somebody stops it; the report of the run."""
        settings = self._settings
        rests = [robot.rest for robot in self.robots if robot.rest is not None]
        with handed_back(), ExitStack() as shown:
            self._request_permissions()
            if settings.progress:
                shown.enter_context(progress_line(self._deck, self._stop, settings.seconds, prompt=settings.terminal))
            report = run(
                self._deck,
                self._channels,
                self._clock,
                self._envelope,
                seconds=settings.seconds if settings.seconds is not None else float("inf"),
                rest=np.concatenate(rests) if len(rests) == len(self.robots) else None,
                commands=self._carry_out_commands,
                publish=self._publish,
                publish_every=1 if self._recorder or self._watch else self._ticks_a_picture,
                stop=self._stop,
            )
        self._desk.tell("ended", report.reason)
        # The joints first: what else is closed may take its time.
        for channel in self._channels:
            channel.output.close()
        if self._page:
            self._page.end(self._stop.reason)
        recorded = {"recording": self._recorder.finish()} if self._recorder else {}
        names = [name for robot in self.robots for name in robot.joints]
        full = run_report(report, names, self._deck.switches, self._permissions)
        full |= {"refused": self._refused, "restarts": self._deck.restarts}
        full |= {"library": self._source_name, "robot": self._first.name} | recorded
        return full | self._kept_apart() | ({"recognition": self._watch.report()} if self._watch else {})

    def _request_permissions(self) -> None:
        if self._settings.core is not None:
            self._permissions.append(request_core(self._settings.core))
        if self._settings.realtime:
            self._permissions += [*request_realtime(), request_one_blas_thread()]
        for permission in self._permissions:
            print(permission, file=sys.stderr)

    def _kept_apart(self) -> dict[str, Any]:
        """How often which limbs were kept apart, where that was wanted."""
        guards = {robot.prefix: robot.guard for robot in self.robots if robot.guard is not None}
        counts = {prefix + pair: count for prefix, guard in guards.items() for pair, count in guard.kept_apart.items()}
        return {"kept_apart": counts} if guards else {}

    def _carry_out_commands(self, stop: StopRequest) -> None:
        """What comes in over the socket, and the timeline's commands when their time has come."""
        while self._timeline and self._timeline[0].at <= self._deck.time:
            timed = self._timeline.pop(0)
            reply = self._desk.carry_out(timed.message, stop)
            if isinstance(reply, Refused):
                self._refused.append({"at": timed.at, "reason": reply.reason})
        if isinstance(self._deck, RecordedDeck) and self._deck.over:
            stop.ask("played to the end")
        for robot in self.robots:
            if robot.rig is not None and robot.rig.parked:
                stop.ask(f"the rig is lost: {robot.rig.fault}")
        if self._wired_stop is not None:
            self._wired_stop.look(stop)
        self._desk(stop)
        self._news.look()

    def _measured(self) -> Array | None:
        """Where the joints of the first robot are, as far as it is known, rad."""
        measured = self._channels[0].measured
        return None if measured is None else measured[: len(self._first.own_joints)]

    def _publish(self, loop: LoopState) -> None:
        """Hands the tick to the watch, to the recorder and, now and then, to the page."""
        snapshots = self._snapshots
        snapshots.loop = loop
        if self._watch is not None:
            self._watch.look(loop, self._deck, self._stop)
        pictures, between = divmod(loop.tick, self._ticks_a_picture)
        if between == 0 and pictures % HEALTH_EVERY == 0:
            snapshots.health = tick_health(loop)
            self._children.report_dead()
        page = self._page if between == 0 else None
        if self._recorder is None and page is None:
            return
        snapshot = snapshots.take(self._stop)
        if self._recorder is not None:
            simulation = self._first.simulation
            assert simulation is not None, "recorded without a simulation"
            self._recorder.record(snapshot, loop, self._measured(), simulation.stage.placed)
        if page is not None:
            page.show(snapshot, loop, self._deck.activation)

    @property
    def _ticks_a_picture(self) -> int:
        return max(1, round(self._settings.rate / PICTURE_HZ))


def tick_health(loop: LoopState) -> TickHealth:
    """The percentiles of a loop's ticks so far; they take too long for every tick."""
    if loop.tick == 0:
        return TickHealth()
    lateness = loop.lateness.percentiles()
    return TickHealth(lateness.p50, lateness.p999, loop.work.percentiles().p50)
