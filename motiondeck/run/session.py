"""One run: its parts, the loop that drives them, and the report."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.deck.interfaces import Retargeter
from controller.deck.recorded_deck import RecordedDeck
from controller.library.motion_library import MotionLibrary
from controller.loop import permissions
from controller.loop.clock import Clock
from controller.loop.commands.command_handler import CommandHandler
from controller.loop.commands.interfaces import PlayableDeck
from controller.loop.commands.snapshots import SnapshotSource
from controller.loop.correction import Correction
from controller.loop.lead import Lead
from controller.loop.loop import LoopState, run
from controller.loop.output_channel import Channel
from controller.loop.safety.compiled_envelope import unfit
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import StopRequest
from controller.loop.stop_state import WiredStop
from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.wire.messages.replies import Refused
from motiondeck.run.beside.child_process import Children, PageProcess
from motiondeck.run.report import RunNews, progress_line, run_report
from motiondeck.run.robots.robot_on_deck import RobotOnDeck
from motiondeck.run.spec.program import Timed
from motiondeck.run.spec.run_spec import RunSpec
from sim.robots.verdict import RobotVerdict

if TYPE_CHECKING:  # page, recorder and recognition are imported by a run that has them
    from motiondeck.run.beside.tick_recorder import TickRecorder
    from motiondeck.run.page.page import Page
    from motiondeck.run.recognition.watches import Watch


PICTURE_HZ = 50.0
HEALTH_EVERY = 12  # pictures


def watch_wire(wired: WiredStop, handler: CommandHandler) -> Callable[[StopRequest], None]:
    """What passes on what a wired stop has done since the last call, and reports each pull."""
    before = 0

    def poll(stop: StopRequest) -> None:
        nonlocal before
        stop.state.watch(wired)
        if wired.pulls != before:
            before = wired.pulls
            handler.notify("fault", f"the emergency stop at {wired.name} was pulled")
            print(f"motiondeck: the emergency stop at {wired.name} was pulled", file=sys.stderr)

    return poll


@dataclass(frozen=True)
class Host:
    """The process that a run is in."""

    page: PageProcess | None = None
    terminal: bool = False
    progress: bool = False
    restarts: bool = False  # whether the run is started again when another library is asked for
    clock: Clock | None = None


ALONE = Host()


@dataclass(frozen=True)
class Played:
    """What a run plays."""

    source: MotionLibrary | Clip  # a session needs its name and its skeleton, recognition its motions
    # Opens the robots, at least one; the stack that it gets closes them.
    open_robots: Callable[[ExitStack], list[RobotOnDeck]]
    make_deck: Callable[[Retargeter], PlayableDeck]  # makes the deck for the robots' retargeting
    timeline: Sequence[Timed] = ()  # what is commanded when, in order
    file: Path | None = None  # of the library that is asked for, if it is one
    network_file: Path | None = None  # of the source: that, or what was baked of it
    verdicts: Mapping[str, RobotVerdict] = field(default_factory=dict[str, RobotVerdict])  # by motion, those kept

    @property
    def name(self) -> str:
        """The name of the source."""
        return self.source.info.name if isinstance(self.source, MotionLibrary) else self.source.name


@dataclass
class Session:
    """The open parts of a run; `assembly.open_session` makes it."""

    spec: RunSpec
    played: Played
    host: Host
    stop: StopRequest
    robots: list[RobotOnDeck]
    deck: PlayableDeck
    channels: list[Channel]
    clock: Clock
    envelope: SafetyEnvelope
    snapshots: SnapshotSource
    handler: CommandHandler
    news: RunNews
    # Returns the measured joint positions of the first robot, rad, as far as they are known.
    measured: Callable[[], Array | None]
    children: Children
    command_port: int
    page_port: int | None = None  # where the page is; None for no page
    # What passes on the presses of each source of the emergency stop; with a rig its guard counts them.
    stops: Sequence[Callable[[StopRequest], None]] = ()
    page: Page | None = None  # None, as of the next ones, where the run has none
    recorder: TickRecorder | None = None
    watch: Watch | None = None
    lead: Lead | None = None
    correction: Correction | None = None

    def __post_init__(self) -> None:
        self._timeline = deque(self.played.timeline)  # what is still to be commanded
        self._first = self.robots[0]
        self._ticks_a_picture = max(1, round(self.spec.rate / PICTURE_HZ))
        self._refused: list[dict[str, object]] = []

    def run(self) -> dict[str, Any]:
        """Plays until the time is over or the run is stopped; the report."""
        spec, first = self.spec, self.deck.motion
        rests = [robot.rest for robot in self.robots if robot.rest is not None]
        with permissions.handed_back(), ExitStack() as shown:
            asked = self._request_permissions()
            if self.host.progress:
                shown.enter_context(progress_line(self.deck, self.stop, spec.seconds, prompt=self.host.terminal))
            report = run(
                self.deck,
                self.channels,
                self.clock,
                self.envelope,
                seconds=spec.seconds if spec.seconds is not None else float("inf"),
                rest=np.concatenate(rests) if len(rests) == len(self.robots) else None,
                commands=self._carry_out_commands,
                stops=self.stops,
                publish=self._publish,
                publish_every=1 if self.recorder or self.watch else self._ticks_a_picture,
                stop=self.stop,
                lead=self.lead,
                correction=self.correction,
            )
        self.handler.notify("ended", report.reason)
        # The joints first: what else is closed may take its time.
        for channel in self.channels:
            channel.output.close()
        if self.page:
            self.page.end(self.stop.reason)
        recorded = {"recording": self.recorder.finish()} if self.recorder else {}
        names = [name for robot in self.robots for name in robot.joints]
        full = run_report(report, names, self.deck.switches, asked)
        full |= {"refused": self._refused, "restarts": self.deck.restarts}
        switched_to = dict.fromkeys(name for switch in full["switches"] for name in (*switch["via"], switch["to"]))
        verdicts = self.played.verdicts
        full["verdicts"] = [verdicts[name].row() for name in {first: None, **switched_to} if name in verdicts]
        full |= {"library": self.played.name, "robot": self._first.name} | recorded
        guards = {robot.prefix: robot.guard for robot in self.robots if robot.guard is not None}
        counts = {prefix + pair: count for prefix, guard in guards.items() for pair, count in guard.kept_apart.items()}
        full |= {"kept_apart": counts} if guards else {}
        return full | ({"recognition": self.watch.report()} if self.watch else {})

    def _request_permissions(self) -> list[permissions.Permission]:
        asked = [permissions.request_core(self.spec.core)] if self.spec.core is not None else []
        if self.spec.realtime or self.spec.drives_servos:
            # The guard of a rig goes before the deck.
            priority = permissions.FIFO_PRIORITY - any(robot.rig is not None for robot in self.robots)
            asked += [*permissions.request_realtime(priority), permissions.request_one_blas_thread()]
        for line in (*permissions.permission_lines(asked), *unfit()):
            print(line, file=sys.stderr)
        return asked

    def _carry_out_commands(self, stop: StopRequest) -> None:
        while self._timeline and self._timeline[0].at <= self.deck.time:
            timed = self._timeline.popleft()
            reply = self.handler.carry_out(timed.message, stop)
            if isinstance(reply, Refused):
                self._refused.append({"at": timed.at, "reason": reply.reason})
        if isinstance(self.deck, RecordedDeck) and self.deck.over:
            stop.ask("played to the end")
        for robot in self.robots:
            if robot.rig is not None and robot.rig.parked:
                stop.ask(f"the rig is lost: {robot.rig.fault}")
        self.handler(stop)
        self.news.update()

    def _publish(self, loop: LoopState) -> None:
        """Hands the tick to the watch, to the recorder and, now and then, to the page."""
        snapshots = self.snapshots
        snapshots.loop = loop
        if self.watch is not None:
            self.watch.update(loop, self.deck, self.stop)
        pictures, between = divmod(loop.tick, self._ticks_a_picture)
        if between == 0 and pictures % HEALTH_EVERY == 0:
            snapshots.health = None
            self.children.report_dead()
        page = self.page if between == 0 else None
        if self.recorder is None and page is None:
            return
        snapshot = snapshots.take(self.stop)
        if self.recorder is not None:
            self.recorder.record(snapshot, loop, self.measured(), self._first.simulation.stage.placed)
        if page is not None:
            page.show(snapshot, loop, self.deck.activation)
