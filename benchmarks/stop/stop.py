"""Stops judged from the wire: of killed decks, and beside broken parts.

`kills` has the deck process killed, stopped and stalled at random moments; `matrix` tries every way to stop beside
every broken part. The exit code is 1 if anything is not as it must be.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.command import run
from benchmarks.stop import fault_matrix
from benchmarks.stop import kills as striking

PAGE = Path(__file__).parents[2] / "docs" / "deck.md"
_BETWEEN = re.compile(r"(<!-- stops, by benchmarks stop -->\n).*?(<!-- end of stops -->)", re.S)


def kills(
    count: Annotated[int, typer.Option("--count", help="How often the deck is struck.")] = 200,
    seed: Annotated[int, typer.Option("--seed", help="Of the moments and durations.")] = 0,
    option: Annotated[list[str] | None, typer.Option("--option", help="Of `play`, besides; repeatable.")] = None,
    each: Annotated[bool, typer.Option("--each", help="Print every strike too.")] = False,
) -> None:
    began = time.monotonic()
    result = striking.strike(striking.plan(count, seed), seed, tuple(option or ()))
    if each:
        for strike in result.strikes:
            print(strike)
    print(striking.table(result))
    print(f"{len(result.strikes)} strikes in {time.monotonic() - began:.0f} s")
    raise typer.Exit(0 if result.good and len(result.strikes) == count else 1)


def matrix(
    repetitions: Annotated[int, typer.Option("--repetitions", help="Trials of each cell.")] = 3,
    seed: Annotated[int, typer.Option("--seed", help="Of the moments.")] = 0,
    lanes: Annotated[int, typer.Option("--lanes", help="How many decks play at a time.")] = 2,
    source: Annotated[list[str] | None, typer.Option("--source", help="Only this way to stop; repeatable.")] = None,
    fault: Annotated[list[str] | None, typer.Option("--fault", help="Only this broken part; repeatable.")] = None,
    each: Annotated[bool, typer.Option("--each", help="Print every trial too.")] = False,
    write: Annotated[bool, typer.Option("--write", help="Write the table into docs/deck.md.")] = False,
) -> None:
    began = time.monotonic()
    chosen = fault_matrix.stages(source or fault_matrix.SOURCES, fault or fault_matrix.FAULTS)
    trials: list[fault_matrix.Trial] = []
    failures: list[str] = []
    for own, failed in fault_matrix.run_all(repetitions, seed, lanes, chosen):
        trials += own
        failures += failed
        for trial in own if each else ():
            print(trial, flush=True)
        for failure in failed:
            print(f"not judged: {failure}", file=sys.stderr, flush=True)
    print(fault_matrix.table(trials))
    if write:
        PAGE.write_text(with_table(PAGE.read_text(), fault_matrix.table(trials)))
    print(f"{len(trials)} trials in {time.monotonic() - began:.0f} s")
    raise typer.Exit(0 if not failures and all(trial.at_rest and trial.in_time for trial in trials) else 1)


def with_table(page: str, table: str) -> str:
    """The page with this table of stops."""
    return _BETWEEN.sub(lambda found: f"{found[1]}\n{table}\n\n{found[2]}", page)


if __name__ == "__main__":
    run("stop", kills, __doc__, matrix)
