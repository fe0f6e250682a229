"""`motiondeck rig play`: a taught clip or a library on a rig alone, without a simulated robot beside it."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
import typer

from controller.cli.rig.rig_port import JsonOption, PortOption, RigArgument, load
from controller.deck.interfaces import JointLimits, Retargeter
from controller.rotations import Array
from controller.wire.command_socket import DEFAULT_PORT
from motiondeck_base.errors import MotiondeckError, UnknownNameError

if TYPE_CHECKING:
    from controller.cli.session.session import Playable
    from controller.library.motion_library import MotionLibrary
    from controller.mocap.clip import Clip
    from hardware.rig.rig_file import RigConfig

# What a joint may do whose acceleration the rig file leaves open, rad/s^2; the jerk brings it there in 20 ms.
_ACCELERATION = 80.0
_RISE = 0.02  # s


def play(
    rig: RigArgument,
    what: Annotated[
        str,
        typer.Argument(metavar="CLIP | LIBRARY", help="A taught clip, a library file, or a shipped library's name."),
    ],
    motion: Annotated[str | None, typer.Argument(help="Of a library: what to play first.")] = None,
    port: PortOption = None,
    robot: Annotated[
        str | None,
        typer.Option("--robot", help="For a library of human motions: whose joints the rig has; the rig's own name."),
    ] = None,
    seconds: Annotated[float | None, typer.Option("--seconds", help="Stop after so many seconds.")] = None,
    command_port: Annotated[
        int, typer.Option("--command-port", help="Where `motiondeck send` reaches it; 0 for any free one.")
    ] = DEFAULT_PORT,
    as_json: JsonOption = False,
) -> None:
    """Play a taught clip once, or a library for as long as you like, on a rig alone.

    Nothing is simulated and nothing is shown: the rig is all there is. The approach to the first pose is slow; every
    target keeps to the rig file's limits. A clip ends at its last frame, even if it is held back or stopped.

    `motiondeck send switch nod` (or pause, speed 0.5, home, estop) commands it.

    [bold]Examples[/]

      motiondeck rig play my-rig.toml wave.clip

      motiondeck rig play my-rig.toml gestures.safetensors wave

      motiondeck rig play servo20 thesis15 walk --seconds 20
    """
    from controller.cli.session.report import summary
    from controller.library.motion_library import load_library
    from controller.mocap.formats.reading import read_clip
    from motiondeck_base.shipped import find

    config = load(rig)
    if seconds is not None and not 0.0 < seconds < 1e8:
        raise MotiondeckError(f"--seconds {seconds:g} is not a length of time above 0")
    if Path(what).suffix == ".clip":
        if motion is not None:
            raise MotiondeckError(f"{what} is one clip, so there is no motion '{motion}' to choose")
        source: Clip | MotionLibrary = read_clip(what)
    else:
        source = load_library(find("library", what, ".safetensors"))
        if motion is not None and motion not in source.network.motions:
            raise UnknownNameError.among("motion", motion, source.network.motions)
    report = stream(config, port, source, motion, robot or Path(rig).stem, seconds, command_port)
    print(json.dumps(report) if as_json else summary(report))
    if any(output["parked"] for output in report["outputs"]):
        raise typer.Exit(1)


def stream(
    config: RigConfig,
    port: list[str] | None,
    source: Clip | MotionLibrary,
    motion: str | None,
    robot: str,
    seconds: float | None,
    command_port: int,
) -> dict[str, Any]:
    """Plays on a rig until the time is over or somebody stops it, and says how it went; see `play`."""
    from controller.cli.session.report import full_report
    from controller.cli.session.rig_output import RigOutput, close_saying
    from controller.deck.recorded_deck import RecordedDeck
    from controller.loop.clock import Ticker
    from controller.loop.command_desk import CommandDesk
    from controller.loop.loop import run
    from controller.loop.output_channel import Channel
    from controller.loop.safety_envelope import SafetyEnvelope
    from controller.loop.stop_requests import StopRequest, stop_on_signals
    from controller.wire.command_socket import CommandServer
    from hardware.rig.joined_rig import connect_rig

    with ExitStack() as opening:
        stop = opening.enter_context(stop_on_signals())
        server = CommandServer(command_port)
        opening.callback(server.close)
        cast = _cast(config, source, robot)
        connected = connect_rig(config, port or ())
        opening.callback(close_saying, connected)
        output = RigOutput(connected, cast.joints, config.rate_hz)
        opening.callback(output.close)
        retarget = cast.retarget(connected.positions)
        deck = _deck(source, motion, retarget)
        channel = Channel(output)
        desk = CommandDesk(deck, [server])

        def commands(stop: StopRequest) -> None:
            if isinstance(deck, RecordedDeck) and deck.over:
                stop.ask("played to the end")
            desk(stop)

        clock = Ticker(config.rate_hz)
        envelope = SafetyEnvelope(cast.limits, clock.period)
        report = run(
            deck,
            [channel],
            clock,
            envelope,
            seconds=seconds if seconds is not None else float("inf"),
            rest=_end(source, cast, retarget),
            commands=commands,
            stop=stop,
        )
        output.close()
        return full_report(report, cast.joints, deck.switches, []) | {"refused": [], "recues": deck.recues}


class _Cast(NamedTuple):
    """Whose joints are driven.

    Attributes:
        joints: their names.
        limits: what they may do.
        rest: where they end, shape (J,), rad, or None for where they stop or their clip does.
        retarget: makes what carries poses to them, from where they stand at present, (J,), rad.
    """

    joints: tuple[str, ...]
    limits: JointLimits
    rest: Array | None
    retarget: Callable[[Array], Retargeter]


def _cast(config: RigConfig, source: Clip | MotionLibrary, robot: str) -> _Cast:
    """The rig's own joints for what was taught, where the untaught ones stay; a robot's for human motions."""
    from controller.cli.session.rig_output import narrowed
    from controller.mocap.clip import Clip
    from controller.mocap.encodings.joint_angles import JointBody, JointRetargeter
    from motiondeck_base.shipped import find

    body = source.skeleton
    if isinstance(body, JointBody):
        names = config.names
        JointRetargeter(body, names, np.zeros(len(names)))  # what does not fit is said before anything is switched on
        return _Cast(names, _limits(config), None, lambda present: JointRetargeter(body, names, present))
    if isinstance(source, Clip):
        raise MotiondeckError(f"clip '{source.name}' shows a human body. Learn it first: motiondeck fit")
    from sim.robots.robot import load_robot

    loaded = load_robot(find("robot", robot, ".toml"), body)
    limits = narrowed(loaded.limits, loaded, config)
    return _Cast(loaded.joints, limits, loaded.rest, lambda _: loaded.retarget)


def _limits(config: RigConfig) -> JointLimits:
    """What the rig file lets its joints do."""
    joints = config.joints
    acceleration = np.array([joint.acceleration or _ACCELERATION for joint in joints])
    return JointLimits(
        np.array([joint.lower for joint in joints]),
        np.array([joint.upper for joint in joints]),
        np.array([joint.velocity for joint in joints]),
        acceleration,
        acceleration / _RISE,
    )


def _end(source: Clip | MotionLibrary, cast: _Cast, retarget: Retargeter) -> Array | None:
    """Where the joints go in the end, (J,), rad; a clip that limits have held back still comes to its last frame."""
    from controller.mocap.clip import Clip
    from controller.mocap.posture import Pose

    if not isinstance(source, Clip):
        return cast.rest
    last = retarget(Pose(source.root_position[-1], np.array(0.0), source.rotation[-1]))
    return np.clip(last, cast.limits.lower, cast.limits.upper)


def _deck(source: Clip | MotionLibrary, motion: str | None, retarget: Retargeter) -> Playable:
    """What plays: the clip as it was taught, or the library's network."""
    from controller.deck.deck import Deck
    from controller.deck.recorded_deck import RecordedDeck
    from controller.mocap.clip import Clip
    from controller.mocap.posture import Pose
    from controller.wire.run_recording import RunRecording

    if not isinstance(source, Clip):
        names = source.network.motions
        return Deck(source, retarget, motion or ("walk" if "walk" in names else names[0]))
    count, still = len(source), np.array(0.0)
    poses = zip(source.root_position, source.rotation, strict=True)
    fields = {
        "targets": np.array([retarget(Pose(at, still, rotation)).copy() for at, rotation in poses]),
        "motion": np.zeros((count, 1)),
        "root_position": source.root_position,
        "heading": np.zeros((count, 1)),
        "root_rotation": source.rotation[:, 0],
    }
    return RecordedDeck(RunRecording({"motions": [source.name], "rate": source.rate}, fields, complete=True))
