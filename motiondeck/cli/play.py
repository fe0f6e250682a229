"""`motiondeck play`: the real-time loop, with a page and a terminal; or a film."""

from __future__ import annotations

import json
import os
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer import Option

from motiondeck.cli.common.options import CameraOption, FpsOption, SizeOption, of_film
from motiondeck.cli.run_options import with_run_options
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.library.motion_library import MotionLibrary
    from controller.motion.clip import Clip
    from motiondeck.run.beside.child_process import PageProcess
    from motiondeck.run.session import Session
    from motiondeck.run.spec.program import Program

_LEFT_OUT = ("motion", "library", "script", "page", "command_port")  # when the command starts again


@with_run_options()
def play(
    context: typer.Context,
    spec: RunSpec,
    video: Annotated[Path | None, of_film(metavar="FILE", help="Film it (.mp4, .gif) instead of playing live.")] = None,
    size: SizeOption = None,
    fps: FpsOption = None,
    camera: CameraOption = "follow",
    ghost: Annotated[bool, of_film("--ghost", help="In a film: draw the target pose too, translucent.")] = False,
    footprints: Annotated[bool, of_film("--footprints", help="In a film: draw where the feet stood.")] = False,
    headless: Annotated[bool, Option("--headless", help="No page and no terminal.")] = False,
    as_json: Annotated[bool, Option("--json", help="Print a report as one JSON object in the end.")] = False,
) -> None:
    """Play learned motions live and switch them on command.

    Opens a page on 127.0.0.1 with the robot, or a rig alone, and a button for each motion, and a prompt here: type a
    motion's name (Tab completes), `tempo 1.5`, `pause`, `resume`, `quit`. From another terminal:
    `motiondeck send switch waltz`.

    [bold]Examples[/]

      motiondeck play
      motiondeck play jog --robot servo20 --rig emulated
      motiondeck play --headless --seconds 10 --script "walk 4, jog 4, walk" --json
      motiondeck play --headless --script show.toml --record show.rec
      motiondeck play gestures.safetensors --rig head.toml
      motiondeck play --follow servo20 --follow-rig emulated
      motiondeck play box1 --robot servo20 --root free --balance
      motiondeck play walk --robot servo20 --root free --walk
      motiondeck play waltz --robot servo20 --check-collisions
      motiondeck play --recognize --on-mismatch stop --robot servo20 --rig emulated
      motiondeck play --recognizer gestures.safetensors
      motiondeck play --lock-to body --rig emulated --robot servo20
      motiondeck play --command-port 47811 --port 0 --lock-to 47810
      motiondeck play --show gala/left --command-port 0 --port 0
      motiondeck play --video walk.mp4 --seconds 6
      motiondeck play --robot g1.toml --video g1.mp4 --camera three --footprints --size 1280x720
    """
    if video is None:
        os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here, and MuJoCo starts sooner without OpenGL
    from motiondeck.run.beside.child_process import page_process

    with ExitStack() as early:
        # The page takes longest to start, so it does that while all the rest is imported and loaded.
        page: PageProcess | None = None
        if headless:
            spec = replace(spec, page=False)
        elif video is None and spec.core is None and spec.page_port is not None:
            page = early.enter_context(page_process(spec.page_port, spec.command_port))
        from motiondeck.run.spec.program import Program

        program = Program.of(spec)
        name_failing(program.source)
        if video is not None:
            from motiondeck.pictures.library_pictures import film_look, film_run

            _check_for_film(spec)
            look = film_look(video, size, fps, camera, ghost, footprints)
            report, words = film_run(spec, program, video, look)
            print(json.dumps(report) if as_json else words)
            return
        session = _play_live(spec, program, page, quiet=headless or as_json, as_json=as_json)
    if session.stop.then is not None:
        library, motion = session.stop.then
        if session.stop.emergency:
            raise MotiondeckError(f"the emergency stop is on, so {motion} is not started. Start it when all is clear.")
        ports = {"page_port": session.page_port, "command_port": session.command_port}
        play_again(context, str(program.file), library, motion, **ports)


