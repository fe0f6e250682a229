"""Hostile but well-formed commands of every type, sent to running decks.

Names that are long, empty, unknown, full of control characters or paths of devices; numbers that are huge, tiny or on
the edge; commands inside commands at any time. After each thousand the emergency stop has to work and to be reset.
"""

from __future__ import annotations

import contextlib
import math
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.command import run
from controller.wire.command_socket import CommandClient
from controller.wire.local_transport import SocketError
from controller.wire.messages.arguments import Argument, Choice, Flag, Number, Text, WeightedMotions
from controller.wire.messages.command_table import COMMANDS
from controller.wire.messages.commands import (
    MOST_BYTES,
    AtTime,
    DeckCommand,
    EmergencyStop,
    GetStatus,
    LoadLibrary,
    Reset,
    Resume,
    SetTempo,
    Stop,
    Switch,
    Unlock,
    encode,
)
from controller.wire.messages.replies import Accepted, Refused, State
from motiondeck_base.shipped import find_library

NAMES = (
    "", " ", "\0", "walk\0", "a" * 100, "a" * 300, "ü" * 700, "💃" * 90, "\x1b[2J", "\u202e", "\n", "../" * 90, "%s%n",
    "-1", "nan", "estop", "walk jog", "None", "0", "/", ".", "~", "/dev/zero", "/dev/stdin", "/proc/1", "con",
)  # fmt: skip
KNOWN = ("walk", "jog", "waltz", "standup", "box1", "crawl", "r_elbow", "l_knee", "r_hip_pitch", "speed", "led")
FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 0.25, 1e-300, 5e-324, -5e-324, 1e300, -1.7e308, 1e15, 2**53 + 1.0, 1e-9, 3.0, 60.0)
INTEGERS = (0, 1, -1, 16, 255, 256, 65535, -32768, 2**31, -(2**31), 2**53, 2**63 - 1, -(2**63))
IN_FLIGHT = 8
EACH = 1000  # commands between two emergency stops
ANSWERED_WITHIN = 5.0  # s
RESET_WITHIN = 5.0  # s after the emergency stop: joints come to rest
STARTED_WITHIN = 60.0  # s
KNOWN_WITHIN = 0.5  # s from an emergency stop until the deck's status says so
MOVING = 0.5  # s before an emergency stop


class HostileCommands:
    """Commands of every type in turn, with arguments from a seeded source of bad taste; `stop` only where asked for."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._types = [row.message for row in COMMANDS if row.message is not Stop]

    def __iter__(self) -> Iterator[DeckCommand]:
        while True:
            for kind in self._random.sample(self._types, len(self._types)):
                yield self._command(kind, depth=0)

    def _command(self, kind: type[Any], depth: int) -> Any:
        if kind is AtTime:
            inner = self._random.choice([one for one in self._types if depth < 3 or one is not AtTime])
            when = self._random.choice([time.monotonic() + self._random.uniform(-1.0, 5.0), self._number()])
            return AtTime(when, self._command(inner, depth + 1))
        given = {
            one.field: self._value(one.argument)
            for one in kind.row.arguments
            if not one.optional or self._random.random() < 0.5
        }
        return kind(**given)

    def _value(self, argument: Argument) -> Any:
        choose = self._random.choice
        fair = self._random.random() < 0.5
        match argument:
            case Text():
                return choose(KNOWN) if fair else choose(NAMES)
            case Number(lowest=lowest, highest=highest, whole=whole):
                if whole:
                    return self._random.randint(int(lowest), int(highest)) if fair else choose(INTEGERS)
                return self._random.uniform(lowest, highest) if fair else self._number()
            case Flag():
                return fair
            case Choice(words=words):
                return choose(words)
            case WeightedMotions():
                return tuple((choose(KNOWN + NAMES), self._number()) for _ in range(self._random.randrange(4)))
            case _:
                raise AssertionError(f"{argument} is not known here")

    def _number(self) -> float:
        return self._random.choice(FLOATS) if self._random.random() < 0.8 else self._random.gauss(0.0, 10.0)


@dataclass
class Soaked:
    """What came of it.

    Attributes:
        sent, refused: commands by word.
        unanswered: commands without a reply, as they were sent.
        stopped_s, reset_s: from each emergency stop to its reply, and to the reset that was accepted, s.
        restarts: how often the deck has started again with a library.
        failures: whatever else went wrong.
    """

    sent: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    unanswered: list[str] = field(default_factory=list)
    stopped_s: list[float] = field(default_factory=list)
    reset_s: list[float] = field(default_factory=list)
    restarts: int = 0
    failures: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether all were answered, and every emergency stop worked."""
        return not self.unanswered and not self.failures

    def __str__(self) -> str:
        sent = self.sent.total()
        stopped_ms, reset_s = 1e3 * max(self.stopped_s, default=math.nan), max(self.reset_s, default=math.nan)
        lines = [
            f"{sent} commands of {len(self.sent)} types, {sent - len(self.unanswered)} answered, "
            f"{self.refused.total()} of them by a refusal",
            f"{len(self.stopped_s)} emergency stops, answered within {stopped_ms:.0f} ms, reset within {reset_s:.2f} s",
            f"started again with a library: {self.restarts}",
        ]
        return "\n".join([*lines, *(f"unanswered: {one}" for one in self.unanswered[:10]), *self.failures[:10]])


