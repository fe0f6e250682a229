"""The process of a live deck: `motiondeck.play` starts this module.

The spec comes as one JSON object on the command line. The answers are JSON lines on standard output: first `Ready`
or `Failed`, in the end `Ended`. Commands come over the command socket. Standard input stays open as long as the program
lives; when it closes, or the program has ended, the joints come to rest and the process ends.
"""

import os
import select
import signal
import sys
import threading
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from controller.wire.messages.arguments import CommandError
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.whole_lines import print_whole_lines

_CHECK_EVERY = 0.5  # s

T = TypeVar("T", bound="msgspec.Struct | RunSpec")


def with_right_types(given: T) -> T:
    """A spec or a message as it was given, if its values are of their types; a number may be of any type.

    CommandError if one is not, in one line: "rate: expected float, got str".
    """
    if isinstance(given, msgspec.Struct):
        names = dict(zip(given.__struct_encode_fields__, given.__struct_fields__, strict=True))
    else:
        names = {field.name: field.name for field in fields(given)}
    try:
        return msgspec.convert({sent: _plain(getattr(given, name)) for sent, name in names.items()}, type(given))
    except msgspec.ValidationError as error:
        reason, _, place = str(error).replace("`", "").partition(" - at $.")
        if choices := get_args(get_type_hints(type(given)).get(place)):
            reason = f"'{getattr(given, place)}' is none of {', '.join(map(str, choices))}"
        raise CommandError(f"{place}: {reason[:1].lower()}{reason[1:]}") from None


def _plain(value: object) -> object:
    """A number of numpy or another library as Python's own, a path as a string; anything else as it is."""
    if isinstance(value, Path):
        return str(value)
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


LiveMessage = Ready | Failed | Ended


def _stop_with_parent() -> None:
    """Asks for a controlled stop when standard input closes, or the parent has ended and its forks keep it open."""
    parent, stdin = os.getppid(), sys.stdin.fileno()

    def wait() -> None:
        while os.getppid() == parent:
            # not sys.stdin.read, whose lock would be held at exit
            if select.select([stdin], [], [], _CHECK_EVERY)[0] and not os.read(stdin, 4096):
                break
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True).start()


def _send(news: LiveMessage) -> None:
    try:
        sys.stdout.buffer.write(msgspec.json.encode(news) + b"\n")
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        sys.stdout = None  # the reader is gone, and Python must not try again at exit


def main() -> int:
    """Plays the spec on the command line; 0 when it ended as it should, 1 when it could not begin."""
    spec = msgspec.json.decode(sys.argv[1], type=RunSpec)
    _stop_with_parent()
    print_whole_lines()
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here, and MuJoCo starts sooner without OpenGL
    try:
        from motiondeck.run.library_run import library_run
        from motiondeck.run.spec.program import Program

        with library_run(spec, Program.of(spec)) as session:
            _send(Ready(session.command_port, session.page_port, list(session.deck.motions)))
            report = session.run()
        _send(Ended(report))
    except MotiondeckError as error:
        _send(Failed(str(error)))
        return 1
    return 0


if __name__ == "__main__":
    # Two BLAS threads cost a loop eight milliseconds at p99; this must be set before numpy is imported.
    for _library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
    sys.exit(main())
