"""`motiondeck play`: the real-time loop, with a page, a terminal, a film or nothing to look at it."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from controller.wire.messages.commands import Switch
from motiondeck.cli.common.options_class import grouped
from motiondeck.cli.play_options import OnMismatch, PlayOptions

if TYPE_CHECKING:
    from controller.learning.recognition.recognizer import Recognizer
    from controller.library.motion_library import MotionLibrary
    from motiondeck.run.beside.child_process import PageProcess
    from motiondeck.run.run_settings import RunSettings
    from motiondeck.run.script import Timed
    from motiondeck.run.session import Session
    from motiondeck.run.wired_stop import WiredStop


@grouped
def play(context: typer.Context, options: PlayOptions) -> None:
    """Play learned motions live and switch them on command.

    Opens a page on 127.0.0.1 with the robot and a button for each motion, and a prompt here: type a motion's name (Tab
    completes), `tempo 1.5`, `pause`, `resume`, `quit`. From another terminal: `motiondeck send switch waltz`.

    [bold]Examples[/]

      motiondeck play
      motiondeck play jog --robot servo20 --rig emulated
      motiondeck play --headless --seconds 10 --script "walk 4, jog 4, walk" --json
      motiondeck play --headless --script show.toml --record show.rec
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
    if options.video is None:
        os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here, and MuJoCo starts sooner without OpenGL
    from motiondeck.run.beside.child_process import page_process

    with ExitStack() as early:
        # The page takes longest to start, so it does that while all the rest is imported and loaded.
        page: PageProcess | None = None
        if not options.headless and options.video is None and options.core is None:
            page = early.enter_context(page_process(options.page_port, options.command_port))
        program = _program_of(options)
        if options.video is not None:
            _film(options, program, options.video)
            return
        session = _play_live(options, program, page)
    if session.then is not None:
        from motiondeck.run.play_again import play_again

        play_again(context, *session.then, page_port=session.page_port, command_port=session.command_port)


@dataclass(frozen=True)
class _Program:
    """What is to be played.

    Attributes:
        library, file: the library and its file.
        first: the motion to begin with.
        timeline: what is commanded when.
        seconds: how long, or None.
    """

    library: MotionLibrary
    file: Path
    first: str
    timeline: list[Timed]
    seconds: float | None


def _program_of(options: PlayOptions) -> _Program:
    """What the options say is to be played.

    Raises:
        MotiondeckError: if that is impossible; it says what to do.
    """
    from controller.library.motion_library import load_library
    from motiondeck.run.setup import check_seconds
    from motiondeck_base.shipped import find_library

    check_seconds(options.seconds)
    options.check()
    file = find_library(options.library)
    library = load_library(file)
    name_failing(library)
    first, timeline, length = _timeline(library, options.motion, options.script)
    return _Program(library, file, first, timeline, options.seconds if options.seconds is not None else length)


def _film(options: PlayOptions, program: _Program, video: Path) -> None:
    """Films the run instead of playing it live."""
    from controller.deck.deck import Deck
    from motiondeck.pictures.filmed_run import film_run
    from motiondeck.pictures.library_pictures import Staging, film_look

    options.check_for_film()
    deck = partial(Deck, program.library, motion=program.first, direct=options.direct, joining=options.join)
    look = film_look(video, options.size, options.fps, options.camera, options.ghost, options.footprints)
    staging = Staging(not options.kinematic, options.root, options.balance, options.walk, options.solver)
    report, words = film_run(
        program.library, options.robot, deck, program.timeline, program.seconds, video, look, staging
    )
    _print(report, words, as_json=options.as_json)


