"""The options of a run, each once: the command line, `motiondeck.play` and replay take them from `RunSpec`.

A new option is one field here. `play` then has it as a flag, Python as a keyword, and the run reads it from the spec.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, get_args, get_type_hints

from controller.wire.command_socket import DEFAULT_PORT
from motiondeck_base.errors import MotiondeckError

PAGE_PORT = 8040
EMULATED = "emulated"

if TYPE_CHECKING:

    class SavableLibrary(Protocol):
        """A library in memory."""

        def save(self, file: Path) -> None:
            """Writes it into a file."""
            ...

    class CommandedDeck(Protocol):
        """A deck of this machine."""

        command_port: int

    File = str | Path
    LibraryFile = File | SavableLibrary
    LockSource = str | int | CommandedDeck
    Names = Sequence[str]
else:  # what is sent to the process of the run
    File = LibraryFile = str
    LockSource = str | int
    Names = tuple[str, ...]

_COMMANDS, _LOOP, _RECOGNITION = "Commands from elsewhere", "Real-time loop", "Recognition"
_SERVOS, _SIMULATION, _SWITCHING = "Servos", "Simulation", "Switching"


@dataclass(frozen=True)
class Option:
    """An option of a run.

    Attributes:
        flag: its name on the command line; "" for an argument.
        help: one sentence.
        metavar: stands for its value.
        panel: the group of the help that it belongs to; "" for the first one.
        typed: its default on the command line, where that is another than for a program.
        off: whether the flag switches it off.
        check: refuses values that cannot be.
    """

    flag: str
    help: str
    metavar: str | None = None
    panel: str = ""
    typed: Any = None
    off: bool = False
    check: Callable[[Any], None] | None = None


def _check_mismatch_after(seconds: float) -> None:
    check_seconds(seconds, "--mismatch-after")


def check_seconds(seconds: float | None, option: str = "--seconds") -> None:
    """Refuses a length of time that is not above 0 and below 1e8 s; None is no limit.

    Raises:
        MotiondeckError: if it is not.
    """
    if seconds is not None and not 0.0 < seconds < 1e8:
        raise MotiondeckError(f"{option} {seconds:g} is not a length of time above 0")


@dataclass(frozen=True)
class RunSpec:
    """The options of a run, in the order of the help; each says what it does."""

    library: Annotated[LibraryFile, Option("--library", "A library file, or a shipped one by its name.", "LIBRARY")] = (
        "thesis15"
    )
    motion: Annotated[
        str | None, Option("", "The motion to play first; default: `walk`, or the library's first.", "MOTION")
    ] = None
    _: KW_ONLY
    robot: Annotated[File, Option("--robot", "A robot file, or: mannequin, servo20.", "ROBOT")] = "mannequin"
    solver: Annotated[
        Literal["angles", "ik"] | None,
        Option("--solver", "Retargeting solver; default: as the robot's file says.", panel=_SIMULATION),
    ] = None
    rig: Annotated[
        File | None,
        Option(
            "--rig", "Stream to servos: a rig file, or 'emulated' for emulated servos of the robot.", "RIG", _SERVOS
        ),
    ] = None
    script: Annotated[
        File | None, Option("--script", 'What to play when: "walk 4, jog 4, walk", or a timeline file.', "SCRIPT")
    ] = None
    seconds: Annotated[
        float | None,
        Option(
            "--seconds",
            "Stop after this time of the motion; approach and end come on top.",
            "SECONDS",
            check=check_seconds,
        ),
    ] = None
    direct: Annotated[
        bool, Option("--direct", "Switch at once and directly, without motions in between.", panel=_SWITCHING)
    ] = False
    outputs: Annotated[
        Names,
        Option("--output", "Send targets to an output of another package (repeatable).", "NAME[:ARGUMENT]", _LOOP),
    ] = ()
    record: Annotated[File | None, Option("--record", "Record every tick, for `replay` and `plot`.", "FILE", _LOOP)] = (
        None
    )
    rate: Annotated[float, Option("--rate", "Ticks of the loop per second.", "HZ", _LOOP)] = 200.0
    lower_rate: Annotated[
        bool,
        Option("--lower-rate", "If the network is too large for --rate, play at a rate that it holds.", None, _LOOP),
    ] = False
    physics: Annotated[
        bool,
        Option("--kinematic", "Show the targets, without simulated servos and masses.", panel=_SIMULATION, off=True),
    ] = True
    root: Annotated[
        Literal["gantry", "fixed", "free"],
        Option("--root", "The simulated robot's root: carried by a gantry, fixed, or free to fall.", panel=_SIMULATION),
    ] = "gantry"
    balance: Annotated[
        bool,
        Option("--balance", "Keep a free robot's feet in place and its centre of mass above them.", panel=_SIMULATION),
    ] = False
    walk: Annotated[
        bool, Option("--walk", "Let a free robot walk where the motion goes, 1.2 s behind it.", panel=_SIMULATION)
    ] = False
    realtime: Annotated[
        bool,
        Option(
            "--realtime", "Ask for real-time scheduling and locked memory, and print what was granted.", panel=_LOOP
        ),
    ] = False
    core: Annotated[
        int | None,
        Option("--core", "Run the loop on this core of the CPU, all other processes on the others.", "N", _LOOP),
    ] = None
    overruns: Annotated[
        Literal["skip", "catch-up"],
        Option("--overruns", "After a tick that took too long: skip the missed ticks, or catch up.", panel=_LOOP),
    ] = "skip"
    follow: Annotated[str | None, Option("--follow", "A second robot that mirrors the first.", "ROBOT", _SERVOS)] = None
    follow_rig: Annotated[
        File | None, Option("--follow-rig", "Its servos: a rig file, or 'emulated'.", "RIG", _SERVOS)
    ] = None
    page: Annotated[
        bool | int,
        Option("--port", "The page's port on 127.0.0.1; 0 for any free one.", "PORT", _COMMANDS, typed=PAGE_PORT),
    ] = False
    command_port: Annotated[
        int,
        Option(
            "--command-port",
            "Where `motiondeck send` reaches the deck; 0 for any free port.",
            "PORT",
            _COMMANDS,
            typed=DEFAULT_PORT,
        ),
    ] = 0
    recognize: Annotated[
        bool,
        Option("--recognize", "Recognize the motion from the measured joints, and show it.", panel=_RECOGNITION),
    ] = False
    recognizer: Annotated[
        File | None,
        Option(
            "--recognizer",
            "Recognize the played motion with a trained recognizer (`recognize train`), and show it.",
            "FILE",
            _RECOGNITION,
        ),
    ] = None
    on_mismatch: Annotated[
        Literal["warn", "stop"],
        Option(
            "--on-mismatch", "With --recognize: warn or stop when the joints show another motion.", panel=_RECOGNITION
        ),
    ] = "warn"
    mismatch_after: Annotated[
        float,
        Option(
            "--mismatch-after",
            "How long the joints must show another motion before that, s.",
            "SECONDS",
            _RECOGNITION,
            check=_check_mismatch_after,
        ),
    ] = 0.5
    listen: Annotated[
        str | None,
        Option(
            "--listen", "Take commands at this address of this machine too; needs --token-file.", "ADDRESS", _COMMANDS
        ),
    ] = None
    token_file: Annotated[
        File | None, Option("--token-file", "The token; only you may read the file.", "FILE", _COMMANDS)
    ] = None
    show: Annotated[
        File | None,
        Option(
            "--show",
            "Take part in a show (`conduct`) under this name; for one on several machines: the deck's folder of "
            "certificates.",
            "SHOW/DECK",
            _COMMANDS,
        ),
    ] = None
    stop_input: Annotated[
        File | None,
        Option("--stop-input", "A wired emergency stop: a serial adapter, or /dev/input/eventN.", "DEVICE", _COMMANDS),
    ] = None
    lock_to: Annotated[
        LockSource | None,
        Option(
            "--lock-to",
            "Lock loops to: beat (taps), body (wait while the joints are held), or another deck by its command port.",
            "SOURCE",
            _SWITCHING,
        ),
    ] = None
    join: Annotated[
        Literal["inertialise", "crossfade", "morph", "cut"] | None,
        Option("--join", "How motions are joined; default: what suits the network.", panel=_SWITCHING),
    ] = None
    check_collisions: Annotated[
        bool,
        Option("--check-collisions", "Hold joints back where limbs of the robot would collide.", panel=_SIMULATION),
    ] = False

    @property
    def page_port(self) -> int | None:
        """The port of the page, 0 for a free one; None for no page."""
        if isinstance(self.page, bool):
            return 0 if self.page else None
        return self.page

    def check(self) -> None:
        """Refuses, before anything is loaded, impossible values and options that contradict or lack each other.

        Raises:
            MotiondeckError: if there are any; it says what to change.
        """
        for name, option in options().items():
            value = getattr(self, name)
            if isinstance(value, float) and not math.isfinite(value):
                raise MotiondeckError(f"{name} is {value}, not a finite number")
            if option.check is not None:
                option.check(value)
        if self.script is not None and self.motion is not None:
            raise MotiondeckError(f"give either a motion ('{self.motion}') or a --script, not both")
        if not self.physics and (self.root != "gantry" or self.balance or self.walk):
            raise MotiondeckError("--root, --balance and --walk are for simulated servos: leave --kinematic")
        if self.walk and self.lock_to == "body":
            raise MotiondeckError("with --walk the body is 1.2 s behind its targets: leave --lock-to body")
        if self.show is not None and self.lock_to is not None:
            raise MotiondeckError("with --show the show says what loops keep step with: leave --lock-to")
        if self.recognize and self.recognizer is not None:
            raise MotiondeckError("--recognize looks at the joints and --recognizer at the body: leave one")
        if self.follow_rig is not None and self.follow is None:
            raise MotiondeckError("--follow-rig needs --follow ROBOT: whose servos are they?")
        if self.listen is not None and self.token_file is None:
            raise MotiondeckError(
                f"--listen {self.listen} needs --token-file FILE: anybody could move the robot otherwise"
            )


@cache
def options() -> dict[str, Option]:
    """The option of each field of `RunSpec`."""
    hints = get_type_hints(RunSpec, include_extras=True)
    return {field.name: get_args(hints[field.name])[-1] for field in fields(RunSpec)}


@cache
def kinds() -> dict[str, Any]:
    """The type of each field of `RunSpec`."""
    hints = get_type_hints(RunSpec)
    return {field.name: hints[field.name] for field in fields(RunSpec)}
