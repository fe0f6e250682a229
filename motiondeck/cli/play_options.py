"""The options of `motiondeck play`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from controller.wire.command_socket import DEFAULT_PORT
from motiondeck.cli.common.options import PAGE_PORT, CameraOption, FpsOption, RootOption, SizeOption, SolverOption
from motiondeck_base.errors import MotiondeckError

_commands = partial(typer.Option, rich_help_panel="Commands from elsewhere")
_film = partial(typer.Option, rich_help_panel="Film")
_loop = partial(typer.Option, rich_help_panel="Real-time loop")
_recognition = partial(typer.Option, rich_help_panel="Recognition")
_servos = partial(typer.Option, rich_help_panel="Servos")
_simulation = partial(typer.Option, rich_help_panel="Simulation")
_switching = partial(typer.Option, rich_help_panel="Switching")


class OnMismatch(StrEnum):
    """What happens when the joints do not do what was commanded."""

    WARN = "warn"
    STOP = "stop"


@dataclass(frozen=True)
class PlayOptions:
    """What a person may say about a run, in the order of the help."""

    motion: Annotated[
        str | None,
        typer.Argument(metavar="MOTION", help="The motion to play first; default: `walk`, or the library's first."),
    ] = None
    library: Annotated[
        str, typer.Option("--library", metavar="LIBRARY", help="A library file, or a shipped one by its name.")
    ] = "thesis15"
    robot: Annotated[str, typer.Option("--robot", metavar="ROBOT", help="A robot file, or: mannequin, servo20.")] = (
        "mannequin"
    )
    solver: SolverOption = None
    rig: Annotated[
        str | None,
        _servos(
            "--rig", metavar="RIG", help="Stream to servos: a rig file, or 'emulated' for emulated servos of the robot."
        ),
    ] = None
    script: Annotated[
        str | None,
        typer.Option(
            "--script", metavar="SCRIPT", help='What to play when: "walk 4, jog 4, walk", or a timeline file.'
        ),
    ] = None
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            metavar="SECONDS",
            help="Stop after so many seconds of the motion; approach and end come on top.",
        ),
    ] = None
    headless: Annotated[bool, typer.Option("--headless", help="No page and no terminal.")] = False
    video: Annotated[
        Path | None, _film("--video", metavar="FILE", help="Film it (.mp4 or .gif) instead of playing it live.")
    ] = None
    size: SizeOption = None
    fps: FpsOption = None
    camera: CameraOption = "follow"
    ghost: Annotated[bool, _film("--ghost", help="In a film: draw the target pose too, translucent.")] = False
    footprints: Annotated[bool, _film("--footprints", help="In a film: draw where the feet stood.")] = False
    direct: Annotated[
        bool, _switching("--direct", help="Switch at once and directly, never by way of other motions.")
    ] = False
    output: Annotated[
        list[str] | None,
        _loop("--output", metavar="NAME[:ARGUMENT]", help="Send targets to an output of another package (repeatable)."),
    ] = None
    record: Annotated[
        Path | None, _loop("--record", metavar="FILE", help="Record every tick, for `replay` and `plot`.")
    ] = None
    rate: Annotated[float, _loop("--rate", metavar="HZ", help="Ticks of the loop a second.")] = 200.0
    lower_rate: Annotated[
        bool, _loop("--lower-rate", help="If the network is too large for --rate, play at a rate that it holds.")
    ] = False
    kinematic: Annotated[
        bool, _simulation("--kinematic", help="Show the targets themselves, without simulated servos and masses.")
    ] = False
    root: RootOption = "gantry"
    balance: Annotated[
        bool, _simulation("--balance", help="Keep a free robot's feet in place and its centre of mass above them.")
    ] = False
    walk: Annotated[
        bool, _simulation("--walk", help="Let a free robot walk where the motion goes, 1.2 s behind it.")
    ] = False
    realtime: Annotated[
        bool, _loop("--realtime", help="Ask for real-time scheduling and locked memory, and print what was granted.")
    ] = False
    core: Annotated[
        int | None,
        _loop("--core", metavar="N", help="Run the loop on this core of the CPU, all other processes on the others."),
    ] = None
    overruns: Annotated[
        Literal["skip", "catch-up"],
        _loop("--overruns", help="After a tick that took too long: skip the missed ticks, or catch up."),
    ] = "skip"
    follow: Annotated[
        str | None, _servos("--follow", metavar="ROBOT", help="A second robot that mirrors the first.")
    ] = None
    follow_rig: Annotated[
        str | None, _servos("--follow-rig", metavar="RIG", help="Its servos: a rig file, or 'emulated'.")
    ] = None
    page_port: Annotated[
        int, _commands("--port", metavar="PORT", help="The page's port on 127.0.0.1; 0 for any free one.")
    ] = PAGE_PORT
    command_port: Annotated[
        int,
        _commands(
            "--command-port", metavar="PORT", help="Where `motiondeck send` reaches the deck; 0 for any free one."
        ),
    ] = DEFAULT_PORT
    recognize: Annotated[
        bool, _recognition("--recognize", help="Recognize the motion from the measured joints, and show it.")
    ] = False
    recognizer: Annotated[
        Path | None,
        _recognition(
            "--recognizer",
            metavar="FILE",
            help="Recognize the played motion with a trained recognizer (`recognize train`), and show it.",
        ),
    ] = None
    on_mismatch: Annotated[
        OnMismatch,
        _recognition("--on-mismatch", help="With --recognize: warn or stop when the joints show another motion."),
    ] = OnMismatch.WARN
    mismatch_after: Annotated[
        float,
        _recognition(
            "--mismatch-after", metavar="SECONDS", help="How long the joints must show another motion before that, s."
        ),
    ] = 0.5
    listen: Annotated[
        str | None,
        _commands(
            "--listen", metavar="ADDRESS", help="Take commands at this address of this machine too; needs --token-file."
        ),
    ] = None
    token_file: Annotated[
        Path | None, _commands("--token-file", metavar="FILE", help="The token; only you may read the file.")
    ] = None
    show: Annotated[
        str | None,
        _commands(
            "--show",
            metavar="SHOW/DECK",
            help="Take part in a show (`conduct`) under this name; for one on several machines: the deck's folder of "
            "certificates.",
        ),
    ] = None
    stop_input: Annotated[
        Path | None,
        _commands(
            "--stop-input", metavar="DEVICE", help="A wired emergency stop: a serial adapter, or /dev/input/eventN."
        ),
    ] = None
    lock_to: Annotated[
        str | None,
        _switching(
            "--lock-to",
            metavar="SOURCE",
            help="Lock loops to: beat (taps), body (wait while the joints are held), or another deck by its command "
            "port.",
        ),
    ] = None
    join: Annotated[
        Literal["inertialise", "crossfade", "morph", "cut"] | None,
        _switching("--join", help="How motions are joined; default: what suits the network."),
    ] = None
    check_collisions: Annotated[
        bool, _simulation("--check-collisions", help="Hold joints back where limbs of the robot would collide.")
    ] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print a report as one JSON object in the end.")] = False

    def check(self) -> None:
        """Refuses, before anything is loaded, options that contradict each other.

        Raises:
            MotiondeckError: if they do; it says which to leave.
        """
        if self.script is not None and self.motion is not None:
            raise MotiondeckError(f"give either a motion ('{self.motion}') or a --script, not both")
        if self.kinematic and (self.root != "gantry" or self.balance or self.walk):
            raise MotiondeckError("--root, --balance and --walk are for simulated servos: leave --kinematic")
        if self.walk and self.lock_to == "body":
            raise MotiondeckError("with --walk the body is 1.2 s behind its targets: leave --lock-to body")
        if self.show is not None and self.lock_to is not None:
            raise MotiondeckError("with --show the show says what loops keep step with: leave --lock-to")
        if self.recognize and self.recognizer is not None:
            raise MotiondeckError("--recognize looks at the joints and --recognizer at the body: leave one")
        if not 0.0 < self.mismatch_after < 1e4:
            raise MotiondeckError(f"--mismatch-after {self.mismatch_after:g} s is not a length of time above 0")

    def check_for_film(self) -> None:
        """Refuses options that make no sense with --video.

        Raises:
            MotiondeckError: if one of them is given.
        """
        if self.rig is not None:
            raise MotiondeckError(
                "a film is not made live, so nothing can be streamed to a rig: leave --rig or --video"
            )
        if self.record is not None:
            raise MotiondeckError("a film is not made live, so there are no ticks to record: leave --record or --video")
        if self.recognize or self.recognizer is not None:
            raise MotiondeckError("in a film nothing is measured to be recognized: leave the recognition or --video")

    def check_for_live(self) -> None:
        """Refuses options of a live run that lack another one.

        Raises:
            MotiondeckError: if one does; it names the other.
        """
        if self.follow_rig is not None and self.follow is None:
            raise MotiondeckError("--follow-rig needs --follow ROBOT: whose servos are they?")
        if self.listen is not None and self.token_file is None:
            raise MotiondeckError(
                f"--listen {self.listen} needs --token-file FILE: anybody could move the robot otherwise"
            )