def _play_live(options: PlayOptions, program: _Program, page: PageProcess | None) -> Session:
    """Plays until the run has ended; the session, which knows how it goes on.

    Raises:
        typer.Exit: if the recording is not complete, or a rig was lost or stopped for its motion.
    """
    from controller.deck.deck import Deck
    from motiondeck.run.report import summary
    from motiondeck.run.robots.robot_on_deck import open_robots
    from motiondeck.run.session import Session
    from motiondeck.run.setup import checked_rate, robot_setup

    library, first = program.library, program.first
    rate = checked_rate(library, first, options.rate, lower=options.lower_rate)
    if rate != options.rate:
        print(f"playing at {rate:g} Hz, which the network can hold", file=sys.stderr)
    options.check_for_live()
    held = {"root": options.root, "balance": options.balance, "walk": options.walk}
    physics = {"physics": not options.kinematic, **held, "keep_apart": options.check_collisions}
    setups = [robot_setup(options.robot, options.rig, solver=options.solver, **physics)]
    if options.follow is not None:
        setups.append(robot_setup(options.follow, options.follow_rig, **physics))
    with Session(
        library,
        lambda opening: open_robots(opening, setups, library, rate),
        lambda retarget: Deck(library, retarget, first, direct=options.direct, joining=options.join),
        _run_settings(options, program, rate, page),
        program.timeline,
    ) as session:
        report = session.run()
    _print(report, summary(report), as_json=options.as_json)
    incomplete = not report.get("recording", {"complete": True})["complete"]
    if incomplete or any(o["parked"] for o in report["outputs"]) or report.get("recognition", {}).get("stopped"):
        raise typer.Exit(1)
    return session


def _run_settings(options: PlayOptions, program: _Program, rate: float, page: PageProcess | None) -> RunSettings:
    """How the run goes, as the options say."""
    from controller.wire.authentication import read_token
    from motiondeck.run.recognition.recognition_watch import MismatchPolicy
    from motiondeck.run.run_settings import RunSettings

    stops = options.on_mismatch is OnMismatch.STOP
    quiet = options.headless or options.as_json
    return RunSettings(
        rate=rate,
        command_port=options.command_port,
        page_port=None if options.headless else options.page_port,
        page=page,
        progress=not options.as_json,
        terminal=not quiet and sys.stdin.isatty() and sys.stdout.isatty(),
        seconds=program.seconds,
        record=options.record,
        outputs=tuple(options.output or ()),
        realtime=options.realtime,
        core=options.core,
        catch_up=options.overruns == "catch-up",
        recognizer=_recognizer(options.recognizer) if options.recognizer is not None else None,
        mismatch=MismatchPolicy(options.mismatch_after, stops) if options.recognize else None,
        listen=options.listen,
        token=read_token(options.token_file) if options.token_file is not None else None,
        stop_input=_wired_stop(options.stop_input) if options.stop_input is not None else None,
        lock_to=options.lock_to,
        show=options.show,
        robot=Path(options.robot).stem,
        library=program.file,
        restarts=not quiet,
    )


def _recognizer(file: Path) -> Recognizer:
    """The recognizer in a file; what recognizes takes longer to import than all that plays."""
    from controller.learning.recognition.recognizer_file import load_recognizer

    return load_recognizer(file)


def _wired_stop(device: Path) -> WiredStop:
    """The emergency stop that is wired to a device."""
    from hardware.tools.stop_input import open_stop_input

    return open_stop_input(device)


def name_failing(library: MotionLibrary) -> None:
    """Names the motions of a library that failed its self-test, on standard error."""
    failing = [f"{motion.name} ({motion.reason})" for motion in library.info.motions if not motion.passed]
    if failing:
        told = f"{', '.join(failing)} failed the self-test and may not play as recorded"
        print(f"motiondeck: warning: {told}", file=sys.stderr)


def _timeline(library: MotionLibrary, motion: str | None, script: str | None) -> tuple[str, list[Timed], float | None]:
    """The first motion, what is commanded when, and the length of a script, if it has one."""
    from motiondeck.run.script import Timed, parse_script, read_timeline
    from motiondeck.run.setup import first_motion

    names = library.network.motions
    if script is None:
        return first_motion(library, motion), [], None
    if script.endswith(".toml"):
        return *read_timeline(Path(script), names), None
    cues, length = parse_script(script, names)
    return cues[0].motion, [Timed(cue.at, Switch(cue.motion)) for cue in cues[1:]], length


def _print(report: dict[str, Any], words: str, *, as_json: bool) -> None:
    """One JSON object on standard output, or a few words."""
    import json

    print(json.dumps(report) if as_json else words)