@contextmanager
def running_deck(*options: str) -> Iterator[tuple[subprocess.Popen[bytes], CommandClient, Path]]:
    """A deck with these options of `play`, a client that has had an answer, and the file of what it says."""
    number = random.SystemRandom().randrange(20_000, 60_000)
    with tempfile.TemporaryDirectory() as folder:
        said = Path(folder) / "said"
        with said.open("wb") as out:
            deck = subprocess.Popen(
                [sys.executable, "-m", "motiondeck", "play", "--command-port", str(number), *options],
                stdin=subprocess.DEVNULL, stdout=out, stderr=out, cwd=folder,
            )  # fmt: skip
        client = CommandClient(number, patience=2.0)
        try:
            _wait_for_deck(deck, client)
            yield deck, client, said
        finally:
            client.close()
            if deck.poll() is None:
                deck.terminate()
                try:
                    deck.wait(10.0)
                except subprocess.TimeoutExpired:
                    deck.kill()
                    deck.wait()


def _wait_for_deck(deck: subprocess.Popen[bytes], client: CommandClient) -> None:
    until = time.monotonic() + STARTED_WITHIN
    while True:
        try:
            client.request(GetStatus())
            return
        except SocketError:
            if deck.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.05)


def soak(
    deck: subprocess.Popen[bytes],
    client: CommandClient,
    commands: Iterator[DeckCommand],
    count: int,
    each: int = EACH,
    loads: int = 0,
) -> Soaked:
    """Sends `count` commands to a running deck, after each `each` an emergency stop, `loads` times a library too."""
    soaked = Soaked()
    stops = 0
    while soaked.sent.total() < count and deck.poll() is None:
        try:
            _flood(client, [next(commands) for _ in range(IN_FLIGHT)], soaked)
            if (mode := _mode(client)) in ("emergency stop", "held"):
                _release(client, soaked, braking=mode == "emergency stop")
            if soaked.sent.total() // each > stops:
                stops += 1
                _stop(client, soaked)
                if stops <= loads:
                    _load(client, LoadLibrary(str(find_library("thesis15")), "walk"), soaked)
        except SocketError as error:
            soaked.failures.append(f"after {soaked.sent.total()} commands: {error}")
            break
    if deck.poll() is not None:
        soaked.failures.append(f"the deck has ended with exit code {deck.returncode}")
    return soaked


def _flood(client: CommandClient, commands: Sequence[DeckCommand], soaked: Soaked) -> None:
    """Sends some commands at once, of which libraries come last and alone, and takes their replies."""
    open_: dict[int, DeckCommand] = {}
    for command in commands:
        if not isinstance(command, LoadLibrary):
            soaked.sent[command.row.word] += 1
            open_[client.post(command)] = command
    until = time.monotonic() + ANSWERED_WITHIN
    while open_ and (left := until - time.monotonic()) > 0.0:
        if (reply := client.receive(left)) is None:
            continue
        # One that is too long is not read, not even its number.
        number = reply.id or next((one for one, command in open_.items() if len(encode(command)) > MOST_BYTES - 20), 0)
        answered = open_.pop(number, None)
        if answered is not None and isinstance(reply, Refused):
            soaked.refused[answered.row.word] += 1
    soaked.unanswered += [repr(command)[:300] for command in open_.values()]
    for command in commands:
        if isinstance(command, LoadLibrary):
            _load(client, command, soaked)


