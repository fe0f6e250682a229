"""How punctual the loop is, beside the clock of loop-rate-limiters.

The whole of `play` with thesis15 on servo20.

For each rate, and for what runs beside it (nothing, the browser view, a process that keeps another core busy), the same
run is made with ordinary scheduling and then with SCHED_FIFO and locked memory, where that is permitted:

- motiondeck: deck, retargeting, safety envelope, simulated robot and a bus of emulated servos;
- loop-rate-limiters: all that on the clock of this package (pip install motiondeck[benchmark], else it is left out);
- empty loop: our clock with nothing to do at all. No loop on this machine is more punctual than that; what is worse
  than it is ours, what it shows itself is the machine's. So is `steal`: the time for which the host took all cores of
  a virtual machine away, as /proc/stat counts it;
- C loop: the same without Python (`_c_loop.c`): clock_nanosleep until each deadline and nothing else. It does not spin.
  It is compiled with cc and left out, with a word, where there is none.

Lateness is that of a tick after the deadline its own clock promised. Motiondeck's deadlines are the start plus k
periods; loop-rate-limiters sets each one a period after the last wake-up, so it is late against fewer promises and
drifts: `drift` is how far the last tick was behind the start plus its number of periods (skipped ticks count as
taken). An overrun is a tick more than a period late. Every two seconds a switch is commanded; `change` is how many
ticks after it the targets were first changed by it (p99).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import msgspec  # noqa: E402
import numpy as np  # noqa: E402

from benchmarks.deck._c_loop import CLoop  # noqa: E402
from benchmarks.deck._machine_load import hog, stolen_ms  # noqa: E402
from benchmarks.deck._peer_clock import PeerClock, limiters  # noqa: E402
from controller.deck.deck import Deck  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.clock import Clock, Ticker  # noqa: E402
from controller.loop.histogram import DurationHistogram  # noqa: E402
from controller.loop.loop import undisturbed  # noqa: E402
from controller.loop.permissions import handed_back, request_core, request_realtime  # noqa: E402
from controller.wire.messages.commands import Switch  # noqa: E402
from motiondeck.run.assembly import open_session  # noqa: E402
from motiondeck.run.robots.robot_on_deck import open_robots  # noqa: E402
from motiondeck.run.session import Host, Played  # noqa: E402
from motiondeck.run.spec.program import Timed  # noqa: E402
from motiondeck.run.spec.run_spec import RunSpec  # noqa: E402
from motiondeck_base.shipped import find_library, find_rig  # noqa: E402

BESIDE = ("none", "view", "hog")
RIG_HZ = 125.0  # at most; the fastest whole share of the loop's rate below it is taken


def rig_file(folder: Path, rate: float) -> Path:
    """The emulated rig of servo20, written to as often as divides the loop's rate."""
    every = -(-rate // RIG_HZ)
    text = find_rig("servo20").read_text()
    path = folder / "servo20.toml"
    path.write_text(re.sub(r"(?m)^rate_hz\s*=.*$", f"rate_hz = {rate / every:g}", text))
    return path


def measure(
    library: MotionLibrary, clock: Clock, fifo: bool, rate: float, beside: str, options: argparse.Namespace
) -> dict[str, Any]:
    """One run of all that `play` runs; its row of the table."""
    motions = [name for name in ("jog", "walk", "box1", "waltz") if name in library.network.motions]
    show = [Timed(2.0 * k, Switch(motions[k % len(motions)])) for k in range(1, int(options.seconds / 2.0))]
    with tempfile.TemporaryDirectory() as folder, hog(beside == "hog", options.core):
        rig = rig_file(Path(folder), rate) if options.rig else None
        spec = RunSpec(
            robot="servo20",
            rig=f"emulated:{rig}" if rig is not None else None,
            physics=False,
            rate=rate,
            realtime=fifo,
            page=beside == "view",
            seconds=options.seconds,
            core=options.core,
        )
        played = Played(
            library,
            lambda opening: open_robots(opening, spec, library),
            lambda retarget: Deck(library, retarget, "walk"),
            show,
        )
        with open_session(spec, played, Host(clock=clock)) as session:
            before = stolen_ms()
            report: dict[str, Any] = session.run()
    skipped = getattr(clock, "skipped", 0)
    seconds = report["ticks"] / report["rate_hz"]
    return {
        "rate_hz": rate,
        "clock": "loop-rate-limiters" if isinstance(clock, PeerClock) else "motiondeck",
        "fifo": fifo,
        "beside": beside,
        **{f"{name}_us": report["lateness_us"][name] for name in ("p50", "p99", "p999", "max")},
        "ticks": report["ticks"],
        "overruns": report["overruns"],
        "overruns_percent": 100.0 * report["overruns"] / report["ticks"],
        "drift_ms": 1e3 * (seconds - (report["ticks"] + skipped) / rate),
        "steal_ms": stolen_ms() - before,
        "change_p99_ticks": changed_after(report, rate),
        "work_p50_us": report["work_us"]["p50"],
        "work_p99_us": report["work_us"]["p99"],
    }


def floor(fifo: bool, rate: float, beside: str, options: argparse.Namespace) -> dict[str, Any]:
    """The same deadlines with nothing to do: how punctual a loop can be on this machine."""
    clock, late, ticks = Ticker(rate), DurationHistogram(), round(rate * options.seconds)
    with hog(beside == "hog", options.core), handed_back(), undisturbed():
        if options.core is not None:
            request_core(options.core)
        if fifo:
            request_realtime()
        before = stolen_ms()
        clock.start()
        start = clock.now()
        for _ in range(ticks):
            late.add(clock.wait())
        seconds = 1e-9 * (clock.now() - start)
    percentiles = msgspec.structs.asdict(late.percentiles())
    return {
        "rate_hz": rate,
        "clock": "empty loop",
        "fifo": fifo,
        "beside": beside,
        **{f"{name}_us": value for name, value in percentiles.items()},
        "ticks": ticks,
        "overruns": clock.overruns,
        "overruns_percent": 100.0 * clock.overruns / ticks,
        "drift_ms": 1e3 * (seconds - (ticks + clock.skipped) / rate),
        "steal_ms": stolen_ms() - before,
        "change_p99_ticks": None,
        "work_p50_us": 0.0,
        "work_p99_us": 0.0,
    }


def c_floor(loop: CLoop, fifo: bool, rate: float, beside: str, options: argparse.Namespace) -> dict[str, Any]:
    """The same deadlines with clock_nanosleep, in C."""
    ticks = round(rate * options.seconds)
    with hog(beside == "hog", options.core), handed_back():
        if options.core is not None:
            request_core(options.core)  # which the program inherits
        before = stolen_ms()
        late = loop(rate, ticks, fifo=fifo)
        stolen = stolen_ms() - before
    percentiles = np.percentile(late, (50.0, 99.0, 99.9, 100.0)).tolist()
    overruns = int((late > 1e6 / rate).sum())
    return {
        "rate_hz": rate,
        "clock": "C loop",
        "fifo": fifo,
        "beside": beside,
        **dict(zip(("p50_us", "p99_us", "p999_us", "max_us"), percentiles, strict=True)),
        "ticks": ticks,
        "overruns": overruns,
        "overruns_percent": 100.0 * overruns / ticks,
        "drift_ms": 1e-3 * float(late[-1]),
        "steal_ms": stolen,
        "change_p99_ticks": None,
        "work_p50_us": 0.0,
        "work_p99_us": 0.0,
    }


def changed_after(report: dict[str, Any], rate: float) -> float | None:
    """The 99th percentile of the ticks from a command to the first targets that it changed."""
    waits = [s["first_change_s"] - s["commanded_s"] for s in report["switches"] if s["first_change_s"] is not None]
    return round(rate * float(np.percentile(waits, 99.0)), 3) if waits else None


def fifo_permitted() -> bool:
    with handed_back():
        return request_realtime()[0].granted


COLUMNS = {
    "Hz": lambda row: f"{row['rate_hz']:g}",
    "clock": lambda row: row["clock"],
    "FIFO": lambda row: "yes" if row["fifo"] else "no",
    "beside": lambda row: row["beside"],
    "late p50 us": lambda row: f"{row['p50_us']:.0f}",
    "p99": lambda row: f"{row['p99_us']:.0f}",
    "p99.9": lambda row: f"{row['p999_us']:.0f}",
    "max": lambda row: f"{row['max_us']:.0f}",
    "overruns": lambda row: str(row["overruns"]),
    "%": lambda row: f"{row['overruns_percent']:.3f}",
    "drift ms": lambda row: f"{row['drift_ms']:.2f}",
    "steal ms": lambda row: f"{row['steal_ms']:.0f}",
    "change": lambda row: "" if row["change_p99_ticks"] is None else f"{row['change_p99_ticks']:g}",
    "work p50 us": lambda row: f"{row['work_p50_us']:.0f}",
    "work p99 us": lambda row: f"{row['work_p99_us']:.0f}",
}


def line(row: dict[str, Any]) -> str:
    return "| " + " | ".join(say(row) for say in COLUMNS.values()) + " |"


def view_ratios(rows: list[dict[str, Any]]) -> dict[str, float]:
    """By how much attaching the view changes the p99.9 of our loop, for each rate; under SCHED_FIFO where permitted."""
    fifo = any(row["fifo"] for row in rows)
    late = {
        (row["rate_hz"], row["beside"]): row["p999_us"]
        for row in rows
        if row["clock"] == "motiondeck" and row["fifo"] == fifo
    }
    return {
        f"{rate:g}": late[rate, "view"] / max(late[rate, "none"], 1.0)
        for rate, beside in late
        if beside == "view" and (rate, "none") in late
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks loop", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rates", default="100,250,500,1000", help="ticks a second, separated by commas")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long each run is played")
    parser.add_argument("--beside", default=",".join(BESIDE), help="what runs beside it, of none, view and hog")
    parser.add_argument("--core", type=int, help="run the loop on this core")
    parser.add_argument("--no-rig", dest="rig", action="store_false", help="without emulated servos")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    besides = options.beside.split(",")
    if not set(besides) <= set(BESIDE):
        parser.error(f"--beside {options.beside}: choose from {', '.join(BESIDE)}")
    library = load_library(find_library("thesis15"))
    machine = {
        "system": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "core": options.core,
    }
    schedulings = (False, True) if fifo_permitted() else (False,)
    c_loop = CLoop.compiled()
    rows: list[dict[str, Any]] = []

    def add(row: dict[str, Any]) -> None:
        rows.append(row)
        if not options.json:
            print(line(row), flush=True)

    if not options.json:
        print(", ".join(f"{name} {value}" for name, value in machine.items()))
        if len(schedulings) == 1:
            print("SCHED_FIFO is not permitted here, so its rows are missing")
        if c_loop is None:
            print("there is no C compiler (cc) here, so the rows of the C loop are missing")
        print("| " + " | ".join(COLUMNS) + " |\n" + "|---" * len(COLUMNS) + "|", flush=True)
    for rate in map(float, options.rates.split(",")):
        for beside in besides:
            for fifo in schedulings:
                add(measure(library, Ticker(rate), fifo, rate, beside, options))
                if beside != "view":
                    if limiters is not None:
                        add(measure(library, PeerClock(rate), fifo, rate, beside, options))
                    add(floor(fifo, rate, beside, options))
                    if c_loop is not None:
                        add(c_floor(c_loop, fifo, rate, beside, options))
    ratios = view_ratios(rows)
    if options.json:
        print(json.dumps({"machine": machine, "rows": rows, "view_p999_ratio": ratios}))
    else:
        for rate, ratio in ratios.items():
            print(f"{rate} Hz: attaching the view makes p99.9 {ratio:.2f} times what it is without")
    return 0


if __name__ == "__main__":
    sys.exit(main())
