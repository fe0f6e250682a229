"""One run of `motiondeck play`: everything is opened, the loop runs, everything is closed in the reverse order."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np

from controller.cli.child import child_process, kept_tty
from controller.cli.record import TickRecorder, recording
from controller.cli.script import Timed
from controller.errors import MotiondeckError
from controller.realtime.channel import Channel
from controller.realtime.clock import Clock, Ticker
from controller.realtime.command_desk import Commandable, CommandDesk
from controller.realtime.commands import CommandServer, Refused
from controller.realtime.course import Player
from controller.realtime.deck import Switch
from controller.realtime.interfaces import JointLimits, Retargeter
from controller.realtime.loop import LoopReport, LoopState, run
from controller.realtime.permissions import handed_back, request_core, request_realtime
from controller.realtime.recorded_deck import RecordedDeck
from controller.realtime.recording import MODES
from controller.realtime.safety import SafetyEnvelope
from controller.realtime.stop import StopRequest
from controller.realtime.telemetry import StateWriter
from controller.training.library import MotionLibrary

if TYPE_CHECKING:
    from hardware.rig import RigConfig
    from sim.robot import Robot

PICTURE_HZ = 50.0
HEALTH_EVERY = 12

# What the page is told, besides the position of the robot: each field is one number.
_NUMBERS = (
    "tick",
    "time_s",
    "motion",
    "speed",
    "paused",
    "mode",
    "rate_hz",
    "lateness_p50_us",
    "lateness_p999_us",
    "overruns",
    "recues",
    "work_p50_us",
)


@dataclass(frozen=True)
class Settings:
    """What a run is made of.

    Attributes:
        robot: the robot file.
        rig: the rig file, or None.
        emulated: whether the rig's servos are emulated.
        rate: ticks a second.
        physics: whether the robot moves by servos and masses or exactly as it is told.
        realtime: whether to ask for real-time scheduling.
        command_port: where commands come in; 0 for a free port.
        page_port: where the page is, 0 for a free port, None for no page.
        terminal: whether there is a prompt.
        seconds: how long to play, or None for as long as nobody stops it.
        record: where every tick is recorded, if anywhere.
        core: the core that the loop is to run on, if it matters.
    """

    robot: Path
    rig: Path | None
    emulated: bool
    rate: float
    physics: bool
    realtime: bool
    command_port: int
    page_port: int | None
    terminal: bool
    seconds: float | None
    record: Path | None = None
    core: int | None = None


class Playable(Player, Commandable, Protocol):
    """A deck as a session needs it."""

    time: float
    commanded_speed: float

    @property
    def playing(self) -> str:
        """What is played now, perhaps on the way to another motion."""
        ...

    @property
    def switches(self) -> Sequence[Switch]:
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
        self._clock = clock or Ticker(settings.rate)
        self._waiting = list(timeline)
        self._refused: list[dict[str, object]] = []
        self._rig: Channel | None = None
        self._restore_tty: Callable[[], None] = lambda: None
        self._beside: list[tuple[str, subprocess.Popen[bytes]]] = []
        self._stop = StopRequest()  # the loop's own takes its place with the first tick
        self._open = ExitStack()

    def __enter__(self) -> Session:
        with ExitStack() as opening:
            self._prepare(opening)
            self._open = opening.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._open.close()

    def _prepare(self, opening: ExitStack) -> None:
        from sim.playback import KinematicPlayback, PhysicsPlayback
        from sim.robot import load_robot

        settings = self._settings
        self._server = CommandServer(settings.command_port)
        opening.callback(self._server.close)
        # The view takes longest to start, so it starts first and waits for the rest.
        view: Path | None = None
        if settings.page_port is not None:
            view, viewer = opening.enter_context(_viewer(self._server.port, settings.page_port))
            self._beside.append(("the page", viewer))
        self._robot = load_robot(settings.robot, self._library.skeleton)
        self._deck = self._make_deck(self._robot.retarget)
        self._stage = (
            PhysicsPlayback(self._robot, self._clock.period) if settings.physics else KinematicPlayback(self._robot)
        )
        self._channels = [Channel(self._stage)]
        limits = self._robot.limits
        if settings.rig is not None:
            # The rig comes first: the approach to the first pose starts from where its joints are.
            self._rig, limits = _open_rig(opening, settings, self._robot, limits)
            self._channels.insert(0, self._rig)
        for channel in self._channels:
            opening.callback(channel.output.close)
        self._envelope = SafetyEnvelope(limits, self._clock.period)
        self._page = opening.enter_context(_shown(view, self._deck.motions, self._robot)) if view else None
        self._recorder = self._open_recorder(opening) if settings.record else None
        self._desk = CommandDesk(self._deck, self._server, self._recorder.note if self._recorder else None)
        if settings.terminal:
            self._restore_tty = opening.enter_context(kept_tty())
            terminal = child_process("controller.cli.terminal", "--command-port", str(self._server.port))
            self._beside.append(("the prompt", opening.enter_context(terminal)))

    def run(self) -> dict[str, Any]:
        """Plays until the time is over or somebody stops it, and says how it went."""
        settings = self._settings
        with handed_back():
            permissions = [request_core(settings.core)] if settings.core is not None else []
            permissions += request_realtime() if settings.realtime else []
            for permission in permissions:
                print(permission, file=sys.stderr)
            report = run(
                self._deck,
                self._channels,
                self._clock,
                self._envelope,
                seconds=settings.seconds if settings.seconds is not None else float("inf"),
                rest=self._robot.rest,
                commands=self._commands,
                publish=self._publish if self._page or self._recorder else None,
                publish_every=1 if self._recorder else self._ticks_a_picture,
            )
        # The joints first: what else is closed may take its time.
        for channel in self._channels:
            channel.output.close()
        if self._page:
            self._page.close()
        return self._report(report)

    def _commands(self, stop: StopRequest) -> None:
        """What comes in over the socket, and the timeline's commands when their time has come."""
        self._stop = stop
        while self._waiting and self._waiting[0].at <= self._deck.time:
            timed = self._waiting.pop(0)
            reply, _ = self._desk.carry_out(timed.message, stop)
            if isinstance(reply, Refused):
                self._refused.append({"at": timed.at, "reason": reply.reason})
        if isinstance(self._deck, RecordedDeck) and self._deck.over:
            stop.ask("replayed to the end")
        if self._rig is not None and self._rig.parked:
            stop.ask(f"the rig is lost: {self._rig.fault}")
        self._desk(stop)

    def _look_beside(self) -> None:
        """Says so when the page or the prompt has died: the deck plays on without them."""
        for name, process in [*self._beside]:
            if process.poll() is not None:
                self._beside.remove((name, process))
                if process.returncode != 0:
                    self._restore_tty()
                    print(f"motiondeck: {name} has ended; the deck plays on", file=sys.stderr)

    def _publish(self, state: LoopState) -> None:
        """Hands the state to the recorder and, now and then, to the page."""
        if self._recorder is not None:
            deck = self._deck
            self._recorder.record(
                state,
                self._stop,
                self._channels[0].measured,
                time_s=deck.time,
                motion=deck.motions.index(deck.playing),
                speed=deck.speed,
                switching=not deck.settled,
            )
        if self._page is not None and state.tick % self._ticks_a_picture == 0:
            self._show(state, self._page)
        if state.tick // self._ticks_a_picture % HEALTH_EVERY == 0:
            self._look_beside()

    def _show(self, state: LoopState, page: StateWriter) -> None:
        fields, deck = page.fields, self._deck
        fields["qpos"][:] = self._stage.qpos
        fields["root_xy"][:] = self._stage.qpos[:2]
        fields["tick"][0] = state.tick
        fields["time_s"][0] = deck.time
        fields["motion"][0] = deck.motions.index(deck.motion)
        fields["speed"][0] = deck.commanded_speed
        fields["paused"][0] = deck.paused
        fields["mode"][0] = MODES.index(self._stop.mode)
        fields["rate_hz"][0] = state.rate
        fields["overruns"][0] = state.overruns
        fields["recues"][0] = deck.recues
        if state.tick // self._ticks_a_picture % HEALTH_EVERY == 0:
            lateness = state.lateness.percentiles()
            fields["lateness_p50_us"][0] = lateness.p50
            fields["lateness_p999_us"][0] = lateness.p999
            fields["work_p50_us"][0] = state.work.percentiles().p50
        page.publish()

    def _open_recorder(self, opening: ExitStack) -> TickRecorder:
        settings = self._settings
        assert settings.record is not None
        description = {
            "library": self._library.info.name,
            "robot": self._robot.name,
            "joints": list(self._robot.joints),
            "motions": list(self._deck.motions),
            "rate": settings.rate,
        }
        return opening.enter_context(recording(settings.record, description, len(self._robot.joints), settings.rate))

    @property
    def _ticks_a_picture(self) -> int:
        return max(1, round(self._settings.rate / PICTURE_HZ))

    def _report(self, report: LoopReport) -> dict[str, object]:
        """What `--json` prints."""
        said: dict[str, Any] = msgspec.to_builtins(report)
        changed = said.pop("changed")
        said["limited"] = {joint: count for joint, count in zip(self._robot.joints, changed, strict=True) if count}
        said["switches"] = [
            {
                "to": switch.to,
                "commanded_s": switch.commanded_s,
                "first_change_s": switch.first_change_s,
                "settled_s": switch.settled_s,
                "after": switch.after,
                "via": list(switch.via),
            }
            for switch in self._deck.switches
        ]
        said["refused"] = self._refused
        said["recues"] = self._deck.recues
        said["library"], said["robot"] = self._library.info.name, self._robot.name
        if self._settings.rig is not None:
            said["rig"] = next(output for output in said["outputs"] if output["name"] == "rig")
        return said


