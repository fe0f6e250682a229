"""`motiondeck rig play`: a taught clip or a library on a rig, without a simulated robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from controller.wire.command_socket import DEFAULT_PORT
from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig.rig_port import PortOption, RigArgument, load
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.library.motion_library import MotionLibrary
    from controller.motion.clip import Clip
    from hardware.rig.rig_file import RigConfig
    from motiondeck.run.run_settings import RunSettings


def play(
    rig: RigArgument,
    what: Annotated[
        str,
        typer.Argument(metavar="CLIP | LIBRARY", help="A taught clip, a library file, or a shipped library's name."),
    ],
    motion: Annotated[
        str | None, typer.Argument(metavar="MOTION", help="The motion to play first, if a library is played.")
    ] = None,
    port: PortOption = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="ROBOT",
            help="For human motions: the robot whose joints the rig has; default: the rig's name.",
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", metavar="SECONDS", help="Stop after this many seconds.")
    ] = None,
    command_port: Annotated[
        int,
        typer.Option("--command-port", metavar="PORT", help="Where `motiondeck send` reaches it; 0 for any free one."),
    ] = DEFAULT_PORT,
    as_json: JsonOption = False,
) -> None:
    """Play a taught clip or a library on a rig alone.

    A clip is played once, a library until Ctrl-C, without simulated robot and page. The approach to the first pose is
    slow; every target keeps to the rig file's limits. A clip ends at its last frame, even if limits have held it back.

    `motiondeck send switch nod` (or pause, tempo 0.5, home, estop) commands it.

    [bold]Examples[/]

      motiondeck rig play my-rig.toml wave.clip
      motiondeck rig play my-rig.toml gestures.safetensors wave
      motiondeck rig play servo20 thesis15 walk --seconds 20
    """
    from controller.library.motion_library import load_library
    from controller.motion.formats.reading import read_clip
    from motiondeck.run.report import summary
    from motiondeck.run.run_settings import RunSettings
    from motiondeck.run.setup import check_seconds, checked_rate, first_motion
    from motiondeck_base.shipped import find_library

    config = load(rig)
    check_seconds(seconds)
    settings = RunSettings(rate=config.rate_hz, command_port=command_port, seconds=seconds, progress=not as_json)
    if Path(what).suffix == ".clip":
        if motion is not None:
            raise MotiondeckError(f"{what} is one clip, so there is no motion '{motion}' to choose")
        report = play_clip(config, port or [], read_clip(what), settings)
    else:
        library = load_library(find_library(what))
        first = first_motion(library, motion)
        checked_rate(library, first, config.rate_hz)
        report = play_library(config, port or [], library, first, robot or Path(rig).stem, settings)
    print(json.dumps(report) if as_json else summary(report))
    if any(output["parked"] for output in report["outputs"]):
        raise typer.Exit(1)


def play_clip(config: RigConfig, ports: list[str], clip: Clip, settings: RunSettings) -> dict[str, Any]:
    """Plays a taught clip once on a rig, and returns the report of the run."""
    from motiondeck.run.robots.rig_on_deck import open_rig_alone, recorded_deck
    from motiondeck.run.session import Session

    with Session(
        clip,
        lambda opening: [open_rig_alone(opening, config, ports, clip, "")],
        lambda retarget: recorded_deck(clip, retarget),
        settings,
    ) as session:
        return session.run()


def play_library(
    config: RigConfig, ports: list[str], library: MotionLibrary, first: str, robot: str, settings: RunSettings
) -> dict[str, Any]:
    """Plays a library on a rig for some time or until it is stopped, and returns the report of the run."""
    from controller.deck.deck import Deck
    from motiondeck.run.robots.rig_on_deck import open_rig_alone
    from motiondeck.run.session import Session

    with Session(
        library,
        lambda opening: [open_rig_alone(opening, config, ports, library, robot)],
        lambda retarget: Deck(library, retarget, first),
        settings,
    ) as session:
        return session.run()
