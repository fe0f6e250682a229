"""`motiondeck replay`: plays a recorded run again, on the simulated robot or on servos."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from controller.wire.command_socket import DEFAULT_PORT
from motiondeck.cli.common.options import PAGE_PORT, PagePortOption


def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording made with `play --record FILE`.")],
    library: Annotated[
        str | None,
        typer.Option("--library", metavar="LIBRARY", help="The library that was played; default: found by its name."),
    ] = None,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="The robot that played; default: found by its name.")
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", metavar="RIG", help="Stream to servos: a rig file, or 'emulated' for emulated ones."),
    ] = None,
    scrub: Annotated[
        bool, typer.Option("--scrub", help="Show the targets on a page with a time bar; nothing is driven.")
    ] = False,
    headless: Annotated[bool, typer.Option("--headless", help="No page and no terminal.")] = False,
    rate: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Ticks of the loop per second, Hz; default: as recorded."),
    ] = None,
    kinematic: Annotated[
        bool, typer.Option("--kinematic", help="Show the targets without simulated servos and masses.")
    ] = False,
    page_port: PagePortOption = PAGE_PORT,
    command_port: Annotated[
        int,
        typer.Option("--command-port", metavar="PORT", help="Where `motiondeck send` reaches it; 0 for any free one."),
    ] = DEFAULT_PORT,
    as_json: Annotated[bool, typer.Option("--json", help="Print a report as one JSON object in the end.")] = False,
) -> None:
    """Replay a recorded run: the same targets, through the same limits.

    Commands for tempo, pause, home and the emergency stop work as in `play`.

    With --scrub nothing is driven: a page shows the targets, with a time bar and single steps.

    Example:  motiondeck replay show.rec --rig emulated
    """
    from controller.deck.recorded_deck import RecordedDeck
    from controller.library.motion_library import load_library
    from controller.wire.run_recording import load_recording
    from motiondeck.run.report import summary
    from motiondeck.run.robots.robot_on_deck import open_robots
    from motiondeck.run.run_settings import RunSettings
    from motiondeck.run.session import Session
    from motiondeck.run.setup import robot_setup
    from motiondeck_base.shipped import find_library, find_robot

    recording = load_recording(file)
    if not recording.complete:
        print(f"{file} was cut short: its last whole chunk ends after {recording.ticks} ticks", file=sys.stderr)
    recorded = str(recording.description["robot"])
    player = robot or recorded
    loaded = load_library(find_library(library or str(recording.description["library"])))
    if scrub:
        from motiondeck.pictures.clip_scene import act_of_recording
        from motiondeck.run.page.page import show_act
        from sim.robots.robot import load_robot

        show_act(act_of_recording(recording, load_robot(find_robot(player), loaded.skeleton)), page_port)
        return
    root = str(recording.description.get("root", "gantry"))
    balance, walk = bool(recording.description.get("balance")), bool(recording.description.get("walk"))
    deck = RecordedDeck(recording, same_robot=robot is None or Path(robot).stem == recorded)
    setup = robot_setup(player, rig, physics=not kinematic, root=root, balance=balance, walk=walk)
    settings = RunSettings(
        rate=rate if rate is not None else float(recording.description["rate"]),
        command_port=command_port,
        page_port=None if headless else page_port,
        terminal=not headless and sys.stdin.isatty(),
    )
    with Session(
        loaded, lambda opening: open_robots(opening, [setup], loaded, settings.rate), lambda _: deck, settings
    ) as session:
        report = session.run()
    print(json.dumps(report) if as_json else summary(report))
