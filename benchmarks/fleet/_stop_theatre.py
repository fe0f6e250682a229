"""A show of four decks and a conductor as processes, each in a network namespace, and what is done to it.

Everything that is done is noted with its times; the decks record their ticks. `_stop_judge` compares the two.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from benchmarks.fleet._network import Network, address, namespace
from benchmarks.fleet._show_mutants import MUTANTS
from benchmarks.fleet._stop_judge import CONDUCTOR, DECKS, NETWORK, Event
from controller.wire.command_socket import CommandClient, SocketError
from controller.wire.messages.commands import DeckCommand, EmergencyStop, GetStatus, Reset, Resume
from controller.wire.messages.replies import Accepted, Reply, State
from motiondeck.shows.certificates import make_certificates

SHOW = """
show = "gala"
if_lost = "{lost}"
lost_after = {after}
decks = ["a", "b", "c", "d"]
"""

RATE = 50.0

LOST_AFTER = 1.0
"""Time without the conductor after which a deck does what the show file says, s."""

_PORTS = dict(zip(DECKS, range(7301, 7305), strict=True))
_PAGE_PORT = 8060
_PATIENCE = 1.0  # s for an answer of a deck


class StopTheatre:
    """The members of a show.

    Attributes:
        done: what was done, in the order of time.
        reports: how long after a stop the conductor has said which decks it has reached, s.
        cut, parted: the members whose links are cut, and pairs without the link between them.
        frozen: the process of each deck that takes part in the show and is stopped.
    """

    def __init__(self, folder: Path, net: Network, number: int, lost: str, mutant: str) -> None:
        self.folder, self.net, self.number, self.lost = folder, net, number, lost
        self.members = [CONDUCTOR, *DECKS]
        make_certificates(
            folder / "gala", "gala", {name: address(place, number) for place, name in enumerate(self.members)}
        )
        (folder / "gala.toml").write_text(SHOW.format(lost=lost, after=LOST_AFTER))
        (folder / "run").mkdir(mode=0o700)
        os.environ["XDG_RUNTIME_DIR"] = str(folder / "run")
        self._environment = {**os.environ}
        if mutant:
            broken = Path(__file__).parent / "mutated"
            self._environment |= {"MUTATED": json.dumps(MUTANTS[mutant]), "PYTHONPATH": f"{broken}:{Path.cwd()}"}
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.done: list[Event] = []
        self.reports: list[float] = []
        self.cut: set[str] = set()
        self.parted: list[tuple[str, str]] = []
        self.frozen: dict[str, int] = {}
        self._takes = dict.fromkeys(DECKS, 0)
        self._starting: set[str] = set()
        self._page_port = _PAGE_PORT

    # Members.

    def start(self, name: str) -> None:
        """Starts a deck or the conductor; `settle_starts` notes when it takes part."""
        self.note("start", name)
        if name == CONDUCTOR:
            self._page_port += 1  # the page of a killed conductor may have the other one still
            page = "--port", str(self._page_port)
            certificates = "--certificates", str(self.folder / "gala" / CONDUCTOR)
            words = ("conduct", str(self.folder / "gala.toml"), *certificates, *page, "--json")
        else:
            self._takes[name] += 1
            record = "--record", str(self.recordings(name)[-1])
            options = ("--headless", "--kinematic", "--robot", "servo20", "--rate", f"{RATE:g}", *record)
            words = ("play", "walk", *options, "--command-port", str(_PORTS[name]))
            words += ("--show", str(self.folder / "gala" / name))
        self._starting.add(name)
        self.processes[name] = self._run(name, *words)

    def recordings(self, name: str) -> list[Path]:
        """The recordings of a deck, one for each time it was started."""
        return [self.folder / f"{name}.{take}.rec" for take in range(1, self._takes[name] + 1)]

    def settle_starts(self) -> set[str]:
        """Notes the members that have come to take part; those that are still starting."""
        for name in [*self._starting]:
            if self.status(name) is not None if name != CONDUCTOR else b'"at"' in self._log(name):
                self._starting.discard(name)
                self.note("started", name)
        return self._starting

    def kill(self, name: str) -> None:
        """Kills a member with all its processes."""
        process = self.processes.pop(name)
        if (frozen := self.frozen.pop(name, None)) is not None:
            os.kill(frozen, signal.SIGKILL)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        self._starting.discard(name)
        if name == CONDUCTOR:
            self._take_reports()
        (self.folder / f"{name}.log").unlink()
        self.note("killed", name)

    def runs(self, name: str) -> bool:
        """Whether a member takes part, as far as is known."""
        return name in self.processes and name not in self._starting

    def _run(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        command = ["ip", "netns", "exec", namespace(self.members.index(name), self.number)]
        command += [sys.executable, "-m", "motiondeck", *words]
        with (self.folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def _log(self, name: str) -> bytes:
        return (self.folder / f"{name}.log").read_bytes()

    def freeze(self, name: str) -> None:
        """Stops the process through which a deck takes part in the show."""
        deck = self.processes[name].pid
        children = Path(f"/proc/{deck}/task/{deck}/children").read_text().split()
        process = next(int(child) for child in children if b"member_process" in _command_line(child))
        os.kill(process, signal.SIGSTOP)
        self.frozen[name] = process
        self.note("freeze", name)

    def thaw(self, name: str) -> None:
        """Lets it go on."""
        os.kill(self.frozen.pop(name), signal.SIGCONT)
        self.note("thaw", name)

    # Links.

    def cut_link(self, name: str) -> None:
        """Cuts all links of a member."""
        self.net.cut(self.members.index(name))
        self.cut.add(name)
        self.note("cut", name)

    def heal_link(self, name: str) -> None:
        """Restores them."""
        self.net.heal(self.members.index(name))
        self.cut.discard(name)
        self.note("heal", name)

    def part(self, one: str, other: str) -> None:
        """Cuts the link between two members."""
        self.net.part(self.members.index(one), self.members.index(other))
        self.parted.append((one, other))
        self.note("part", f"{one} {other}")

    def join(self, one: str, other: str) -> None:
        """Restores it."""
        self.net.join(self.members.index(one), self.members.index(other))
        self.parted.remove((one, other))
        self.note("join", f"{one} {other}")

    def weather(self, loss: float, delay_ms: float) -> None:
        """Sets the share of packets that are lost, each way, and the delay of the others."""
        self.net.loss(loss)
        self.net.delay(delay_ms)
        self.note(f"loss {loss:g}, {delay_ms:g} ms", NETWORK)

    # The emergency stop.

    def press_at(self, name: str) -> None:
        """Presses at a deck, with `motiondeck send estop`."""
        began = time.monotonic()
        command = [sys.executable, "-m", "motiondeck", "send", "estop", "--command-port", str(_PORTS[name])]
        if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0:
            self.note("press", name, began)

    def send_stop(self, name: str) -> None:
        """Presses at a deck, from this process."""
        began = time.monotonic()
        if isinstance(self.ask(name, EmergencyStop()), Accepted):
            self.note("press", name, began)

    def type_stop(self) -> None:
        """Types `stop` at the conductor."""
        began = time.monotonic()
        self.type("stop")
        self.note("press", CONDUCTOR, began)

    def press_on_page(self) -> None:
        """Presses the button of the conductor's page."""
        began = time.monotonic()
        if self._beside_conductor("_page_press", str(self._page_port)):
            self.note("press", CONDUCTOR, began)

    def send_wrong_cue(self) -> None:
        """Sends a cue that resets all decks and lets them go on, from a program with the conductor's certificates."""
        began = time.monotonic()
        self._beside_conductor("_wrong_cue", str(self.folder / "gala" / CONDUCTOR))
        self.note("wrong cue", NETWORK, began)

    def _beside_conductor(self, module: str, *words: str) -> bool:
        """Runs a program in the conductor's namespace; whether it has succeeded."""
        command = ["ip", "netns", "exec", namespace(0, self.number)]
        command += [sys.executable, "-c", f"from benchmarks.fleet.{module} import main; main()", *words]
        return subprocess.run(command, stderr=subprocess.DEVNULL).returncode == 0

    def reset(self, name: str) -> bool:
        """Resets a deck where it stands, and lets it play on; whether it was in the emergency stop."""
        began = time.monotonic()
        reset = isinstance(self.ask(name, Reset()), Accepted)
        if reset:
            self.note("reset", name, began)
        self.ask(name, Resume())
        return reset

    def go(self) -> bool:
        """Types `go` at the conductor, and notes it if the emergency stop is over by that; whether none stands."""
        began = time.monotonic()
        said = self._answer("go")
        if b"the emergency stop is over" in said:
            self.note("over", CONDUCTOR, began)
        return bool(said) and b"first reset" not in said

    def linked(self) -> bool:
        """Whether the conductor hears all decks; notes it."""
        lines = [line for line in self._answer("status").splitlines() if b'"decks"' in line]
        decks = json.loads(lines[-1])["decks"] if lines else {}
        linked = len(decks) == len(DECKS) and all(deck["here"] and deck["health"] for deck in decks.values())
        if linked:
            self.note("linked", CONDUCTOR)
        return linked

    def _answer(self, line: str) -> bytes:
        """What the conductor says to a typed line, at once."""
        before, until = len(self._log(CONDUCTOR)), time.monotonic() + 0.5
        self.type(line)
        while not (said := self._log(CONDUCTOR)[before:]).endswith(b"\n") and time.monotonic() < until:
            time.sleep(0.01)
        return said

    def type(self, line: str) -> None:
        """Types at the conductor."""
        stdin = self.processes[CONDUCTOR].stdin
        assert stdin is not None
        with suppress(OSError):
            stdin.write(line.encode() + b"\n")
            stdin.flush()

    # Decks.

    def status(self, name: str) -> State | None:
        """The state of a deck; None without an answer."""
        reply = self.ask(name, GetStatus())
        return reply if isinstance(reply, State) else None

    def ask(self, name: str, message: DeckCommand) -> Reply | None:
        """The answer of a deck, or None."""
        try:
            with closing(CommandClient(_PORTS[name])) as client:
                return client.request(message, _PATIENCE)
        except SocketError:
            return None

    def note(self, what: str, name: str, began: float | None = None) -> None:
        """Notes what was done, just now or since `began`."""
        now = time.monotonic()
        self.done.append(Event(now if began is None else began, now, what, name))

    def _take_reports(self) -> None:
        """Notes how long after each stop the conductor has said which decks it has reached."""
        stopped = math.nan
        for line in self._log(CONDUCTOR).splitlines():
            said: dict[str, Any] = json.loads(line) if line.startswith(b'{"at"') else {"text": ""}
            if said["text"].startswith("emergency stop by"):
                stopped = said["at"]
            elif said["text"].startswith("the emergency stop has") and not math.isnan(stopped):
                self.reports.append(said["at"] - stopped)
                stopped = math.nan

    def close(self) -> None:
        """Ends all processes; the recordings are complete afterwards."""
        self._take_reports()
        for process in self.processes.values():
            os.killpg(process.pid, signal.SIGTERM)
        for process in self.processes.values():
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


def _command_line(process: str) -> bytes:
    return Path(f"/proc/{process}/cmdline").read_bytes()
