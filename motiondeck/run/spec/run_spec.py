"""The options of a run, each once: the command line, `motiondeck.play` and replay take them from `RunSpec`.

A new option is one field here. `play` then has it as a flag, Python as a keyword, and the run reads it from the spec.
"""

# ruff: noqa: RUF009 (each option is a field of the dataclass)
import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar, cast, get_type_hints

from controller.wire.command_socket import DEFAULT_PORT
from motiondeck_base.errors import MotiondeckError

T = TypeVar("T")

PAGE_PORT = 8040
EMULATED = "emulated"

if TYPE_CHECKING:

    class SavableLibrary(Protocol):
        """A library in memory."""

        def save(self, file: Path) -> None:
            """Writes it into a file."""

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
    """An option of a run."""

    help: str
    metavar: str | None = None  # stands for its value
    panel: str = ""  # the group of the help that it belongs to; "" for the first one
    typed: Any = None  # its default on the command line, where that is another than for a program
    off: bool = False  # whether the flag switches it off
    check: Callable[[Any], None] | None = None  # refuses values that cannot be
    flag: str | None = None  # its name on the command line, where that is not the field's; "" for an argument


def option(default: T, *row: Any, **named: Any) -> T:
    """A field of `RunSpec`, with what its `Option` is made from."""
    return cast(T, field(default=default, metadata={"option": Option(*row, **named)}))


def is_emulated(rig: File | None) -> bool:
    """Whether the servos of a rig are emulated ones: `emulated`, or `emulated:RIG`."""
    return str(rig).partition(":")[0] == EMULATED


def check_seconds(seconds: float | None, option: str = "--seconds") -> None:
    """Refuses a length of time that is not above 0 and below 1e8 s; None is no limit. MotiondeckError if it is not."""
    if seconds is not None and not 0.0 < seconds < 1e8:
        raise MotiondeckError(f"{option} {seconds:g} is not a length of time above 0")


