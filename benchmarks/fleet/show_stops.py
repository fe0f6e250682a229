"""A show's emergency stop while links are cut and members killed.

Schedules in random order with real processes, in network namespaces with loss and delay. Everything is judged by what
was done and by the decks' own recordings.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import typer

from benchmarks.command import run
from benchmarks.fleet._network import network
from benchmarks.fleet._show_mutants import MUTANTS
from benchmarks.fleet._stop_judge import (
    CONDUCTOR,
    DECKS,
    PAUSES,
    RELINK,
    REMEMBERS,
    DeckTicks,
    StopModel,
    delays,
    violations,
)
from benchmarks.fleet._stop_theatre import LOST_AFTER, StopTheatre

LOSSES, DELAYS_MS = (0.0, 0.05, 0.2), (2.0, 20.0, 50.0)
"""Of a schedule: the share of packets that are lost, each way, and the delay of the others."""

_FIRST_NET, _NICE = 80, -5
_STARTS, _LISTENS = 10.0, 2.0  # s that a deck may take to start, and by which it plays if it hears of no stop


def play_schedule(theatre: StopTheatre, chance: random.Random) -> None:
    """Does things in random order, one after the other."""
    theatre.weather(chance.choice(LOSSES), chance.choice(DELAYS_MS))
    for _ in range(chance.randint(4, 8)):
        theatre.settle_starts()
        _do_something(theatre, chance)
        time.sleep(chance.choice((0.05, 0.3, 0.6, 1.0)))
    theatre.settle_starts()
    time.sleep(1.0)


def _do_something(theatre: StopTheatre, chance: random.Random) -> None:
    decks = [name for name in DECKS if theatre.runs(name)]
    warm = [name for name in decks if name not in theatre.frozen]
    gone = [name for name in theatre.members if name not in theatre.processes]
    conducted = theatre.runs(CONDUCTOR)
    uncut = [name for name in theatre.members if name not in theatre.cut]
    pairs = [pair for pair in combinations(theatre.members, 2) if pair not in theatre.parted]
    choices: list[tuple[int, Any]] = [
        (3 * bool(decks), lambda: theatre.press_at(chance.choice(decks))),
        (2 * bool(decks), lambda: theatre.send_stop(chance.choice(decks))),
        (4 * bool(decks), lambda: theatre.reset(chance.choice(decks))),
        (2 * conducted, theatre.type_stop),
        (1 * conducted, theatre.press_on_page),
        (1 * conducted, theatre.go),
        (3 * (len(uncut) > 2), lambda: theatre.cut_link(chance.choice(uncut))),
        (3 * bool(theatre.cut), lambda: theatre.heal_link(chance.choice(sorted(theatre.cut)))),
        (3 * (len(theatre.parted) < 4), lambda: theatre.part(*chance.choice(pairs))),
        (4 * (len(decks) > 2), lambda: _press_beyond(theatre, *chance.sample(decks, 3))),
        (2 * bool(theatre.parted), lambda: theatre.join(*chance.choice(theatre.parted))),
        (3 * conducted, theatre.send_wrong_cue),
        (2 * bool(warm), lambda: theatre.freeze(chance.choice(warm))),
        (2 * bool(theatre.frozen), lambda: theatre.thaw(chance.choice(sorted(theatre.frozen)))),
        (2 * (len(decks) > 1), lambda: theatre.kill(chance.choice(decks))),
        (1 * conducted, lambda: theatre.kill(CONDUCTOR)),
        (4 * bool(gone), lambda: theatre.start(chance.choice(gone))),
        (3 * (len(decks) > 1), lambda: _restart(theatre, chance.choice(decks), cut=chance.random() < 0.5)),
        (3 * (len(decks) > 1), lambda: _start_after_press(theatre, *chance.sample(decks, 2))),
    ]
    weights, actions = zip(*choices, strict=True)
    chance.choices(actions, weights)[0]()


def _press_beyond(theatre: StopTheatre, deck: str, other: str, presser: str) -> None:
    """Cuts the links of a deck, but not that to one other, over which the stop comes that is then pressed elsewhere."""
    for name in theatre.members:
        if name not in (deck, other) and not {(deck, name), (name, deck)} & {*theatre.parted}:
            theatre.part(*sorted((deck, name), key=theatre.members.index))
    theatre.send_stop(presser)


def _restart(theatre: StopTheatre, deck: str, *, cut: bool) -> None:
    """Stops a deck, and restarts it at once, perhaps without links, so that it has to remember the stop."""
    theatre.send_stop(deck)
    time.sleep(2.0 * REMEMBERS)
    theatre.kill(deck)
    if cut and deck not in theatre.cut:
        theatre.cut_link(deck)
    theatre.start(deck)
    _wait_for(theatre, deck)


def _start_after_press(theatre: StopTheatre, deck: str, presser: str) -> None:
    """Starts a deck anew, after a stop that it has not heard."""
    theatre.kill(deck)
    theatre.send_stop(presser)
    theatre.start(deck)
    _wait_for(theatre, deck)


def _wait_for(theatre: StopTheatre, deck: str) -> None:
    """Waits until a started deck takes part, and as long as it listens for others."""
    began = time.monotonic()
    while deck in theatre.settle_starts() and time.monotonic() < began + _STARTS:
        time.sleep(0.05)
    time.sleep(_LISTENS)


def begin_anew(theatre: StopTheatre) -> float:
    """Restores everything, waits until each deck that a stop reaches is stopped, resets all; when that began, s."""
    theatre.weather(0.0, 2.0)
    for name in sorted(theatre.cut):
        theatre.heal_link(name)
    for name in sorted(theatre.frozen):
        theatre.thaw(name)
    for pair in [*theatre.parted]:
        theatre.join(*pair)
    for name in theatre.members:
        if name not in theatre.processes:
            theatre.start(name)
    restored = time.monotonic()
    while theatre.settle_starts():
        _limit(restored, "members take part")
        time.sleep(0.05)
    until = time.monotonic() + RELINK + 1.0
    while time.monotonic() < until and not _all_stopped(theatre):
        time.sleep(0.1)
    goes = False
    while not (goes and _all_play(theatre) and theatre.linked()):
        _limit(restored, "decks play")
        for name in DECKS:
            theatre.reset(name)
        goes = theatre.go()
        time.sleep(0.1)
    return restored


def _limit(since: float, what: str) -> None:
    if time.monotonic() > since + 60.0:
        raise TimeoutError(f"waited in vain until all {what}")


def _all_stopped(theatre: StopTheatre) -> bool:
    """Whether all decks that a stop has to reach are stopped."""
    model = StopModel(np.inf)
    for event in theatre.done:
        model.take(event)
    states = {name: theatre.status(name) for name in model.owed()}
    return all(state is not None and state.mode == "emergency stop" for state in states.values())


def _all_play(theatre: StopTheatre) -> bool:
    states = [theatre.status(name) for name in DECKS]
    return all(state is not None and state.mode == "playing" and not state.paused for state in states)


def judge(theatre: StopTheatre, parts: list[tuple[int, float]]) -> dict[str, Any]:
    """What was done, and what was wrong; `parts` are the schedules' seeds and when each began, s."""
    model = StopModel(LOST_AFTER + PAUSES if theatre.lost == "hold" else np.inf)
    for event in theatre.done:
        model.take(event)
    musts = model.finish(theatre.done[-1].at)
    (theatre.folder / "done.json").write_bytes(msgspec.json.encode([theatre.done, model.reached, parts]))
    ticks = {name: DeckTicks.read(theatre.recordings(name)) for name in DECKS}
    wrong = []
    for must, what in violations(musts, ticks):
        at = min(must.begins, must.still)
        seed, began = max((part for part in parts if part[1] <= at), key=lambda part: part[1], default=(0, at))
        wrong.append(f"schedule {seed} at {at - began:.2f} s: {must.name} ({must.why}) {what}")
    counts: dict[str, int] = {}
    for event in theatre.done:
        counts[event.what] = counts.get(event.what, 0) + 1
    return {
        "wrong": wrong,
        "counts": counts,
        "musts": len(musts),
        "linked": delays(model.reached, ticks, relinked=False).tolist(),
        "relinked": delays(model.reached, ticks, relinked=True).tolist(),
        "reports": theatre.reports,
        "moved": sum(int((deck.turned > 0.0).sum()) for deck in ticks.values()),
        "ticks": sum(len(deck.times) for deck in ticks.values()),
        "schedules": len(parts),
    }


