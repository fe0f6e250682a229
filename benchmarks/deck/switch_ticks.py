"""What the ticks in which a switch is carried out cost, and those after it.

Random switches of `play` on servo20 at 200 Hz with simulated servos and masses, 0.75 s apart. Every tick comes after a
pause of a period: asleep, and the last 0.2 ms reading the clock, as in the loop. `plays on` are the ticks 0.2 s before
each switch.

python -m benchmarks switch_ticks [--library thesis15] [--joining WAY] [--switches 40] [--seed 1] [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from benchmarks.deck._tick_parts import ALL, Ticks  # noqa: E402
from benchmarks.simulated_time import VirtualClock  # noqa: E402
from controller.deck.deck import Deck  # noqa: E402
from controller.deck.performance import JOININGS, Joining  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.clock import SPIN_NS  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck.run.assembly import open_session  # noqa: E402
from motiondeck.run.robots.robot_on_deck import open_robots  # noqa: E402
from motiondeck.run.session import Host, Played  # noqa: E402
from motiondeck.run.spec.run_spec import RunSpec  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

RATE = 200.0
APPROACH, APART, BEFORE, SHOWN = 1000, 150, 40, 6  # ticks


def time_switches(library: MotionLibrary, joining: Joining | None, switches: int, seed: int) -> Array:
    """How long whole ticks took: a row a switch, first the one that plays on, then SHOWN from the switch on, us."""
    rng, decks = np.random.default_rng(seed), list[Deck]()
    clock, last = VirtualClock(RATE), APPROACH + switches * APART

    def command_and_pause(tick: int) -> None:
        if tick >= APPROACH and tick < last and (tick - APPROACH) % APART == 0:
            others = [name for name in decks[0].motions if name != decks[0].motion]
            decks[0].switch(str(rng.choice(others)))
        if tick >= APPROACH - 2 * BEFORE:
            end = time.perf_counter_ns() + round(1e9 / RATE)
            time.sleep(1.0 / RATE - 1e-9 * SPIN_NS)
            while time.perf_counter_ns() < end:
                pass

    timing = Ticks(clock, command_and_pause)
    spec = RunSpec(robot="servo20", rate=RATE, seconds=last / RATE)
    played = Played(
        library,
        lambda opening: open_robots(opening, spec, library),
        lambda retarget: (
            decks.append(Deck(library, retarget, library.network.motions[0], direct=True, joining=joining)) or decks[0]
        ),
    )
    with open_session(spec, played, Host(clock=clock)) as session:
        session.run()
    begun = APPROACH + APART * np.arange(switches)
    spent = timing.column(ALL, slice(0, last))
    return spent[begun[:, None] + np.array([-BEFORE, *range(SHOWN)])]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks switch_ticks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--joining", choices=JOININGS, help="by default, what suits the network")
    parser.add_argument("--switches", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    spent = time_switches(library, options.joining, options.switches, options.seed)
    names = ["plays on", "carries the switch out", *(f"{after} later" for after in range(1, SHOWN))]
    rows = {
        name: np.percentile(column, (50.0, 90.0, 100.0)).round().tolist()
        for name, column in zip(names, spent.T, strict=True)
    }
    if options.json:
        print(json.dumps({"library": library.info.name, "percentiles": [50, 90, 100], "us": rows}))
        return 0
    print(f"{library.info.name}, {options.switches} switches, load {os.getloadavg()[0]:.1f}\n")
    print("| tick | p50 us | p90 | largest |\n|---|---|---|---|")
    for name, row in rows.items():
        print(f"| {name} | " + " | ".join(f"{value:.0f}" for value in row) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
