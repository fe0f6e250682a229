"""The loop's punctuality: the whole of `play` with thesis15 on servo20, beside the clock of loop-rate-limiters.

python -m benchmarks loop [--rates 100,250,500,1000] [--seconds 20] [--view] [--hog] [--core N] [--no-rig] [--json]

For each rate the same run is made on both clocks, first with ordinary scheduling and then with SCHED_FIFO and locked
memory, where that is permitted. All else is the same: deck, retargeting, safety envelope, simulated robot, a bus of
emulated servos. --view attaches the browser view, --hog keeps another core busy.

Lateness is that of a tick after the deadline its own clock promised. Motiondeck's deadlines are the start plus k
periods; loop-rate-limiters sets each one a period after the last wake-up, so it is late against fewer promises and
drifts: `drift` is how far the last tick was behind the start plus its number of periods (skipped ticks count as
taken). An overrun is a tick more than a period late. Every two seconds a switch is commanded; `change` is how many
ticks after it the targets were first changed by it (p99). Without the peer (pip install motiondeck[benchmark]) its rows
are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.cli.body import Cast  # noqa: E402
from controller.cli.resources import find  # noqa: E402
from controller.cli.script import Timed  # noqa: E402
from controller.cli.session import Session, Settings  # noqa: E402
from controller.realtime.clock import Clock, Ticker  # noqa: E402
from controller.realtime.deck import Deck  # noqa: E402
from controller.realtime.messages import Switch  # noqa: E402
from controller.realtime.permissions import handed_back, request_realtime  # noqa: E402
from controller.training.library import MotionLibrary, load_library  # noqa: E402

try:
    from loop_rate_limiters import RateLimiter
except ImportError:
    RateLimiter = None

RIG_HZ = 125.0  # at most; the fastest whole share of the loop's rate below it is taken


class PeerClock:
    """The clock of loop-rate-limiters; fits `controller.realtime.clock.Clock`."""

    def __init__(self, rate: float) -> None:
        assert RateLimiter is not None
        self._rate = rate
        self.overruns = self.skipped = 0
        self.start()

    @property
    def period(self) -> float:
        """Seconds from tick to tick."""
        return 1.0 / self._rate

    def now(self) -> int:
        """The clock that the peer uses, ns."""
        return time.perf_counter_ns()

    def start(self) -> None:
        """Makes the present the time of tick 0."""
        assert RateLimiter is not None
        self._limiter = RateLimiter(self._rate, warn=False)
        self.overruns = 0

    def wait(self) -> int:
        """Waits for the next tick; returns how late it is by the peer's own promise, ns."""
        due = self._limiter.next_tick
        self._limiter.sleep()
        late = time.perf_counter() - due
        self.overruns += late > self.period
        return int(1e9 * late)


@contextmanager
def hog(wanted: bool, core: int | None) -> Iterator[None]:
    """A process that keeps a core busy; not the loop's own, if that is known."""
    if not wanted:
        yield
        return
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    others = sorted(os.sched_getaffinity(0) - {core})
    if others:
        os.sched_setaffinity(busy.pid, {others[-1]})
    try:
        yield
    finally:
        busy.kill()
        busy.wait()


