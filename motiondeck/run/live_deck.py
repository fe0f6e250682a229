"""A deck for a program that plays it from Python: `motiondeck.play` starts this module as a process of its own.

The request comes as one JSON object on the command line. The answers are JSON lines on standard output: first `Ready`
or `Failed`, in the end `Ended`. Commands come over the command socket. Standard input stays open as long as the program
lives; when it closes, or the program has ended, the joints come to rest and the process ends.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from controller.wire.messages.commands import CommandError
from motiondeck_base.errors import MotiondeckError

_LOOKS_EVERY = 0.5  # s

T = TypeVar("T", bound=msgspec.Struct)


class LiveRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is to be played.

    Attributes:
        library: a shipped library, or a library file.
        motion: what is played first, or None for the library's own choice.
        robot: a shipped robot, or a robot file.
        rig: a shipped rig, a rig file, "emulated", or None.
        rate: ticks of the loop a second, Hz.
        physics: whether the simulated robot has servos and masses.
        root: what holds it: gantry, fixed or free.
        balance: whether a free robot keeps its balance.
        walk: whether it walks on its own feet.
        page_port: where the page is; 0 for a free port, None for no page.
        command_port: where commands come in; 0 for a free port.
        seconds: how long to play, or None.
        record: the file in which every tick is recorded, or None.
        lock_to: what the phase is locked to; see `RunSettings`.
        outputs: outputs of other packages; see `RunSettings`.
    """

    library: str
    motion: str | None
    robot: str
    rig: str | None
    rate: float
    physics: bool
    root: str
    balance: bool
    walk: bool
    page_port: int | None
    command_port: int
    seconds: float | None
    record: str | None
    lock_to: str | None = None
    outputs: tuple[str, ...] = ()


def with_right_types(given: T) -> T:
    """A request or a message as it was given, if its arguments are of their types; a number may be of any type.

    Raises:
        CommandError: if one is not, in one line: "rate: expected float, got str".
    """
    try:
        names = zip(given.__struct_encode_fields__, given.__struct_fields__, strict=True)
        return msgspec.convert({sent: _plain(getattr(given, name)) for sent, name in names}, type(given))
    except msgspec.ValidationError as error:
        reason, _, place = str(error).replace("`", "").partition(" - at $.")
        if choices := get_args(get_type_hints(type(given)).get(place)):
            reason = f"'{getattr(given, place)}' is none of {', '.join(map(str, choices))}"
        raise CommandError(f"{place}: {reason[:1].lower()}{reason[1:]}") from None


def _plain(value: object) -> object:
    """A number of numpy or another library as Python's own; anything else as it is."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)


class Ready(msgspec.Struct, frozen=True, tag="ready"):
    """Everything is open, and commands are taken on this port; the page's, if there is one."""

    command_port: int
    page_port: int | None
    motions: list[str]


class Failed(msgspec.Struct, frozen=True, tag="failed"):
    """It could not begin, and why."""

    reason: str


class Ended(msgspec.Struct, frozen=True, tag="ended"):
    """The report of the run, as `motiondeck play --json` prints it."""

    report: dict[str, Any]


LiveNews = Ready | Failed | Ended


def play_live(request: LiveRequest) -> None:
    """Plays what is wanted until it is stopped.

    Raises:
        MotiondeckError: if it cannot begin.
    """
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here, and MuJoCo starts sooner without OpenGL
    from controller.deck.deck import Deck
    from controller.library.motion_library import load_library
    from motiondeck.run.robots.robot_on_deck import open_robots
    from motiondeck.run.run_settings import RunSettings
    from motiondeck.run.session import Session
    from motiondeck.run.setup import check_seconds, checked_rate, first_motion, robot_setup
    from motiondeck_base.shipped import find_library

    check_seconds(request.seconds)
    library_file = find_library(request.library)
    library = load_library(library_file)
    first = first_motion(library, request.motion)
    checked_rate(library, first, request.rate)
    held = {"root": request.root, "balance": request.balance, "walk": request.walk}
    setup = robot_setup(request.robot, request.rig, physics=request.physics, **held)
    settings = RunSettings(
        rate=request.rate,
        command_port=request.command_port,
        page_port=request.page_port,
        seconds=request.seconds,
        record=Path(request.record) if request.record is not None else None,
        lock_to=request.lock_to,
        outputs=request.outputs,
        library=library_file,
    )
    with Session(
        library,
        lambda opening: open_robots(opening, [setup], library, request.rate),
        lambda retarget: Deck(library, retarget, first),
        settings,
    ) as session:
        _send(Ready(session.command_port, session.page_port, list(library.network.motions)))
        report = session.run()
    _send(Ended(report))


def _stop_with_parent() -> None:
    """Asks for a controlled stop when standard input closes, or the parent has ended and its forks keep it open."""
    parent, stdin = os.getppid(), sys.stdin.fileno()

    def wait() -> None:
        while os.getppid() == parent:
            # not sys.stdin.read, whose lock would be held at exit
            if select.select([stdin], [], [], _LOOKS_EVERY)[0] and not os.read(stdin, 4096):
                break
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True).start()


def _send(news: LiveNews) -> None:
    try:
        sys.stdout.buffer.write(msgspec.json.encode(news) + b"\n")
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        sys.stdout = None  # nobody reads any more, and Python must not try again at exit


def main() -> int:
    """Plays the request on the command line; 0 when it ended as it should, 1 when it could not begin."""
    request = msgspec.json.decode(sys.argv[1], type=LiveRequest)
    _stop_with_parent()
    try:
        play_live(request)
    except MotiondeckError as error:
        _send(Failed(str(error)))
        return 1
    return 0


if __name__ == "__main__":
    # Two BLAS threads cost a loop eight milliseconds at p99; this must be set before numpy is imported.
    for _library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
    sys.exit(main())
