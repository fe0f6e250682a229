"""30 minutes of virtual time with commands, nonsense and every fault.

At 200 Hz, a command every half second.

Prints what was seen as one JSON object; the exit code is 1 if anything did not hold.
"""

from __future__ import annotations

import argparse
import os
import sys

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import msgspec  # noqa: E402

from benchmarks.deck.soak_run import soak  # noqa: E402
from controller.library.motion_library import load_library  # noqa: E402
from motiondeck_base.shipped import find_library, find_robot  # noqa: E402
from sim.robots.robot import load_robot  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=30.0, help="of virtual time")
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--robot", default="servo20")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    robot = load_robot(find_robot(options.robot), library.skeleton)

    def progress(seconds: float) -> None:
        print(f"\r{seconds / 60:.1f} of {options.minutes:g} minutes", end="", file=sys.stderr, flush=True)

    watch = progress if sys.stderr.isatty() else None
    report = soak(library, robot.retarget, robot.limits, 60.0 * options.minutes, seed=options.seed, progress=watch)
    print(msgspec.json.format(msgspec.json.encode(report)).decode())
    return 0 if report.passed else 1


if __name__ == "__main__":
    sys.exit(main())