def _load(client: CommandClient, load: LoadLibrary, soaked: Soaked) -> None:
    """Sends a library; where that is taken, the deck comes to rest, ends, and starts again."""
    soaked.sent["load"] += 1
    if isinstance(client.request(load, ANSWERED_WITHIN), Refused):
        soaked.refused["load"] += 1
        return
    soaked.restarts += 1
    until, began = time.monotonic() + STARTED_WITHIN, _clock(client)
    while time.monotonic() < until:
        with contextlib.suppress(SocketError):  # it is coming
            if _clock(client) < began:
                return
        time.sleep(0.02)
    soaked.failures.append(f"the deck has not started again with {load}")


def _clock(client: CommandClient) -> float:
    """The deck's clock, s, which begins anew with a run."""
    state = client.request(GetStatus(), ANSWERED_WITHIN)
    assert isinstance(state, State)
    return state.at


def _mode(client: CommandClient) -> str:
    state = client.request(GetStatus(), ANSWERED_WITHIN)
    assert isinstance(state, State)
    return state.mode


def _stop(client: CommandClient, soaked: Soaked) -> None:
    """Stops the deck in full motion, and resets it."""
    for command in (Resume(), Unlock(), SetTempo(1.0), Switch("jog", direct=True)):
        client.request(command, ANSWERED_WITHIN)
    time.sleep(MOVING)
    began = time.monotonic()
    reply = client.request(EmergencyStop())
    soaked.stopped_s.append(time.monotonic() - began)
    if not isinstance(reply, Accepted):
        soaked.failures.append(f"an emergency stop was answered with {reply}")
    # The guard of a rig takes the stop at once and tells the deck in its next tick.
    while (mode := _mode(client)) != "emergency stop" and time.monotonic() < began + KNOWN_WITHIN:
        time.sleep(0.005)
    if mode != "emergency stop":
        soaked.failures.append(f"{KNOWN_WITHIN} s after an emergency stop the deck is {mode}")
    if not isinstance(refused := client.request(Resume(), ANSWERED_WITHIN), Refused):
        soaked.failures.append(f"in an emergency stop `resume` was answered with {refused}")
    _release(client, soaked, braking=True)
    soaked.reset_s.append(time.monotonic() - began)


def _release(client: CommandClient, soaked: Soaked, *, braking: bool) -> None:
    """Resets when the joints are at rest, and lets them go on."""
    until = time.monotonic() + RESET_WITHIN
    while braking and isinstance(reply := client.request(Reset(), ANSWERED_WITHIN), Refused):
        if "not on" in reply.reason:
            break
        if time.monotonic() > until:
            soaked.failures.append(f"no reset within {RESET_WITHIN} s: {reply.reason}")
            return
        time.sleep(0.02)
    if isinstance(reply := client.request(Resume(), ANSWERED_WITHIN), Refused) and "is on" not in reply.reason:
        soaked.failures.append(f"after a reset `resume` was answered with {reply}")


DECKS = {
    "with page and emulated rig": ("walk", "--robot", "servo20", "--rig", "emulated", "--port", "0"),
    "headless": ("walk", "--headless"),
}


def main(
    commands: Annotated[int, typer.Option("--commands", help="How many, in all.")] = 20_000,
    seed: Annotated[int, typer.Option("--seed", help="Of what is sent.")] = 0,
) -> None:
    passed = True
    for name, options in DECKS.items():
        with running_deck(*options) as (deck, client, said):
            soaked = soak(deck, client, iter(HostileCommands(seed)), commands // len(DECKS), loads=2)
            print(f"{name}: {soaked}")
            if not soaked.passed:
                print(said.read_text(errors="replace")[-2000:])
            passed = passed and soaked.passed
    raise typer.Exit(0 if passed else 1)


if __name__ == "__main__":
    run("hostile", main, __doc__)