def summary(report: dict[str, Any]) -> str:
    """A report in a few lines."""
    late, work = report["lateness_us"], report["work_us"]
    lines = [
        f"{report['reason']}: {report['ticks']} ticks at {report['rate_hz']:.2f} Hz, "
        f"{report['overruns']} overruns, {report['skipped']} ticks skipped",
        f"lateness p50 {late['p50']:.0f} us, p99.9 {late['p999']:.0f} us; work p50 {work['p50']:.0f} us",
    ]
    if report["switches"]:
        times = [s["settled_s"] - s["commanded_s"] for s in report["switches"] if s["settled_s"] is not None]
        settled = f", settled after {np.median(times):.2f} s (median)" if times else ""
        lines.append(f"{len(report['switches'])} switches{settled}")
    lines += [f"went to {s['to']} by way of {', '.join(s['via'])}" for s in report["switches"] if s["via"]]
    if report["recues"]:
        lines.append(f"the network was lost and started again {report['recues']} times")
    lines += [f"at {refused['at']:g} s refused: {refused['reason']}" for refused in report["refused"]]
    if "rig" in report:
        rig = report["rig"]
        error = rig["tracking_rmse_rad"]
        lines.append(
            f"rig: {rig['joints']} joints at {rig['hz']:g} Hz, {rig['faults']} faults"
            + (f", tracking error {np.degrees(error):.2f} deg (rms)" if error is not None else "")
        )
    lines += [f"output {o['name']} was parked: {o['fault']}" for o in report["outputs"] if o["parked"]]
    return "\n".join(lines)


