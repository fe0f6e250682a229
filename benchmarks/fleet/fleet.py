"""A show in network namespaces: delay, loss, drifting clocks, strangers.

Every deck is `motiondeck play` in a namespace of its own, with a steady clock of its own (offset, and a drift between
-100 and +100 ppm) that all its processes see. Everything is judged by the decks' own recordings, put on one clock.
Beside them two strangers try all the time: a zenoh peer without certificates, and one with those of another authority.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.command import run
from benchmarks.fleet._idle_watch import idle_watch, stalls
from benchmarks.fleet._network import Network, address, namespace, network
from benchmarks.fleet._recorded_decks import RecordedDeck, apart_ms, in_step_since, longest_beyond, undisturbed
from motiondeck.shows.certificates import make_certificates

SHOW = """
show = "gala"
if_lost = "{lost}"

[[cues]]
name = "opening"
when = "here"
say = "switch jog"
in_step = true
"""

_STEP = 0.01  # s from one comparison of phases to the next

# Says an emergency stop and a cue again and again with whatever it can open, and prints what it hears.
STRANGER = """
import json, sys, time, zenoh
config = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    config.insert_json5(key, json.dumps(value))
session, heard = zenoh.open(config), []
session.declare_subscriber("**", lambda sample: heard.append(1), allowed_origin=zenoh.Locality.REMOTE)
while True:
    for key in ("stop", "cue"):
        session.put("motiondeck/gala/" + key, b'{"by": "stranger", "id": "1"}' if key == "stop" else b"stranger")
    peers = len(session.info.peers_zid())
    print(peers, len(heard), flush=True)
    time.sleep(0.5)
