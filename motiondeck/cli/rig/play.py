"""`motiondeck rig play`: a taught clip or a library on a rig, without a simulated robot."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig.rig_port import PortOption, RigArgument, load
from motiondeck.cli.run_options import with_run_options
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.library.motion_library import MotionLibrary
    from controller.motion.clip import Clip
    from hardware.rig.rig_file import RigConfig
    from motiondeck.run.assembly import Host


@with_run_options("seconds", "command_port")
def play(
    rig: RigArgument,
    what: Annotated[
        str, Argument(metavar="CLIP | LIBRARY", help="A taught clip, a library file, or a shipped library's name.")
    ],
    motion: Annotated[
        str | None, Argument(metavar="MOTION", help="The motion to play first, if a library is played.")
    ] = None,
    port: PortOption = None,
    *,
    spec: RunSpec,
    robot: Annotated[
        str | None,
        Option(metavar="ROBOT", help="For human motions: the robot whose joints the rig has; default: the rig's name."),
    ] = None,
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
    from motiondeck.run.assembly import Host
    from motiondeck.run.report import summary
    from motiondeck.run.spec.program import checked_rate, first_motion
    from motiondeck_base.shipped import find_library

    config = load(rig)
    spec = replace(spec, rate=config.rate_hz)
    spec.check()
    host = Host(progress=not as_json)
    if Path(what).suffix == ".clip":
        if motion is not None:
            raise MotiondeckError(f"{what} is one clip, so there is no motion '{motion}' to choose")
        report = play_clip(config, port or [], read_clip(what), spec, host)
    else:
        library = load_library(find_library(what))
        first = first_motion(library, motion)
        checked_rate(library, first, config.rate_hz)
        report = play_library(config, port or [], library, first, robot or Path(rig).stem, spec, host)
    print(json.dumps(report) if as_json else summary(report))
    if any(output["parked"] for output in report["outputs"]):
        raise typer.Exit(1)


def play_clip(
    config: RigConfig, ports: list[str], clip: Clip, spec: RunSpec, host: Host | None = None
) -> dict[str, Any]:
    """Plays a taught clip once on a rig, and returns the report of the run."""
    from motiondeck.run.assembly import Host, Played, open_session
    from motiondeck.run.robots.rig_on_deck import open_rig_alone, recorded_deck

    played = Played(
        clip,
        lambda opening: [open_rig_alone(opening, config, ports, clip, "")],
        lambda retarget: recorded_deck(clip, retarget),
    )
    with open_session(spec, played, host or Host()) as session:
        return session.run()


def play_library(
    config: RigConfig, ports: list[str], library: MotionLibrary, first: str, robot: str, spec: RunSpec, host: Host
) -> dict[str, Any]:
    """Plays a library on a rig for some time or until it is stopped, and returns the report of the run."""
    from controller.deck.deck import Deck
    from motiondeck.run.assembly import Played, open_session
    from motiondeck.run.robots.rig_on_deck import open_rig_alone

    played = Played(
        library,
        lambda opening: [open_rig_alone(opening, config, ports, library, robot)],
        lambda retarget: Deck(library, retarget, first),
    )
    with open_session(spec, played, host) as session:
        return session.run()
