"""Where the time of a tick goes, what a pause costs it, and its Python calls.

A tick of `play` on servo20 at 200 Hz with simulated servos and masses, in two runs:

- back to back: tick after tick without a pause, and without a rig;
- in the loop: in real time, asleep between ticks, with the servos of an emulated rig.

Each part has the median of its own time: what the parts within it take is theirs. The last rows are whole ticks of runs
whose parts are not timed, and the share of a core that the loop takes, its spinning before each deadline included.

Then ticks back to back are compared with those after a pause of a whole period: one that reads the clock all the time,
and one that sleeps but for the last 0.2 ms, as `play` does. Forty ticks of one kind take turns with forty of the next,
so that a machine that becomes slower or faster meanwhile changes all of them.

With --calls the calls of Python functions in a tick of `play` with simulated servos and masses are counted instead
(`sys.setprofile`, the mean of 200 ticks, no time is measured): in all, for each room, and the functions that are called
most. With --rig the servos of an emulated rig are driven, too, in real time.

With --beside the ticks of another checkout are measured too, each by its own version of this program, in turn.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from types import FrameType
from typing import Any

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from benchmarks.deck._tick_parts import ALL, PARTS, REST, Ticks  # noqa: E402
from benchmarks.simulated_time import VirtualClock  # noqa: E402
from controller.deck.deck import Deck  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.clock import SPIN_NS, Ticker  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck.run.assembly import open_session  # noqa: E402
from motiondeck.run.robots.robot_on_deck import open_robots  # noqa: E402
from motiondeck.run.session import Host, Played  # noqa: E402
from motiondeck.run.spec.run_spec import RunSpec  # noqa: E402
from motiondeck_base.errors import MotiondeckError  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

RATE = 200.0
APPROACH = 1000  # ticks after which the joints have approached the motion
COUNTED = 200  # ticks whose calls are counted
BLOCK, SETTLING = 40, 3  # ticks after one kind of pause, and how many of them still show the one before


def play(
    library: MotionLibrary, motion: str, clock: Ticker | VirtualClock, ticks: int, *, rig: bool, rate: float = RATE
) -> None:
    """Plays a motion on servo20 with simulated servos and masses for so many ticks after the approach.

    Raises:
        MotiondeckError: if the run ended early.
    """
    spec = RunSpec(robot="servo20", rig="emulated" if rig else None, rate=rate, seconds=ticks / rate)
    played = Played(
        library, lambda opening: open_robots(opening, spec, library), lambda retarget: Deck(library, retarget, motion)
    )
    with open_session(spec, played, Host(clock=clock)) as session:
        reason = session.run()["reason"]
    if reason != "played to the end":
        raise MotiondeckError(f"the run ended early: {reason}")


def time_play(
    library: MotionLibrary,
    motion: str,
    clock: Ticker | VirtualClock,
    ticks: int,
    *,
    rig: bool,
    parts: bool,
    rate: float = RATE,
) -> tuple[dict[str, Array], float]:
    """How long the ticks of a run took, their parts too if asked for, (ticks,), us; the loop's share of a core."""
    used, passed = list[int](), list[int]()

    def note(tick: int) -> None:
        if tick in (APPROACH, APPROACH + ticks):
            used.append(time.thread_time_ns())
            passed.append(time.perf_counter_ns())

    timing = Ticks(clock, note)
    with timing.of_parts() if parts else nullcontext():
        play(library, motion, clock, APPROACH + ticks, rig=rig, rate=rate)
    names = [*PARTS, REST, ALL] if parts else [ALL]
    columns = {name: timing.column(name, slice(APPROACH, APPROACH + ticks)) for name in names}
    return columns, (used[1] - used[0]) / (passed[1] - passed[0])


def time_pauses(library: MotionLibrary, motion: str, rounds: int = 8) -> dict[str, Array]:
    """How long whole ticks take after each kind of pause, us; without a rig."""
    period = round(1e9 / RATE)

    def spin(ns: int) -> None:
        end = time.perf_counter_ns() + ns
        while time.perf_counter_ns() < end:
            pass

    def sleep() -> None:
        time.sleep(1e-9 * (period - SPIN_NS))
        spin(SPIN_NS)

    pauses = {"none": lambda: None, "reading the clock": lambda: spin(period), "asleep": sleep}
    turns = [name for _ in range(rounds) for name in pauses for _ in range(BLOCK)]
    clock = VirtualClock(RATE)
    timing = Ticks(clock, lambda tick: pauses[turns[tick - APPROACH]]() if 0 <= tick - APPROACH < len(turns) else None)
    play(library, motion, clock, APPROACH + len(turns), rig=False)
    spent = timing.column(ALL, slice(APPROACH, APPROACH + len(turns)))
    settled = np.arange(len(turns)) % BLOCK >= SETTLING
    return {name: spent[settled & (np.array(turns) == name)] for name in pauses}


