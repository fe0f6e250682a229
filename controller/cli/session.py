"""One run of `motiondeck play`: everything is opened, the loop runs, everything is closed in the reverse order."""

from __future__ import annotations

import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from controller.cli.script import Cue
from controller.errors import MotiondeckError
from controller.realtime.channel import Channel
from controller.realtime.clock import Ticker
from controller.realtime.command_desk import CommandDesk
from controller.realtime.commands import CommandServer
from controller.realtime.deck import Deck
from controller.realtime.interfaces import JointLimits
from controller.realtime.loop import LoopReport, LoopState, run
from controller.realtime.permissions import request_realtime
from controller.realtime.safety import SafetyEnvelope
from controller.realtime.stop import StopRequest
from controller.realtime.telemetry import StateWriter
from controller.training.library import MotionLibrary

if TYPE_CHECKING:
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
    "rate_hz",
    "lateness_p50_us",
    "lateness_p999_us",
    "overruns",
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


class Session:
    """Opens all that a run needs; use it as a context manager.

    Args:
        library: what is played.
        cues: what is played when; the first one at once.
        settings: the rest.
    """

    def __init__(self, library: MotionLibrary, cues: list[Cue], settings: Settings) -> None:
        self._library, self._cues, self._settings = library, cues, settings
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
        self._clock = Ticker(settings.rate)
        self._robot = load_robot(settings.robot, self._library.skeleton)
        self._deck = Deck(self._library, self._robot.retarget, self._cues[0].motion)
        self._server = CommandServer(settings.command_port)
        opening.callback(self._server.close)
        self._desk = CommandDesk(self._deck, self._server)
        self._stage = (
            PhysicsPlayback(self._robot, self._clock.period) if settings.physics else KinematicPlayback(self._robot)
        )
        self._channels = [Channel(self._stage)]
        limits = self._robot.limits
        if settings.rig is not None:
            # The rig comes first: the approach to the first pose starts from where its joints are.
            rig, limits = _open_rig(opening, settings, self._robot, limits)
            self._channels.insert(0, rig)
        for channel in self._channels:
            opening.callback(channel.output.close)
        self._envelope = SafetyEnvelope(limits, self._clock.period)
        self._page = (
            opening.enter_context(_page(self._library, self._robot, self._server.port, settings.page_port))
            if settings.page_port is not None
            else None
        )
        self._waiting = list(self._cues[1:])
        if settings.terminal:
            opening.enter_context(_child("controller.cli.terminal", "--command-port", str(self._server.port)))

    def run(self) -> dict[str, object]:
        """Plays until the time is over or somebody stops it, and says how it went."""
        settings = self._settings
        if settings.realtime:
            for permission in request_realtime():
                print(permission, file=sys.stderr)
        report = run(
            self._deck,
            self._channels,
            self._clock,
            self._envelope,
            seconds=settings.seconds if settings.seconds is not None else float("inf"),
            rest=self._robot.rest,
            commands=self._commands,
            publish=self._publish if self._page else None,
            publish_every=max(1, round(settings.rate / PICTURE_HZ)),
        )
        if self._page:
            self._page.close()
        return self._report(report)

    def _commands(self, stop: StopRequest) -> None:
        """What comes in over the socket, and the script's cues when their time has come."""
        while self._waiting and self._waiting[0].at <= self._deck.time:
            self._deck.switch(self._waiting.pop(0).motion)
        self._desk(stop)

    def _publish(self, state: LoopState) -> None:
        """Shows the page the latest state."""
        if self._page is None:
            return
        fields, deck = self._page.fields, self._deck
        fields["qpos"][:] = self._stage.qpos
        fields["root_xy"][:] = self._stage.qpos[:2]
        fields["tick"][0] = state.tick
        fields["time_s"][0] = deck.time
        fields["motion"][0] = deck.motions.index(deck.motion)
        fields["speed"][0] = deck.speed
        fields["paused"][0] = deck.paused
        fields["rate_hz"][0] = state.rate
        fields["overruns"][0] = state.overruns
        if state.tick // self._clock_ticks_a_picture % HEALTH_EVERY == 0:
            lateness = state.lateness.percentiles()
            fields["lateness_p50_us"][0] = lateness.p50
            fields["lateness_p999_us"][0] = lateness.p999
            fields["work_p50_us"][0] = state.work.percentiles().p50
        self._page.publish()

    @property
    def _clock_ticks_a_picture(self) -> int:
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
            }
            for switch in self._deck.switches
        ]
        said["library"], said["robot"] = self._library.info.name, self._robot.name
        if self._settings.rig is not None:
            said["rig"] = next(output for output in said["outputs"] if output["name"] == "rig")
        return said


def summary(report: dict[str, Any]) -> str:
    """A report in a few lines."""
    late, work = report["lateness_us"], report["work_us"]
    lines = [
        f"{report['reason']}: {report['ticks']} ticks at {report['rate_hz']:.2f} Hz, {report['overruns']} overruns",
        f"lateness p50 {late['p50']:.0f} us, p99.9 {late['p999']:.0f} us; work p50 {work['p50']:.0f} us",
    ]
    if report["switches"]:
        times = [s["settled_s"] - s["commanded_s"] for s in report["switches"] if s["settled_s"] is not None]
        settled = f", settled after {np.median(times):.2f} s (median)" if times else ""
        lines.append(f"{len(report['switches'])} switches{settled}")
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
    from hardware.dynamixel_rig import DynamixelRig
    from hardware.emulator.process import start_emulator
    from hardware.rig import load_rig

    assert settings.rig is not None
    config = load_rig(settings.rig)
    every = settings.rate / config.rate_hz
    if every < 1.0 or abs(every - round(every)) > 1e-6:
        raise MotiondeckError(
            f"{settings.rig}: rate_hz = {config.rate_hz:g} does not divide the loop's {settings.rate:g} Hz; "
            "give another --rate"
        )
    port = opening.enter_context(start_emulator(settings.rig)).port if settings.emulated else None
    rig = DynamixelRig.connect(config, port)
    opening.callback(rig.close)
    output = RigOutput(rig, robot.joints, config.rate_hz)
    return Channel(output, round(every)), limits


@contextmanager
def _page(library: MotionLibrary, robot: Robot, command_port: int, port: int) -> Iterator[StateWriter]:
    """The browser view, a process of its own, and the shared state that it reads."""
    port = _free_port(port)
    with tempfile.TemporaryDirectory(prefix="motiondeck-") as folder:
        model = Path(folder) / "robot.xml"
        robot.spec.to_file(str(model))
        writer = StateWriter.create(
            Path(folder) / "state",
            {"model_file": str(model), "motions": list(library.network.motions), "robot": robot.name},
            {"qpos": robot.model.nq, "root_xy": 2} | dict.fromkeys(_NUMBERS, 1),
        )
        arguments = ("--state", str(Path(folder) / "state"), "--command-port", str(command_port), "--port", str(port))
        with _child("sim.viewer", *arguments):
            print(f"page: http://127.0.0.1:{port}", file=sys.stderr, flush=True)
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


@contextmanager
def _child(module: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of this program that ends with the block."""
    child = subprocess.Popen([sys.executable, "-m", module, *arguments])
    try:
        yield child
    finally:
        try:
            child.wait(2.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
