"""Stopping, judged from the wire: the deck killed, stopped and stalled.

The exit code is 1 if goals were beyond their limits.
"""

from __future__ import annotations

import time
from typing import Annotated

import typer

from benchmarks.command import run
from benchmarks.stop import kills as striking


def kills(
    count: Annotated[int, typer.Option("--count", help="How often the deck is struck.")] = 200,
    seed: Annotated[int, typer.Option("--seed", help="Of the moments and durations.")] = 0,
    option: Annotated[list[str] | None, typer.Option("--option", help="Of `play`, besides; repeatable.")] = None,
    each: Annotated[bool, typer.Option("--each", help="Print every strike too.")] = False,
) -> None:
    began = time.monotonic()
    strikes, undisturbed = striking.strike(count, seed, tuple(option or ()))
    if each:
        for strike in strikes:
            print(strike)
    print(striking.table(strikes, undisturbed))
    print(f"{len(strikes)} strikes in {time.monotonic() - began:.0f} s")
    raise typer.Exit(0 if all(strike.within and not strike.outside for strike in strikes) else 1)


if __name__ == "__main__":
    run("stop", kills, __doc__)
