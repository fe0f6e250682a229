"""`motiondeck conduct`: conducts a show of many decks; `--stop` stops all of them."""

from __future__ import annotations

import json
import os
import select
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
from typer import Argument, Option

from motiondeck.cli.common.options import SHOW_PAGE_PORT
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.words import counted, printable

if TYPE_CHECKING:
    from motiondeck.shows.conductor import Conductor, Notify
    from motiondeck.shows.link import Link
    from motiondeck.shows.membership import Membership
    from motiondeck.shows.show_state import DeckRow, ShowNotice, ShowState

_HELP = "go | hold | stop (emergency stop of all) | status | DECK or GROUP COMMAND, such as: all pause | quit"
_WITHOUT = {"go on": "play on", "hold": "pause until one is there", "stop": "make an emergency stop"}
_STOPS: dict[str, str] = {
    "": "",
    "not reached": "THE STOP HAS NOT REACHED IT (or its motiondeck is older); ",
    "holds": "holds the emergency stop; ",
    "reset": "reset, waits for go; ",
}
_STOP_WITHIN = 3.0  # s for decks to be found and to say that they have stopped
_STOP_AT_LEAST = 1.0  # s for those that are found later than the first
_MOST_BYTES = 256  # of a word of the page
_PAGE_EVERY = 0.2  # s between two states for the page


def conduct(
    file: Annotated[Path, Argument(metavar="SHOW.toml", help="The show file.")],
    certificates: Annotated[
        Path | None, Option(metavar="FOLDER", help="Conductor's folder of `fleet certificates`, for decks elsewhere.")
    ] = None,
    begin_at: Annotated[str | None, Option("--from", metavar="CUE", help="Begin at this cue (name or number).")] = None,
    stop: Annotated[bool, Option("--stop", help="Emergency stop of all decks, with or without a conductor.")] = False,
    page_port: Annotated[
        int, Option("--port", metavar="PORT", help="The page's port on 127.0.0.1; 0 for any free one.")
    ] = SHOW_PAGE_PORT,
    headless: Annotated[bool, Option("--headless", help="No page.")] = False,
    as_json: Annotated[bool, Option("--json", help="Print what happens as JSON objects, one a line.")] = False,
) -> None:
    """Conduct a show of several decks, which take its cues together.

    The decks are started with `play --show`. The page shows the cue list and every deck, with buttons for `go`, `hold`
    and the emergency stop of all decks. Or type `go` at hold points, `stop` for that emergency stop, `status`, or a
    deck or group and a command. Decks on this machine are found by themselves. Needs the extra `fleet`: pip install
    "motiondeck\\[fleet]".

    [bold]Examples[/]

      motiondeck conduct gala.toml
      motiondeck conduct gala.toml --stop
    """
    from motiondeck.shows.conductor import Conductor
    from motiondeck.shows.cue_list import cue_named
    from motiondeck.shows.link import Link
    from motiondeck.shows.show_file import read_show

    show = read_show(file)
    first = cue_named(show.cues, begin_at) if begin_at is not None else 0
    member = _member(show.show, file, certificates, listens=not stop)
    if stop:
        _stop_all(Link(member), show.decks)
        return
    began = time.monotonic()

    def notify(text: str) -> None:
        at = time.monotonic() - began
        line = json.dumps({"at": round(at, 3), "text": text}) if as_json else f"{at:7.2f} {printable(text)}"
        print(line, flush=True)

    with ExitStack() as opening:
        page = opening.enter_context(show_page(page_port)) if not headless else None
        conductor = opening.enter_context(closing(Conductor(show, Link(member), notify, first)))
        notify(f"{show.show}: {counted(len(show.cues), 'cue')}; {_HELP}")
        try:
            _converse(conductor, notify, page, as_json=as_json)
            return
        except KeyboardInterrupt:
            pass
    sys.exit(130)