def rig_file(folder: Path, rate: float) -> Path:
    """The emulated rig of servo20, written to as often as divides the loop's rate."""
    every = -(-rate // RIG_HZ)
    text = find("rig", "servo20", ".toml").read_text()
    path = folder / "servo20.toml"
    path.write_text(re.sub(r"(?m)^rate_hz\s*=.*$", f"rate_hz = {rate / every:g}", text))
    return path


def measure(
    library: MotionLibrary, clock: Clock, fifo: bool, rate: float, options: argparse.Namespace
) -> dict[str, Any]:
    """One run; its row of the table."""
    motions = [name for name in ("jog", "walk", "box1", "waltz") if name in library.network.motions]
    show = [Timed(2.0 * k, Switch(motions[k % len(motions)])) for k in range(1, int(options.seconds / 2.0))]
    with tempfile.TemporaryDirectory() as folder, hog(options.hog, options.core):
        settings = Settings(
            robot=Cast(
                find("robot", "servo20", ".toml"), rig_file(Path(folder), rate) if options.rig else None, emulated=True
            ),
            rate=rate,
            physics=False,
            realtime=fifo,
            command_port=0,
            page_port=0 if options.view else None,
            terminal=False,
            seconds=options.seconds,
            core=options.core,
        )
        with Session(library, lambda retarget: Deck(library, retarget, "walk"), show, settings, clock) as session:
            report: dict[str, Any] = session.run()
    skipped = getattr(clock, "skipped", 0)
    seconds = report["ticks"] / report["rate_hz"]
    return {
        "rate_hz": rate,
        "clock": "loop-rate-limiters" if isinstance(clock, PeerClock) else "motiondeck",
        "fifo": fifo,
        **{f"{name}_us": report["lateness_us"][name] for name in ("p50", "p99", "p999", "max")},
        "ticks": report["ticks"],
        "overruns": report["overruns"],
        "overruns_percent": 100.0 * report["overruns"] / report["ticks"],
        "drift_ms": 1e3 * (seconds - (report["ticks"] + skipped) / rate),
        "change_p99_ticks": changed_after(report, rate),
        "work_p50_us": report["work_us"]["p50"],
        "work_p99_us": report["work_us"]["p99"],
    }


def changed_after(report: dict[str, Any], rate: float) -> float | None:
    """The 99th percentile of the ticks from a command to the first targets that it changed."""
    waits = [s["first_change_s"] - s["commanded_s"] for s in report["switches"] if s["first_change_s"] is not None]
    return round(rate * float(np.percentile(waits, 99.0)), 3) if waits else None


def fifo_permitted() -> bool:
    with handed_back():
        return request_realtime()[0].granted


HEAD = "| Hz | clock | FIFO | late p50 us | p99 | p99.9 | max | overruns | % | drift ms | change | work p50 us | p99 |"


def line(row: dict[str, Any]) -> str:
    return (
        f"| {row['rate_hz']:g} | {row['clock']} | {'yes' if row['fifo'] else 'no'} | {row['p50_us']:.0f} "
        f"| {row['p99_us']:.0f} | {row['p999_us']:.0f} | {row['max_us']:.0f} | {row['overruns']} "
        f"| {row['overruns_percent']:.3f} | {row['drift_ms']:.2f} | {row['change_p99_ticks']} "
        f"| {row['work_p50_us']:.0f} | {row['work_p99_us']:.0f} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks loop", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rates", default="100,250,500,1000", help="ticks a second, separated by commas")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long each run is played")
    parser.add_argument("--view", action="store_true", help="attach the browser view")
    parser.add_argument("--hog", action="store_true", help="keep another core busy")
    parser.add_argument("--core", type=int, help="run the loop on this core")
    parser.add_argument("--no-rig", dest="rig", action="store_false", help="without emulated servos")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find("library", "thesis15", ".safetensors"))
    machine = {
        "system": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "view": options.view,
        "hog": options.hog,
        "core": options.core,
    }
    schedulings = (False, True) if fifo_permitted() else (False,)
    rows: list[dict[str, Any]] = []
    if not options.json:
        print(", ".join(f"{name} {value}" for name, value in machine.items()))
        if len(schedulings) == 1:
            print("SCHED_FIFO is not permitted here, so its rows are missing")
        print(HEAD + "\n" + "|---" * HEAD.count(" |") + "|", flush=True)
    for rate in map(float, options.rates.split(",")):
        for fifo in schedulings:
            for clock in [Ticker(rate), *([PeerClock(rate)] if RateLimiter is not None else [])]:
                rows.append(measure(library, clock, fifo, rate, options))
                if not options.json:
                    print(line(rows[-1]), flush=True)
    if options.json:
        print(json.dumps({"machine": machine, "rows": rows}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