@dataclass(frozen=True)
class RunSpec:
    """The options of a run, in the order of the help."""

    library: LibraryFile = option("thesis15", "A library file, or a shipped one by its name.", "LIBRARY")
    motion: str | None = option(
        None, "The motion to play first, or a library file; with --rig also a file of joint motion.", "MOTION", flag=""
    )
    _: KW_ONLY
    robot: File | None = option(
        None, "A robot file or a name (`robot list`); default: with --rig its own joints, else the mannequin.", "ROBOT"
    )
    solver: Literal["angles", "ik"] | None = option(
        None, "Retargeting solver; default: as the robot's file says.", panel=_SIMULATION
    )
    rig: File | None = option(None, "Stream to servos: a rig file, 'emulated', or 'emulated:RIG'.", "RIG", _SERVOS)
    script: File | None = option(None, 'What to play when: "walk 4, jog 4, walk", or a timeline file.', "SCRIPT")
    seconds: float | None = option(
        None, "Stop after this time of the motion; approach and end come on top.", "SECONDS", check=check_seconds
    )
    direct: bool = option(False, "Switch at once and directly, without motions in between.", panel=_SWITCHING)
    outputs: Names = option(
        (), "Send targets to an output of another package (repeatable).", "NAME[:ARGUMENT]", _LOOP, flag="--output"
    )
    record: File | None = option(None, "Record every tick, for `replay` and `plot`.", "FILE", _LOOP)
    rate: float = option(200.0, "Ticks of the loop per second.", "HZ", _LOOP)
    lower_rate: bool = option(False, "If a network is too large for --rate, play at a rate that it holds.", None, _LOOP)
    physics: bool = option(
        True, "Show the targets, without simulated servos and masses.", panel=_SIMULATION, off=True, flag="--kinematic"
    )
    root: Literal["gantry", "fixed", "free"] = option(
        "gantry", "The simulated robot's root: carried by a gantry, fixed, or free to fall.", panel=_SIMULATION
    )
    balance: bool = option(False, "Keep a free robot's feet still, its centre of mass above them.", panel=_SIMULATION)
    walk: bool = option(False, "Let a free robot walk where the motion goes, 1.2 s behind it.", panel=_SIMULATION)
    realtime: bool = option(False, "Ask for real-time scheduling, locked memory; with a real rig always.", panel=_LOOP)
    core: int | None = option(None, "Run the loop on this core of the CPU, all else on the others.", "N", _LOOP)
    overruns: Literal["skip", "catch-up"] = option(
        "skip", "After a tick that took too long: skip the missed ticks, or catch up.", panel=_LOOP
    )
    follow: str | None = option(None, "A second robot that mirrors the first.", "ROBOT", _SERVOS)
    follow_rig: File | None = option(None, "Its servos: a rig file, or 'emulated'.", "RIG", _SERVOS)
    page: bool | int = option(
        False, "The page's port on 127.0.0.1; 0 for any free one.", "PORT", _COMMANDS, typed=PAGE_PORT, flag="--port"
    )
    command_port: int = option(0, "For `motiondeck send`; 0 for any free port.", "PORT", _COMMANDS, typed=DEFAULT_PORT)
    recognize: bool = option(False, "Recognize the motion from the measured joints, and show it.", panel=_RECOGNITION)
    recognizer: File | None = option(
        None, "Recognize the played motion with a recognizer (`recognize train`), and show it.", "FILE", _RECOGNITION
    )
    on_mismatch: Literal["warn", "stop"] = option(
        "warn", "With --recognize: warn or stop when the joints show another motion.", panel=_RECOGNITION
    )
    mismatch_after: float = option(
        0.5,
        "How long the joints must show another motion before that, s.",
        "SECONDS",
        _RECOGNITION,
        check=partial(check_seconds, option="--mismatch-after"),
    )
    listen: str | None = option(None, "Also take commands at this address; needs --token-file.", "ADDRESS", _COMMANDS)
    token_file: File | None = option(None, "The token; only you may read the file.", "FILE", _COMMANDS)
    show: File | None = option(
        None,
        "Take part in a show (`conduct`) under this name, or with this folder of certificates (several machines).",
        "SHOW/DECK",
        _COMMANDS,
    )
    stop_input: File | None = option(None, "A wired stop: a serial adapter, or /dev/input/eventN.", "DEVICE", _COMMANDS)
    lock_to: LockSource | None = option(
        None,
        "Lock loops to: beat (taps), body (wait while the joints are held), or another deck by its command port.",
        "SOURCE",
        _SWITCHING,
    )
    join: Literal["inertialise", "crossfade", "morph", "cut"] | None = option(
        None, "How motions are joined; default: what suits the network.", panel=_SWITCHING
    )
    check_collisions: bool = option(False, "Hold joints back where the robot's limbs would collide.", panel=_SIMULATION)

    @property
    def page_port(self) -> int | None:
        """The port of the page, 0 for a free one; None for no page."""
        if isinstance(self.page, bool):
            return 0 if self.page else None
        return self.page

    @property
    def rig_named(self) -> str:
        """The rig's file or name, also if its servos are emulated; empty without one."""
        return str(self.rig or "").removeprefix(f"{EMULATED}:")

    @property
    def drives_servos(self) -> bool:
        """Whether it has a rig that is not emulated; emulated servos are an ordinary process of the same machine."""
        return any(rig is not None and not is_emulated(rig) for rig in (self.rig, self.follow_rig))

    def check(self) -> None:
        """Refuses impossible values, and options that exclude or need each other: a MotiondeckError says what to do."""
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
            raise MotiondeckError(f"--listen {self.listen} needs --token-file FILE: else anybody could move the robot")


def options() -> dict[str, Option]:
    """The option of each field of `RunSpec`."""
    return {field.name: field.metadata["option"] for field in fields(RunSpec)}


@cache
def kinds() -> dict[str, Any]:
    """The type of each field of `RunSpec`."""
    hints = get_type_hints(RunSpec)
    return {field.name: hints[field.name] for field in fields(RunSpec)}