def _member(show: str, file: Path, certificates: Path | None, *, listens: bool) -> Membership:
    from motiondeck.shows.membership import CONDUCTOR, on_this_machine, with_certificates

    if certificates is None:
        return on_this_machine(show, CONDUCTOR if listens else f"stop-{os.getpid()}", listens=listens)
    member = with_certificates(certificates, listens=listens)
    if member.show != show:
        raise FileFormatError(f"{file}: show = '{show}', but certificates in {certificates} are for '{member.show}'")
    if member.name != CONDUCTOR:
        raise MotiondeckError(f"{certificates}: these are the certificates of '{member.name}', not of the conductor")
    return member


class ShowPage:
    """The process of a show's page: receives the state of the show, and sends its buttons as typed words.

    A pair of connected sockets leads there and back. Nothing listens for either, no other program can find them, and
    each side notices at once when the other has ended. Neither waits: what there is no room for is dropped.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._connection = connection

    def fileno(self) -> int:
        """Readable when a button was pressed, for `select`."""
        return self._connection.fileno()

    def words(self) -> Iterator[str]:
        """The words of its buttons; raises an EOFError if the page has ended."""
        try:
            while data := self._connection.recv(_MOST_BYTES):
                yield data.decode(errors="replace")
        except BlockingIOError:
            return
        except ConnectionResetError:
            pass  # it was killed, and has not read a state
        raise EOFError

    def show(self, news: ShowState | ShowNotice) -> None:
        """Sends a state or a notice."""
        with suppress(OSError):
            self._connection.send(msgspec.json.encode(news))


@contextmanager
def show_page(port: int) -> Iterator[ShowPage]:
    """The page while the block runs, on 127.0.0.1, at any free port for 0; MotiondeckError if the port is taken."""
    from motiondeck.run.beside.child_process import child_process, free_port

    port = free_port(port)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs, child_process("motiondeck.page.show.viewer", str(port), stdin=theirs.fileno(), own_session=True):
        theirs.close()
        with ours:
            yield ShowPage(ours)


def _converse(conductor: Conductor, notify: Notify, page: ShowPage | None, *, as_json: bool) -> None:
    """Runs the show with commands from keyboard and page until `quit`; it goes on when either ends."""
    from motiondeck.shows.show_state import show_state

    keyboard = sys.stdin.fileno() if sys.stdin is not None else None
    typed, wait, page_at = b"", 0.0, 0.0
    while True:
        inputs = [conductor, *(source for source in (keyboard, page) if source is not None)]
        ready, _, _ = select.select(inputs, [], [], wait)
        if page is not None and page in ready and not receive_from_page(conductor, page, notify):
            page = None
        if keyboard is not None and keyboard in ready:
            data = os.read(keyboard, 4096)
            if not data:
                keyboard = None
            *lines, typed = (typed + data).split(b"\n")
            for line in lines:
                if not carry_out(conductor, line.decode(errors="replace").strip(), notify, as_json=as_json):
                    return
        wait = conductor.step()
        if page is not None and time.monotonic() >= page_at:
            page_at = time.monotonic() + _PAGE_EVERY
            page.show(show_state(conductor))


def receive_from_page(conductor: Conductor, page: ShowPage, notify: Notify) -> bool:
    """Carries out the buttons of the page as typed words, and reports the outcome; False if it has ended."""
    from motiondeck.shows.show_state import ShowNotice

    def notify_both(text: str) -> None:
        notify(text)
        page.show(ShowNotice(text))

    try:
        for word in page.words():
            carry_out(conductor, word, notify_both, as_json=False)
    except EOFError:
        notify("the page has ended; the show goes on")
        return False
    return True


def carry_out(conductor: Conductor, line: str, notify: Notify, *, as_json: bool) -> bool:
    """Carries out a typed line; False to end."""
    from controller.wire.messages.command_table import BY_WORD

    words = line.split()
    match words:
        case []:
            pass
        case ["quit"]:
            show = conductor.show
            notify(f"ended; after {show.lost_after:g} s without a conductor decks {_WITHOUT[show.if_lost]} (if_lost)")
            return False
        case ["go"]:
            notify(conductor.go())
        case ["hold"]:
            notify(conductor.hold())
        case ["stop"] | ["estop"]:
            conductor.stop()
        case ["status"]:
            _show_status(conductor, as_json=as_json)
        case ["help"]:
            notify(_HELP)
        case [word, *_] if word in BY_WORD and not _are_decks(conductor, word):
            notify(f"for which decks? For example: all {line}")
        case [names] if _are_decks(conductor, names):
            notify(f"what is {names} to do? For example: {names} pause")
        case [names, *command] if command:
            try:
                notify(conductor.command(names.split(","), " ".join(command)))
            except MotiondeckError as error:
                notify(str(error))
        case _:
            notify(f"'{line}' is nothing to do here: {_HELP}")
    return True


def _are_decks(conductor: Conductor, names: str) -> bool:
    show = conductor.show
    return {*names.split(",")} <= {"all", *conductor.decks, *show.decks, *show.groups}


def _show_status(conductor: Conductor, *, as_json: bool) -> None:
    from motiondeck.page.show.show_text import show_line
    from motiondeck.shows.show_state import show_state

    state = show_state(conductor)
    if as_json:
        decks = {row.name: {"here": row.here, "stop": row.stop, "health": row.health} for row in state.decks}
        cues = {"present": state.present, "upcoming": state.upcoming}
        status = {name: None if cue is None else conductor.cue_name(cue) for name, cue in cues.items()}
        status |= {"seconds": state.seconds, "waits": state.waits, "stopped_by": state.stopped_by, "decks": decks}
        print(msgspec.json.encode(status).decode(), flush=True)
        return
    shown = show_line(state)
    print(f"        {'; '.join(filter(None, (f'{shown.word} {shown.played}', shown.upcoming)))}", flush=True)
    for deck in state.decks:
        print(f"        {deck.name:12} {_describe(deck)}", flush=True)


def _describe(deck: DeckRow) -> str:
    health = deck.health
    if not deck.here:
        return "gone" if deck.losses else "not here yet"
    if health is None:
        return "says nothing yet"
    doing = f"{'switching to' if health.switching else 'paused in' if health.paused else 'plays'} {health.motion}"
    mode = _STOPS[deck.stop] or ("" if health.mode == "playing" else f"{health.mode}; ")
    lock = f", {health.lock}" if health.lock else ""
    clock = "clock unknown"
    if health.clock is not None:
        clock = f"clock ±{health.clock.uncertainty_ms:.2f} ms, drift {health.clock.drift_ppm:+.0f} ppm"
    return f"{mode}{doing}{lock}; {clock}" + (f"; {health.problem}" if health.problem else "")


def _stop_all(link: Link, decks: list[str]) -> None:
    """Stops all decks that are found and those of the show file; reports each that has stopped, and which have not."""
    from motiondeck.shows.conductor import STOP_REPORTED_AFTER
    from motiondeck.shows.link import STOP_AGAIN
    from motiondeck.shows.messages import DeckHealth, EmergencyStopAll, encode, read

    stop = EmergencyStopAll("conduct --stop", os.urandom(8).hex())
    here = {*decks}
    reached: set[str] = set()

    def heard(key: str, data: bytes) -> None:
        health, name = read(data, DeckHealth), key.removeprefix("health/")
        if health is not None and name not in reached and any(known.id == stop.id for known in health.stops):
            reached.add(name)
            print(f"{name}: emergency stop", flush=True)

    link.subscribe("health/*", heard)
    link.watch("deck/*", lambda key, _: here.add(key.removeprefix("deck/")))
    began, lacking = time.monotonic(), ""
    try:
        while (waited := time.monotonic() - began) < _STOP_WITHIN:
            link.publish("stop", encode(stop))
            time.sleep(STOP_AGAIN)
            missing = ", ".join(sorted({*here} - reached))
            if reached and not missing and waited > _STOP_AT_LEAST:
                return
            if missing != lacking and waited > STOP_REPORTED_AFTER:
                lacking = missing
                print(f"not stopped yet: {missing}" if missing else "all are stopped", flush=True)
    finally:
        link.close()
    if lacking:
        raise MotiondeckError(f"no emergency stop is reported by: {lacking}")
    if not reached:
        raise MotiondeckError("no deck of the show is reached")