def _check_for_film(spec: RunSpec) -> None:
    for asked, lack in (
        (spec.rig, "a film is not made live, so nothing can be streamed to a rig: leave --rig"),
        (spec.record, "a film is not made live, so there are no ticks to record: leave --record"),
        (spec.outputs, "a film is not made live, so no output gets targets: leave --output"),
        (spec.recognize or spec.recognizer, "in a film nothing is measured to be recognized: leave the recognition"),
    ):
        if asked:
            raise MotiondeckError(f"{lack} or --video")


def _play_live(spec: RunSpec, program: Program, page: PageProcess | None, *, quiet: bool, as_json: bool) -> Session:
    """Plays until the run has ended; the session, which knows how it goes on."""
    from motiondeck.run.library_run import library_run
    from motiondeck.run.report import summary
    from motiondeck.run.session import Host

    terminal = not quiet and sys.stdin.isatty() and sys.stdout.isatty()
    host = Host(page, terminal=terminal, progress=not as_json, restarts=not quiet)
    with library_run(spec, program, host) as session:
        if not as_json and session.spec.robot is not None:
            print(_verdicts(spec, session), file=sys.stderr)
        report = session.run()
    print(json.dumps(report) if as_json else summary(report))
    incomplete = not report.get("recording", {"complete": True})["complete"]
    if incomplete or any(o["parked"] for o in report["outputs"]) or report.get("recognition", {}).get("stopped"):
        raise typer.Exit(1)
    return session


def _verdicts(spec: RunSpec, session: Session) -> str:
    """Which motions the robot plays, and how it plays the first one; or how to find out."""
    from sim.robots.verdict import summed

    robot, first = session.robots[0].name, session.deck.motion
    verdicts = session.played.verdicts
    if first not in verdicts:
        command = f"motiondeck preflight {spec.library} --robot {session.spec.robot}"
        return f"which motions {robot} can play is not known yet; this finds out: {command}"
    judged = f"{len(verdicts)} judged: {summed(verdicts.values())}. {first}: {verdicts[first].words}"
    return f"{session.played.name} on {robot}, {judged}"


def play_again(
    context: typer.Context, before: str, library: str, motion: str, *, page_port: int | None, command_port: int
) -> NoReturn:
    """Replaces this process by one that plays another library on the same ports; if it cannot, this one goes on."""
    from controller.library.motion_library import load_library

    chosen: list[str] = ["--library", library, motion]
    try:
        if motion not in load_library(Path(library)).network.motions:
            raise MotiondeckError(f"{library} has no motion '{motion}'")
    except MotiondeckError as error:
        print(f"motiondeck: {error} The library before is played.", file=sys.stderr)
        chosen = ["--library", before]
    ports = ["--command-port", str(command_port)]
    if page_port is not None:
        ports += ["--port", str(page_port)]
    sys.stdout.flush()
    words: list[str] = []
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if name in _LEFT_OUT or source is None or source.name != "COMMANDLINE":
            continue
        value: Any = context.params[name]
        for one in value if isinstance(value, list | tuple) else [value]:
            words.append(parameter.opts[0])
            if one is not True:
                words.append(str(getattr(one, "value", one)))
    os.execv(sys.executable, [sys.executable, "-P", "-m", "motiondeck", "play", *chosen, *words, *ports])


def name_failing(source: MotionLibrary | Clip) -> None:
    """Names the motions of a library that failed its self-test, on standard error."""
    from controller.library.motion_library import MotionLibrary

    motions = source.info.motions if isinstance(source, MotionLibrary) else ()
    failing = [f"{motion.name} ({motion.reason})" for motion in motions if not motion.passed]
    if failing:
        text = f"{', '.join(failing)} failed the self-test and may not play as recorded"
        print(f"motiondeck: warning: {text}", file=sys.stderr)
