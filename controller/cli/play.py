"""`motiondeck play`: the real-time loop, with a page, a terminal, a film or nothing to look at it."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from controller.cli.common.options import PAGE_PORT, CameraOption, FpsOption, RootOption, SizeOption, SolverOption
from controller.wire.command_socket import DEFAULT_PORT
from controller.wire.messages.commands import Switch

if TYPE_CHECKING:
    from controller.cli.session.script import Timed
    from controller.cli.session.session import WiredStop
    from controller.library.motion_library import MotionLibrary
    from controller.recognition.recognizer import Recognizer


class OnMismatch(StrEnum):
    """What happens when the joints do not do what was commanded."""

    WARN = "warn"
    STOP = "stop"


def play(
    context: typer.Context,
    motion: Annotated[
        str | None,
        typer.Argument(metavar="MOTION", help="The motion to play first; default: `walk`, or the library's first."),
    ] = None,
    library: Annotated[
        str, typer.Option("--library", metavar="LIBRARY", help="A library file, or a shipped one by its name.")
    ] = "thesis15",
    robot: Annotated[
        str, typer.Option("--robot", metavar="ROBOT", help="A robot file, or: mannequin, servo20.")
    ] = "mannequin",
    solver: SolverOption = None,
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig",
            rich_help_panel="Servos",
            metavar="RIG",
            help="Stream to servos: a rig file, or 'emulated' for emulated servos of the robot.",
        ),
    ] = None,
    script: Annotated[
        str | None,
        typer.Option(
            "--script", metavar="SCRIPT", help='What to play when: "walk 4, jog 4, walk", or a timeline file.'
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            metavar="SECONDS",
            help="Stop after so many seconds of the motion; approach and end come on top.",
        ),
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="No page and no terminal.")] = False,
    video: Annotated[
        Path | None,
        typer.Option(
            "--video", rich_help_panel="Film", metavar="FILE", help="Film it (.mp4 or .gif) instead of playing it live."
        ),
    ] = None,
    size: SizeOption = None,
    fps: FpsOption = None,
    camera: CameraOption = "follow",
    ghost: Annotated[
        bool,
        typer.Option(
            "--ghost",
            rich_help_panel="Film",
            help="In a film: draw the target pose too, translucent.",
        ),
    ] = False,
    footprints: Annotated[
        bool, typer.Option("--footprints", rich_help_panel="Film", help="In a film: draw where the feet stood.")
    ] = False,
    direct: Annotated[
        bool,
        typer.Option(
            "--direct", rich_help_panel="Switching", help="Switch at once and directly, never by way of other motions."
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            "--record",
            rich_help_panel="Real-time loop",
            metavar="FILE",
            help="Record every tick, for `replay` and `plot`.",
        ),
    ] = None,
    rate: Annotated[
        float,
        typer.Option("--rate", rich_help_panel="Real-time loop", metavar="HZ", help="Ticks of the loop a second."),
    ] = 200.0,
    lower_rate: Annotated[
        bool,
        typer.Option(
            "--lower-rate",
            rich_help_panel="Real-time loop",
            help="If the network is too large for --rate, play at a rate that it holds.",
        ),
    ] = False,
    kinematic: Annotated[
        bool,
        typer.Option(
            "--kinematic",
            rich_help_panel="Simulation",
            help="Show the targets themselves, without simulated servos and masses.",
        ),
    ] = False,
    root: RootOption = "gantry",
    balance: Annotated[
        bool,
        typer.Option(
            "--balance",
            rich_help_panel="Simulation",
            help="Keep a free robot's feet in place and its centre of mass above them.",
        ),
    ] = False,
    walk: Annotated[
        bool,
        typer.Option(
            "--walk",
            rich_help_panel="Simulation",
            help="Let a free robot walk where the motion goes, 1.2 s behind it.",
        ),
    ] = False,
    realtime: Annotated[
        bool,
        typer.Option(
            "--realtime",
            rich_help_panel="Real-time loop",
            help="Ask for real-time scheduling and locked memory, and print what was granted.",
        ),
    ] = False,
    core: Annotated[
        int | None,
        typer.Option(
            "--core",
            rich_help_panel="Real-time loop",
            metavar="N",
            help="Run the loop on this core of the CPU, all other processes on the others.",
        ),
    ] = None,
    overruns: Annotated[
        Literal["skip", "catch-up"],
        typer.Option(
            "--overruns",
            rich_help_panel="Real-time loop",
            help="After a tick that took too long: skip the missed ticks, or catch up.",
        ),
    ] = "skip",
    follow: Annotated[
        str | None,
        typer.Option(
            "--follow", rich_help_panel="Servos", metavar="ROBOT", help="A second robot that mirrors the first."
        ),
    ] = None,
    follow_rig: Annotated[
        str | None,
        typer.Option(
            "--follow-rig", rich_help_panel="Servos", metavar="RIG", help="Its servos: a rig file, or 'emulated'."
        ),
    ] = None,
    page_port: Annotated[
        int,
        typer.Option(
            "--port",
            rich_help_panel="Commands from elsewhere",
            metavar="PORT",
            help="The page's port on 127.0.0.1; 0 for any free one.",
        ),
    ] = PAGE_PORT,
    command_port: Annotated[
        int,
        typer.Option(
            "--command-port",
            rich_help_panel="Commands from elsewhere",
            metavar="PORT",
            help="Where `motiondeck send` reaches the deck; 0 for any free one.",
        ),
    ] = DEFAULT_PORT,
    recognize: Annotated[
        bool,
        typer.Option(
            "--recognize",
            rich_help_panel="Recognition",
            help="Recognize the motion from the measured joints, and show it.",
        ),
    ] = False,
    recognizer: Annotated[
        Path | None,
        typer.Option(
            "--recognizer",
            rich_help_panel="Recognition",
            metavar="FILE",
            help="Recognize the played motion with a trained recognizer (`recognize train`), and show it.",
        ),
    ] = None,
    on_mismatch: Annotated[
        OnMismatch,
        typer.Option(
            "--on-mismatch",
            rich_help_panel="Recognition",
            help="With --recognize: warn or stop when the joints show another motion.",
        ),
    ] = OnMismatch.WARN,
    mismatch_after: Annotated[
        float,
        typer.Option(
            "--mismatch-after",
            rich_help_panel="Recognition",
            metavar="SECONDS",
            help="How long the joints must show another motion before that, s.",
        ),
    ] = 0.5,
    listen: Annotated[
        str | None,
        typer.Option(
            "--listen",
            rich_help_panel="Commands from elsewhere",
            metavar="ADDRESS",
            help="Take commands at this address of this machine too; needs --token-file.",
        ),
    ] = None,
    token_file: Annotated[
        Path | None,
        typer.Option(
            "--token-file",
            rich_help_panel="Commands from elsewhere",
            metavar="FILE",
            help="The token; only you may read the file.",
        ),
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(
            "--show",
            rich_help_panel="Commands from elsewhere",
            metavar="SHOW/DECK",
            help="Take part in a show (`conduct`) under this name; for one on several machines: the deck's folder of "
            "certificates.",
        ),
    ] = None,
    stop_input: Annotated[
        Path | None,
        typer.Option(
            "--stop-input",
            rich_help_panel="Commands from elsewhere",
            metavar="DEVICE",
            help="A wired emergency stop: a serial adapter, or /dev/input/eventN.",
        ),
    ] = None,
    lock_to: Annotated[
        str | None,
        typer.Option(
            "--lock-to",
            rich_help_panel="Switching",
            metavar="SOURCE",
            help="Lock loops to: beat (taps), body (wait while the joints are held), or another deck by its command "
            "port.",
        ),
    ] = None,
    join: Annotated[
        Literal["inertialise", "crossfade", "morph", "cut"] | None,
        typer.Option(
            "--join", rich_help_panel="Switching", help="How motions are joined; default: what suits the network."
        ),
    ] = None,
    check_collisions: Annotated[
        bool,
        typer.Option(
            "--check-collisions",
            rich_help_panel="Simulation",
            help="Hold joints back where limbs of the robot would collide.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a report as one JSON object in the end.")] = False,
) -> None:
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
    if video is None:
        os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here, and MuJoCo starts sooner without OpenGL
    from controller.cli.session.child_process import page_process

    with ExitStack() as early:
        # The page takes longest to start, so it does that while all the rest is imported and loaded.
        shown = not headless and video is None and core is None
        page = early.enter_context(page_process(page_port, command_port)) if shown else None
        from controller.cli.session.recognition.recognition_watch import MismatchPolicy
        from controller.cli.session.report import summary
        from controller.cli.session.robots.robot_on_deck import open_robots
        from controller.cli.session.session import RunSettings, Session
        from controller.cli.session.setup import check_seconds, checked_rate, robot_setup
        from controller.deck.deck import Deck
        from controller.library.motion_library import load_library
        from controller.wire.authentication import read_token
        from motiondeck_base.errors import MotiondeckError
        from motiondeck_base.shipped import find_library

        check_seconds(seconds)
        if script is not None and motion is not None:
            raise MotiondeckError(f"give either a motion ('{motion}') or a --script, not both")
        if kinematic and (root != "gantry" or balance or walk):
            raise MotiondeckError("--root, --balance and --walk are for simulated servos: leave --kinematic")
        if walk and lock_to == "body":
            raise MotiondeckError("with --walk the body is 1.2 s behind its targets: leave --lock-to body")
        if show is not None and lock_to is not None:
            raise MotiondeckError("with --show the show says what loops keep step with: leave --lock-to")
        if recognize and recognizer is not None:
            raise MotiondeckError("--recognize looks at the joints and --recognizer at the body: leave one")
        if not 0.0 < mismatch_after < 1e4:
            raise MotiondeckError(f"--mismatch-after {mismatch_after:g} s is not a length of time above 0")
        library_file = find_library(library)
        loaded = load_library(library_file)
        name_failing(loaded)
        first, timeline, length = _timeline(loaded, motion, script)
        seconds = seconds if seconds is not None else length
        if video is not None:
            from controller.cli.pictures.filmed_run import film_run, refuse_live_options
            from controller.cli.pictures.library_pictures import Staging, film_look

            refuse_live_options(
                rig=rig is not None, record=record is not None, recognize=recognize or recognizer is not None
            )
            film_deck = partial(Deck, loaded, motion=first, direct=direct, joining=join)
            look = film_look(video, size, fps, camera, ghost, footprints)
            staging = Staging(not kinematic, root, balance, walk, solver)
            _print(*film_run(loaded, robot, film_deck, timeline, seconds, video, look, staging), as_json=as_json)
            return
        if rate != (rate := checked_rate(loaded, first, rate, lower=lower_rate)):
            print(f"playing at {rate:g} Hz, which the network can hold", file=sys.stderr)
        if follow_rig is not None and follow is None:
            raise MotiondeckError("--follow-rig needs --follow ROBOT: whose servos are they?")
        if listen is not None and token_file is None:
            raise MotiondeckError(f"--listen {listen} needs --token-file FILE: anybody could move the robot otherwise")
        held = {"root": root, "balance": balance, "walk": walk}
        physics = {"physics": not kinematic, **held, "keep_apart": check_collisions}
        setups = [robot_setup(robot, rig, solver=solver, **physics)]
        if follow is not None:
            setups.append(robot_setup(follow, follow_rig, **physics))
        settings = RunSettings(
            rate=rate,
            command_port=command_port,
            page_port=None if headless else page_port,
            page=page,
            progress=not as_json,
            terminal=not (headless or as_json) and sys.stdin.isatty() and sys.stdout.isatty(),
            seconds=seconds,
            record=record,
            realtime=realtime,
            core=core,
            catch_up=overruns == "catch-up",
            recognizer=_recognizer(recognizer) if recognizer is not None else None,
            mismatch=MismatchPolicy(mismatch_after, on_mismatch is OnMismatch.STOP) if recognize else None,
            listen=listen,
            token=read_token(token_file) if token_file is not None else None,
            stop_input=_wired_stop(stop_input) if stop_input is not None else None,
            lock_to=lock_to,
            show=show,
            robot=Path(robot).stem,
            library=library_file,
            restarts=not (headless or as_json),
        )
        with Session(
            loaded,
            lambda opening: open_robots(opening, setups, loaded, rate),
            lambda retarget: Deck(loaded, retarget, first, direct=direct, joining=join),
            settings,
            timeline,
        ) as session:
            report = session.run()
        _print(report, summary(report), as_json=as_json)
        incomplete = not report.get("recording", {"complete": True})["complete"]
        then = session.then
        if incomplete or any(o["parked"] for o in report["outputs"]) or report.get("recognition", {}).get("stopped"):
            raise typer.Exit(1)
    if then is not None:
        from controller.cli.session.play_again import play_again

        play_again(context, *then, page_port=session.page_port, command_port=session.command_port)


def _recognizer(file: Path) -> Recognizer:
    """The recognizer in a file; what recognizes takes longer to import than all that plays."""
    from controller.recognition.recognizer_file import load_recognizer

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
    from controller.cli.session.script import Timed, parse_script, read_timeline
    from controller.cli.session.setup import first_motion

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