"""


class Theatre:
    """The members of a show, each in its namespace; number 0 is the conductor."""

    def __init__(self, folder: Path, decks: int, rate: float, net: Network, lost: str) -> None:
        self.folder, self.rate, self.net, self.count = folder, rate, net, decks
        names = ["conductor", *(f"deck-{number}" for number in range(1, decks + 1))]
        addresses = {name: address(number) for number, name in enumerate(names)}
        make_certificates(folder / "gala", "gala", addresses)
        stranger = {**addresses, "stranger": address(decks + 1)}
        make_certificates(folder / "other", "gala", stranger)
        (folder / "show.toml").write_text(SHOW.format(lost=lost))
        drifts = np.linspace(-100, 100, decks).round()
        self.clocks = {0: (0.0, 0), **{n: (1000.0 * n, int(drifts[n - 1])) for n in range(1, decks + 1)}}
        self.processes: dict[int, subprocess.Popen[str]] = {}
        self.strangers: list[subprocess.Popen[str]] = []
        self.takes: dict[int, int] = {}

    def start_deck(self, number: int) -> None:
        """Starts a deck; what it records is its next take."""
        take = self.takes[number] = self.takes.get(number, 0) + 1
        words = ("play", "walk", "--headless", "--kinematic", "--realtime", "--rate", str(self.rate))
        show = ("--show", str(self.folder / "gala" / f"deck-{number}"))
        self.processes[number] = self._start(number, *words, *show, "--record", str(self.recording(number, take)))

    def start_conductor(self, *more: str) -> None:
        """Starts the conductor."""
        words = ("conduct", str(self.folder / "show.toml"), "--certificates", str(self.folder / "gala" / "conductor"))
        self.processes[0] = self._start(0, *words, "--headless", "--json", *more)

    def start_strangers(self) -> None:
        """Starts those that do not belong to the show."""
        others = [f"tls/{address(number)}:7447" for number in range(self.count + 1)]
        plain = [place.replace("tls", "tcp") for place in others]
        folder = self.folder / "other" / "stranger"
        certificates = {
            "root_ca_certificate": str(folder / "authority.pem"),
            "connect_certificate": str(folder / "certificate.pem"),
            "connect_private_key": str(folder / "key.pem"),
            "enable_mtls": True,
        }
        same = {"connect/timeout_ms": 0, "connect/exit_on_failure": False, "listen/endpoints": []}
        for more in ({"connect/endpoints": plain}, {"connect/endpoints": others, "transport/link/tls": certificates}):
            command = ["ip", "netns", "exec", namespace(self.count + 1), sys.executable, "-c", STRANGER]
            self.strangers.append(
                subprocess.Popen([*command, json.dumps(same | more)], stdout=subprocess.PIPE, text=True)
            )

    def _start(self, number: int, *words: str) -> subprocess.Popen[str]:
        offset, ppm = self.clocks[number]
        runtime = self.folder / f"run-{number}"
        runtime.mkdir(mode=0o700, exist_ok=True)
        skewed = Path(__file__).parent / "skewed"
        environment = os.environ | {
            "SKEWED_CLOCK": f"{offset} {ppm}",
            "PYTHONPATH": f"{skewed}:{Path.cwd()}",
            "XDG_RUNTIME_DIR": str(runtime),
        }
        command = ["ip", "netns", "exec", namespace(number), sys.executable, "-m", "motiondeck", *words]
        log = (self.folder / f"log-{number}").open("a")
        return subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=log, stderr=log, text=True, start_new_session=True
        )

    def recording(self, number: int, take: int) -> Path:
        """The file of a take."""
        return self.folder / f"deck-{number}.{take}.rec"

    def recorded(self, number: int, take: int | None = None) -> RecordedDeck:
        """A take of a deck; the last one if none is given."""
        return RecordedDeck.read(self.recording(number, take or self.takes[number]), *self.clocks[number])

    def kill(self, number: int) -> float:
        """Kills a member with all its processes; when."""
        os.killpg(self.processes[number].pid, signal.SIGKILL)
        self.processes[number].wait()
        return time.monotonic()

    def wait_for(self, number: int, text: str, longest: float = 90.0) -> None:
        """Waits until a member has said something."""
        end = time.monotonic() + longest
        while text not in (self.folder / f"log-{number}").read_text():
            if time.monotonic() > end:
                raise SystemExit(
                    f"member {number} has not said '{text}':\n{(self.folder / f'log-{number}').read_text()}"
                )
            time.sleep(0.1)

    def send(self, number: int, *words: str) -> subprocess.Popen[str]:
        """A command to the deck in a namespace, from beside it."""
        return self._start(number, "send", *words)

    def type(self, line: str) -> None:
        """Types at the conductor."""
        stdin = self.processes[0].stdin
        assert stdin is not None
        stdin.write(line + "\n")
        stdin.flush()

    def close(self) -> None:
        """Ends all, the joints at rest."""
        for process in self.strangers:
            process.kill()
        for process in self.processes.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
        for process in self.processes.values():
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


def play_together(theatre: Theatre, seconds: float) -> dict[str, float]:
    """Starts all decks by one cue and has them play for some seconds; when what happened, s."""
    at: dict[str, float] = {}
    decks = range(1, theatre.count + 1)
    for number in decks:
        theatre.start_deck(number)
    theatre.start_strangers()
    for number in decks:
        _wait_until_playing(theatre, number)
    theatre.start_conductor()
    theatre.wait_for(0, "opening")
    at["opening"] = time.monotonic()
    time.sleep(seconds)
    at["together"] = time.monotonic()
    return at


def lose_things(theatre: Theatre) -> dict[str, float]:
    """Kills decks and conductors, cuts links, and stops all; when what happened, s."""
    at: dict[str, float] = {}
    last = theatre.count
    at["deck killed"] = theatre.kill(last)
    theatre.start_deck(last)
    at["deck restarted"] = time.monotonic()
    _wait_until_playing(theatre, last)
    time.sleep(8.0)
    theatre.net.cut(1)
    at["cut"] = time.monotonic()
    time.sleep(10.0)
    theatre.net.heal(1)
    at["healed"] = time.monotonic()
    time.sleep(9.0)
    at["conductor killed"] = theatre.kill(0)
    time.sleep(7.0)
    (theatre.folder / "log-0").write_text("")
    theatre.start_conductor()
    theatre.wait_for(0, "opening")
    at["conductor restarted"] = time.monotonic()
    time.sleep(5.0)
    at["conductor killed again"] = theatre.kill(0)
    theatre.net.cut(3)
    time.sleep(3.0)
    at["stop"] = time.monotonic()
    theatre.send(2, "estop").wait(10)
    time.sleep(1.5)
    at["end"] = time.monotonic()
    return at


def _wait_until_playing(theatre: Theatre, number: int) -> None:
    """Waits until a deck has written ticks."""
    end = time.monotonic() + 120.0
    file = theatre.recording(number, theatre.takes[number])
    while not file.exists() or file.stat().st_size < 20_000:
        if time.monotonic() > end or theatre.processes[number].poll() is not None:
            raise SystemExit(f"deck {number} does not play:\n{(theatre.folder / f'log-{number}').read_text()}")
        time.sleep(0.2)


def judge_step(theatre: Theatre, at: dict[str, float]) -> list[tuple[str, str]]:
    """How decks started and kept step."""
    decks = [theatre.recorded(number, 1) for number in range(1, theatre.count + 1)]
    round_s = _round_seconds(decks[1])
    begun, due = np.array([deck.played("jog", at["opening"] - 5.0) for deck in decks]).T
    times = np.arange(at["opening"] + 6.0, at["together"], _STEP)
    # A deck that is killed afterwards takes the last moments of its recording with it.
    times = times[np.isfinite(apart_ms(decks, times, round_s))]
    by_due, by_begun = (apart_ms(decks, times, round_s, by_due=by) for by in (True, False))
    stood = stalls(theatre.folder)
    stood = stood[(stood[:, 0] > times[0]) & (stood[:, 0] < times[-1])]
    free = undisturbed(times, stood)
    lateness = np.concatenate([deck.fields["late_us"] for deck in decks])
    return [
        ("start of one cue, first to last deck, by when its tick was due, ms", f"{1e3 * np.ptp(due):.1f}"),
        ("    by when its tick began, all decks on the cores of one machine, ms", f"{1e3 * np.ptp(begun):.1f}"),
        (f"phases apart for {len(times) / 100:.0f} s by when ticks were due, ms: median, p99, most", _shares(by_due)),
        ("    share of the time beyond 10 ms, longest at a stretch, s", _beyond(by_due)),
        ("    by when ticks began, ms: median, p99, most", _shares(by_begun)),
        ("    share of the time beyond 10 ms, longest at a stretch, s", _beyond(by_begun)),
        (
            "idle loops beside the decks, one a core: stalls of more than 5 and 10 ms, longest, ms",
            f"{np.sum(stood[:, 1] > 0.005)}, {np.sum(stood[:, 1] > 0.01)}, {1e3 * stood[:, 1].max(initial=0.0):.1f}",
        ),
        (f"    by due in the {np.mean(free):.0%} of the time 1 s or more after those of 5 ms", _shares(by_due[free])),
        ("    by begun", _shares(by_begun[free])),
        (
            "lateness of ticks, ms: p50, p99",
            f"{np.median(lateness) / 1e3:.1f}, {np.percentile(lateness, 99) / 1e3:.1f}",
        ),
    ]


def _shares(apart: NDArray[np.float64]) -> str:
    if not len(apart):
        return "-"
    return f"{np.median(apart):.1f}, {np.percentile(apart, 99):.1f}, {apart.max():.1f}"


def _beyond(apart: NDArray[np.float64]) -> str:
    return f"{np.mean(apart > 10.0):.2%}, {longest_beyond(apart, _STEP):.2f}"


def judge_losses(theatre: Theatre, at: dict[str, float], lost: str) -> list[tuple[str, str]]:
    """What decks did that lost something."""
    decks = {number: theatre.recorded(number) for number in range(1, theatre.count + 1)}
    last, round_s = theatre.count, _round_seconds(decks[2])
    restarted = _since(decks[last], decks[2], at, "deck restarted", "cut", round_s)
    cut = decks[1].still(at["cut"])
    held = f"still after {cut - at['cut']:.1f} s" if cut < at["healed"] else "plays on"
    healed = _since(decks[1], decks[2], at, "healed", "conductor killed", round_s)
    stills = np.array([deck.still(at["conductor killed"]) - at["conductor killed"] for deck in decks.values()])
    gone = np.sum(stills < 7.0)
    when = f" after {np.nanmin(stills):.1f} to {np.nanmax(stills):.1f} s" if gone else ""
    apart = apart_ms([*decks.values()], at["conductor killed"] + np.arange(0.0, 7.0, _STEP), round_s)
    stops = np.array([deck.stopped(at["stop"]) for number, deck in decks.items() if number != 3])
    return [
        ("deck killed and restarted: in step after, s", restarted),
        (f"link cut for 10 s ({lost})", held),
        ("    in step so long after it is back, s", healed),
        (f"conductor killed ({lost}): decks that come to a standstill", f"{gone} of {last}{when}"),
        ("    phases apart meanwhile, most, ms", f"{apart.max():.1f}"),
        (
            "emergency stop of one deck, without a conductor, 3 s after the link of another was cut: the last one of "
            "those that are linked stops after, ms",
            f"{1e3 * (stops.max() - stops[1]):.0f}",
        ),
    ]


def _since(
    deck: RecordedDeck, leader: RecordedDeck, at: dict[str, float], since: str, until: str, round_s: float
) -> str:
    found = in_step_since(deck, leader, at[since] + 0.05, at[until] - 0.1, round_s)
    return f"{found - at[since]:.1f}" if np.isfinite(found) else "not again"


def _round_seconds(deck: RecordedDeck) -> float:
    """How long a round takes in the steady part of a recording, s."""
    middle = slice(len(deck.times) // 4, len(deck.times) // 2)
    turned = np.unwrap(deck.fields["phase"][middle], period=1.0)
    return float(np.ptp(deck.times[middle]) / np.ptp(turned))


def strangers_table(theatre: Theatre) -> list[tuple[str, str]]:
    rows = []
    for process, kind in zip(theatre.strangers, ("without certificates", "of another authority"), strict=True):
        process.kill()
        assert process.stdout is not None
        lines = [line.split() for line in process.stdout.read().splitlines() if len(line.split()) == 2]
        sessions = max((int(line[0]) for line in lines), default=-1)
        heard = max((int(line[1]) for line in lines), default=-1)
        rows.append((f"a stranger {kind}: {len(lines)} tries, sessions, messages heard", f"{sessions}, {heard}"))
    return rows


def main(
    decks: Annotated[int, typer.Option(help="How many.")] = 8,
    rate: Annotated[float, typer.Option(help="Ticks of each deck a second.")] = 200.0,
    delay: Annotated[float, typer.Option(help="Of the network, one way, ms.")] = 20.0,
    loss: Annotated[float, typer.Option(help="Share of packets that are lost.")] = 0.01,
    seconds: Annotated[float, typer.Option(help="How long they play together.")] = 130.0,
    losses: Annotated[bool, typer.Option(help="Then kill members, cut a link, and stop all.")] = True,
    lost: Annotated[str, typer.Option(help="What decks do without the conductor: go on, hold, stop.")] = "go on",
    keep: Annotated[Path | None, typer.Option(help="Keep recordings and logs in this new folder.")] = None,
) -> None:
    """Plays a show of decks in network namespaces and judges it by their recordings. Needs root."""
    with ExitStack() as opened:
        folder = keep or Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="fleet-")))
        folder.mkdir(exist_ok=True)
        net = opened.enter_context(network(decks + 2, delay, loss))
        opened.enter_context(idle_watch(folder))
        theatre = Theatre(folder, decks, rate, net, lost)
        try:
            at = play_together(theatre, seconds)
            if losses:
                at |= lose_things(theatre)
        finally:
            theatre.close()
        rows = [*judge_step(theatre, at), *(judge_losses(theatre, at, lost) if losses else ())]
        rows += strangers_table(theatre)
    print(f"{decks} decks at {rate:g} Hz, {delay:g} ms each way, {loss:.0%} loss, drifts of -100 to 100 ppm")
    for name, value in rows:
        print(f"| {name} | {value} |")


if __name__ == "__main__":
    run("fleet", main)