def _open_rig(opening: ExitStack, settings: Settings, robot: Robot, limits: JointLimits) -> tuple[Channel, JointLimits]:
    """The rig as an output, and the robot's limits narrowed to the rig's."""
    from controller.cli.rig_output import RigOutput
    from hardware.emulator.process import start_emulator
    from hardware.rig import load_rig
    from hardware.supervised_rig import SupervisedRig

    assert settings.rig is not None
    config = load_rig(settings.rig)
    every = settings.rate / config.rate_hz
    if every < 1.0 or abs(every - round(every)) > 1e-6:
        raise MotiondeckError(
            f"{settings.rig}: rate_hz = {config.rate_hz:g} does not divide the loop's {settings.rate:g} Hz; "
            "give another --rate"
        )
    port = opening.enter_context(start_emulator(settings.rig)).port if settings.emulated else None
    limits = _narrowed(limits, robot, config)
    rig = SupervisedRig.connect(config, port)
    opening.callback(rig.close)
    output = RigOutput(rig, robot.joints, config.rate_hz)
    return Channel(output, round(every)), limits


def _narrowed(limits: JointLimits, robot: Robot, config: RigConfig) -> JointLimits:
    """The limits that robot and rig both allow, so that the servos are never told to go where they would be clipped."""
    lower, upper, velocity = limits.lower.copy(), limits.upper.copy(), limits.velocity.copy()
    for joint in config.joints:
        if joint.name in robot.joints:
            index = robot.joints.index(joint.name)
            lower[index], upper[index] = max(lower[index], joint.lower), min(upper[index], joint.upper)
            velocity[index] = min(velocity[index], joint.velocity)
    outside = (robot.rest < lower) | (robot.rest > upper)
    if outside.any():
        index = int(np.argmax(outside))
        raise MotiondeckError(
            f"the rest pose of {robot.name} has {robot.joints[index]} at {robot.rest[index]:.2f} rad, "
            f"but with this rig it may go from {lower[index]:.2f} to {upper[index]:.2f} rad only"
        )
    return replace(limits, lower=lower, upper=upper, velocity=velocity)


@contextmanager
def _viewer(command_port: int, port: int) -> Iterator[tuple[Path, subprocess.Popen[bytes]]]:
    """The browser view, a process of its own; yields the state file that it waits for, and the process."""
    port = _free_port(port)
    folder = Path(tempfile.mkdtemp(prefix="motiondeck-"))
    try:
        state = folder / "state"
        arguments = ("--state", str(state), "--command-port", str(command_port), "--port", str(port))
        with child_process("sim.viewer", *arguments, own_session=True) as viewer:
            print(f"page: http://127.0.0.1:{port}", file=sys.stderr, flush=True)
            yield state, viewer
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _shown(state: Path, motions: Sequence[str], robot: Robot) -> Iterator[StateWriter]:
    """The shared state that the view reads, and the model that it draws."""
    model = state.with_name("robot.xml")
    robot.spec.to_file(str(model))
    writer = StateWriter.create(
        state,
        {"model_file": str(model), "motions": list(motions), "robot": robot.name},
        {"qpos": robot.model.nq, "root_xy": 2} | dict.fromkeys(_NUMBERS, 1),
    )
    try:
        yield writer
    finally:
        writer.close()


def _free_port(port: int) -> int:
    """The port itself if nobody has it, or any free one for 0."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            raise MotiondeckError(
                f"port {port} for the page cannot be used ({getattr(error, 'strerror', None) or error}). "
                "Give another one with --port, or --port 0 for any that is free."
            ) from None
        return int(probe.getsockname()[1])