def play_show(folder: Path, number: int, seeds: list[int], seconds: float, mutant: str) -> dict[str, Any]:
    """Plays schedules with one show, until there are no more or the time is over."""
    ends = time.monotonic() + seconds
    with suppress(OSError):
        os.nice(_NICE)  # the machine may have other work
    parts: list[tuple[int, float]] = []
    stuck: list[str] = []
    with network(len(DECKS) + 1, 2.0, 0.0, _FIRST_NET + number) as net:
        theatre = StopTheatre(folder, net, _FIRST_NET + number, "hold" if number % 2 == 0 else "go on", mutant)
        try:
            begin_anew(theatre)
            for seed in seeds:
                if time.monotonic() > ends:
                    break
                parts.append((seed, time.monotonic()))
                play_schedule(theatre, random.Random(seed))
                begin_anew(theatre)
                print(f"show {number}: schedule {seed}", file=sys.stderr, flush=True)
        except TimeoutError as error:
            stuck.append(f"schedule {parts[-1][0] if parts else 0}: {error}")
        finally:
            theatre.close()
    found = judge(theatre, parts)
    found["wrong"] += stuck
    return found


def main(
    schedules: Annotated[int, typer.Option(help="How many.")] = 100,
    seed: Annotated[int, typer.Option(help="Of the first one; each has the next.")] = 1,
    shows: Annotated[int, typer.Option(help="How many shows play them side by side.")] = 3,
    seconds: Annotated[float, typer.Option(help="No schedule begins after this time.")] = 900.0,
    keep: Annotated[Path | None, typer.Option(help="Keep recordings and logs in this new folder.")] = None,
    mutants: Annotated[bool, typer.Option("--mutants", help="Play them with each of some broken sources.")] = False,
    mutant: Annotated[str, typer.Option(help="With this one alone.")] = "",
    only: Annotated[int | None, typer.Option(hidden=True)] = None,
) -> None:
    """Cuts, kills and presses in random order, and judges by recordings whether anything moved. Needs root."""
    seeds = [*range(seed, seed + schedules)]
    with ExitStack() as opened:
        folder = keep or Path(opened.enter_context(tempfile.TemporaryDirectory(prefix="stops-")))
        folder.mkdir(exist_ok=True)
        if only is not None:
            print(json.dumps(play_show(folder, only, seeds[only::shows], seconds, mutant)))
            return
        numbers = {"schedules": schedules, "seed": seed, "shows": shows, "seconds": seconds}
        if mutants:
            print("| broken source | what was not still |\n|---|---|")
            for number, name in enumerate(MUTANTS):
                (folder / str(number)).mkdir()
                wrong = _wrong([*_side_by_side(folder / str(number), name, **numbers)])
                print(f"| {name} | {len(wrong)}: {wrong[0]} |" if wrong else f"| {name} | NOTHING |", flush=True)
            return
        began = time.monotonic()
        found = [*_side_by_side(folder, mutant, **numbers)]
        took = time.monotonic() - began
    for name, value in table(found, took):
        print(f"| {name} | {value} |")
    print(*_wrong(found), sep="\n")
    sys.exit(bool(_wrong(found)))