def count_calls(
    library: MotionLibrary, motion: str, *, rig: bool = False, shown: int = 12
) -> dict[str, dict[str, float]]:
    """Python calls a tick: in all, for each room of the project (numpy is one, too), and of the busiest functions."""
    counts: Counter[tuple[str, str]] = Counter()

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call":
            counts[frame.f_code.co_filename, frame.f_code.co_qualname] += 1

    clock = Ticker(RATE) if rig else VirtualClock(RATE)
    wait, ticks = clock.wait, 0

    def counting() -> int:
        nonlocal ticks
        ticks += 1
        if ticks == APPROACH:
            sys.setprofile(note)
        elif ticks == APPROACH + COUNTED:
            sys.setprofile(None)
        return wait()

    clock.wait = counting
    play(library, motion, clock, APPROACH + COUNTED, rig=rig)
    del counts[__file__, counting.__qualname__]
    rooms: Counter[str] = Counter()
    for (file, _), count in counts.items():
        parts = Path(file).parts
        known = [k for k, part in enumerate(parts) if part in ("controller", "sim", "hardware", "numpy")]
        rooms["/".join(parts[known[-1] :][: 1 if parts[known[-1]] == "numpy" else 2]) if known else "elsewhere"] += (
            count
        )
    busiest = {f"{Path(file).stem}: {name}": count / COUNTED for (file, name), count in counts.most_common(shown)}
    total = {"all": sum(counts.values()) / COUNTED}
    return {"calls": total | {room: n / COUNTED for room, n in rooms.most_common()}, "busiest": busiest}


def measure(library: MotionLibrary, motion: str, ticks: int) -> dict[str, Any]:
    """Medians of the parts and of whole ticks in both runs, us, the loop's share of a core, and the pauses."""
    runs: dict[str, dict[str, float]] = {}
    for run, rig in (("back to back", False), ("in the loop", True)):
        clocks = [Ticker(RATE) if rig else VirtualClock(RATE) for _ in range(2)]
        parts, _ = time_play(library, motion, clocks[0], ticks, rig=rig, parts=True)
        whole, share = time_play(library, motion, clocks[1], ticks, rig=rig, parts=False)
        rows = {part: float(np.median(column)) for part, column in parts.items() if part != ALL}
        rows["p50 of whole ticks"], rows["p99"] = np.percentile(whole[ALL], (50.0, 99.0)).tolist()
        if rig:
            rows["share of a core, %"] = 100.0 * share
        runs[run] = rows
    pauses = {name: float(np.median(spent)) for name, spent in time_pauses(library, motion).items()}
    return {"us": runs, "us_after_a_pause": pauses}


def measure_beside(beside: Path, rounds: int, options: list[str]) -> dict[str, dict[str, list[float]]]:
    """Medians of whole ticks of this and another checkout in each run and after each pause, us, one of each round."""
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(rounds):
        for name, checkout in (("this", Path(__file__).parents[2]), ("beside", beside.resolve())):
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks", "tick", "--json", *options],
                env=os.environ | {"PYTHONPATH": str(checkout)},
                cwd=checkout,
                stdout=subprocess.PIPE,
                check=True,
            )
            measured = json.loads(done.stdout)
            medians = {run: rows["p50 of whole ticks"] for run, rows in measured["us"].items()}
            medians |= {f"after a pause: {pause}": spent for pause, spent in measured["us_after_a_pause"].items()}
            for run, median in medians.items():
                found.setdefault(run, {}).setdefault(name, []).append(median)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks tick", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--motion", default="walk")
    parser.add_argument("--ticks", type=int, default=2000, help="of each run")
    parser.add_argument("--calls", action="store_true", help="count the Python calls of a tick of play instead")
    parser.add_argument("--rig", action="store_true", help="with --calls: drive an emulated rig, too")
    parser.add_argument("--beside", type=Path, metavar="CHECKOUT", help="measure another checkout, too, in turn")
    parser.add_argument("--rounds", type=int, default=5, help="with --beside: of each checkout")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    if options.beside is not None:
        words = ["--library", options.library, "--motion", options.motion, "--ticks", str(options.ticks)]
        found = measure_beside(options.beside, options.rounds, words)
        if options.json:
            print(json.dumps({"us_p50_of_whole_ticks": found}))
            return 0
        print("| whole ticks, median of medians (least) | this, us | beside, us | ratio |\n|---|---|---|---|")
        for run, rows in found.items():
            middle = {name: statistics.median(values) for name, values in rows.items()}
            cells = [f"{middle[name]:.0f} ({min(values):.0f})" for name, values in rows.items()]
            print(f"| {run} | {' | '.join(cells)} | {middle['this'] / middle['beside']:.2f} |")
        return 0
    library = load_library(find_library(options.library))
    played = {"library": library.info.name, "motion": options.motion}
    if options.calls:
        counted = count_calls(library, options.motion, rig=options.rig)
        if options.json:
            print(json.dumps(played | counted))
            return 0
        for title, rows in counted.items():
            print(f"| {title} | a tick |\n|---|---|")
            print("".join(f"| {name} | {calls:.1f} |\n" for name, calls in rows.items()))
        return 0
    measured = measure(library, options.motion, options.ticks)
    if options.json:
        print(json.dumps(played | measured))
        return 0
    back, loop = measured["us"].values()
    print(f"{library.info.name}, {options.motion}, {options.ticks} ticks a run\n")
    print("| part | back to back, us | in the loop, us |\n|---|---|---|")
    for part, value in loop.items():
        print(f"| {part} | {f'{back[part]:.0f}' if part in back else ''} | {value:.0f} |")
    print("\n| pause before a tick | tick p50 us |\n|---|---|")
    for pause, value in measured["us_after_a_pause"].items():
        print(f"| {pause} | {value:.0f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
