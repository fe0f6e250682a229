"""`motiondeck replay`: plays a recorded run again, on the simulated robot or on servos."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from motiondeck.cli.run_options import with_run_options
from motiondeck.run.spec.run_spec import EMULATED, RunSpec


@with_run_options("rig", "physics", "page", "command_port")
def replay(
    file: Annotated[Path, Argument(metavar="FILE", help="A recording made with `play --record FILE`.")],
    *,
    library: Annotated[str | None, Option(metavar="LIBRARY", help="The library; default: found by its name.")] = None,
    robot: Annotated[str | None, Option(metavar="ROBOT", help="The robot; default: found by its name.")] = None,
    spec: RunSpec,
    scrub: Annotated[bool, Option("--scrub", help="Show targets on a page with a time bar; drive nothing.")] = False,
    headless: Annotated[bool, Option("--headless", help="No page and no terminal.")] = False,
    rate: Annotated[float | None, Option(metavar="HZ", help="Ticks per second, Hz; default: as recorded.")] = None,
    as_json: Annotated[bool, Option("--json", help="Print a report as one JSON object in the end.")] = False,
) -> None:
    """Replay a recorded run: the same targets, through the same limits.

    Commands for tempo, pause, home and the emergency stop work as in `play`. With --scrub a page has single steps too.

    Example:  motiondeck replay show.rec --rig emulated
    """
    from controller.deck.recorded_deck import RecordedDeck
    from controller.library.motion_library import load_library
    from controller.motion.formats.run_recordings import clip_of_run
    from controller.wire.run_recording import load_recording
    from motiondeck.run.assembly import open_session
    from motiondeck.run.report import summary
    from motiondeck.run.robots.rig_on_deck import robot_of
    from motiondeck.run.robots.robot_on_deck import open_robots
    from motiondeck.run.session import Host, Played
    from motiondeck_base.shipped import find_library
    from sim.robots.catalogue import find_robot

    recording = load_recording(file)
    if not recording.complete:
        print(f"{file} was cut short: its last whole chunk ends after {recording.ticks} ticks", file=sys.stderr)
    recorded = str(recording.description["robot"])
    player = robot or recorded
    name, rig_alone = library or str(recording.description["library"]), recording.description.get("rig", "")
    if rig_alone and robot is None:
        source = clip_of_run(recording, name)
    else:
        source, rig_alone = load_library(find_library(name)), ""
    if scrub:
        from motiondeck.pictures.clip_scene import act_of_recording
        from motiondeck.run.page.page import show_act
        from sim.robots.robot import load_robot

        alone, skeleton = Path(rig_alone), source.skeleton
        body = robot_of(alone, skeleton) if rig_alone else load_robot(find_robot(player), skeleton)
        show_act(act_of_recording(recording, body), spec.page_port or 0)
        return
    spec = replace(
        spec,
        robot=None if rig_alone else player,
        rig=spec.rig or (f"{EMULATED}:{rig_alone}" if rig_alone else None),
        rate=rate if rate is not None else float(recording.description["rate"]),
        root=recording.description.get("root", "gantry") if not rig_alone else "gantry",
        balance=bool(recording.description.get("balance")),
        walk=bool(recording.description.get("walk")),
        page=False if headless else spec.page,
    )
    deck = RecordedDeck(recording, same_robot=robot is None or Path(robot).stem == recorded)
    played = Played(source, lambda opening: open_robots(opening, spec, source), lambda _: deck)
    with open_session(spec, played, Host(terminal=not headless and sys.stdin.isatty())) as session:
        report = session.run()
    print(json.dumps(report) if as_json else summary(report))