def _wrong(found: list[dict[str, Any]]) -> list[str]:
    return [line for each in found for line in each["wrong"]]


def _side_by_side(folder: Path, mutant: str, *, shows: int, **numbers: float) -> Iterator[dict[str, Any]]:
    """Plays shows in processes of their own."""
    words = [word for name, value in numbers.items() for word in (f"--{name}", str(value))]
    words += ["--shows", str(shows), "--mutant", mutant]
    running = []
    for number in range(shows):
        command = [sys.executable, "-m", "benchmarks", "show_stops", *words, "--only", str(number)]
        own = folder / f"show-{number}"
        running.append(subprocess.Popen([*command, "--keep", str(own)], stdout=subprocess.PIPE))
    for process in running:
        said, _ = process.communicate()
        if process.returncode:
            raise SystemExit("a show has failed: see above")
        yield json.loads(said)


def table(found: list[dict[str, Any]], took: float) -> Iterator[tuple[str, str]]:
    """What was done and measured, as rows."""
    counts: dict[str, int] = {}
    for each in found:
        for what, count in each["counts"].items():
            counts[what] = counts.get(what, 0) + count
    done = "; ".join(f"{count} {what}" for what, count in sorted(counts.items()))
    yield f"schedules of {len(found)} shows side by side, in {took / 60:.1f} minutes", str(_sum(found, "schedules"))
    yield "what was done", done
    yield "ticks in which joints moved, of all", f"{_sum(found, 'moved')} of {_sum(found, 'ticks')}"
    yield "times that a deck had to be still until its reset", str(_sum(found, "musts"))
    yield "times that it was not", str(len(_wrong(found)))
    for kind, what in (
        ("linked", "a stop is at a linked deck"),
        ("relinked", "a stop is at a deck whose link was restored or is new"),
        ("reports", "the conductor has said which decks a stop has reached"),
    ):
        times = np.array([each for one in found for each in one[kind]])
        if len(times):
            shown = f"{len(times)}: {np.median(times):.3f}, {np.percentile(times, 99):.3f}, {times.max():.3f}"
            yield f"times after which {what}, s: median, p99, longest", shown


def _sum(found: list[dict[str, Any]], what: str) -> int:
    return sum(each[what] for each in found)


if __name__ == "__main__":
    run("show_stops", main)
