"""How fast and how closely loops fall in step with a beat or another deck.

Beats: 80 to 140 a minute, given at the ticks after they were, from several phases; the error is by how much a step
misses its beat. Decks: two of them, one after the other from so many offsets; the second asks the first for its phase
over a socket of this machine, as `play --lock-to` does. Locked is when the error stays within 20 ms from then on.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from contextlib import closing

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.deck import Deck  # noqa: E402
from controller.deck.locks.phase_lock import LOCKED_WITHIN, wrapped  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.commands.command_handler import CommandHandler  # noqa: E402
from controller.loop.commands.commanded_run import CommandedRun  # noqa: E402
from controller.loop.stop_requests import StopRequest  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from controller.wire.command_socket import CommandClient, CommandServer  # noqa: E402
from controller.wire.leader_link import LeaderLink  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

DT = 1.0 / 200.0
LONGEST = 6.0  # s


def new_deck(library: MotionLibrary, motion: str, phase: float) -> Deck:
    return Deck(library, lambda pose: pose.root_position, motion, phase=phase)


def locked_after(errors: Array) -> float:
    """From when on all errors (one a tick, s) are within the bound, s; infinite if the last one is not."""
    beyond = np.flatnonzero(np.abs(errors) > LOCKED_WITHIN)
    if not len(beyond):
        return 0.0
    return (beyond[-1] + 1) * DT if beyond[-1] < len(errors) - 1 else float("inf")


def two_decks(library: MotionLibrary, motion: str, start: float, offset: float) -> tuple[Array, Array]:
    """The error of the second deck at each tick, s, and its tempo."""
    first, second = new_deck(library, motion, start), new_deck(library, motion, (start + offset) % 1.0)
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:
        desk, stop = CommandHandler(CommandedRun(first), [server]), StopRequest()
        second.leader = LeaderLink(client)
        second.lock("deck")
        errors, tempos = [], []
        for _ in range(round(LONGEST / DT)):
            desk(stop)
            first.update(DT)
            second.update(DT)
            assert first.phase is not None
            assert second.phase is not None
            assert first.phase_rate is not None
            errors.append(wrapped(first.phase - second.phase) / first.phase_rate)
            tempos.append(second.tempo)
        return np.array(errors), np.array(tempos)


def beaten(library: MotionLibrary, motion: str, rate: float, start: float, jitter: float) -> tuple[Array, float]:
    """By how much steps miss their beats, s, beat by beat, and the tempo in the end."""
    deck = new_deck(library, motion, start)
    deck.lock("beat")
    generator = np.random.default_rng([round(rate), round(1e3 * start)])
    true = 0.1 + np.arange(round(12.0 * rate / 60.0)) * 60.0 / rate
    waiting = list(true + jitter * generator.standard_normal(len(true)))
    times, turned = [0.0], [start]
    while deck.time < true[-1] + 0.01:
        while waiting and waiting[0] <= deck.time:
            deck.beat(deck.time - waiting.pop(0))
        deck.update(DT)
        assert deck.phase is not None
        times.append(deck.time)
        turned.append(turned[-1] + wrapped(deck.phase - turned[-1]))
    assert deck.phase_rate is not None
    at, rounds = np.interp(true, times, turned), deck.phase_rate
    steps = max(1, round(rate / 60.0 / rounds))
    return np.array([wrapped(phase, 1.0 / steps) for phase in at]) / rounds, deck.tempo


def rows_of_beats(library: MotionLibrary, motion: str, starts: int, jitter: float) -> Iterator[str]:
    for rate in range(80, 141, 10):
        misses, settled, tempo = [], [], 0.0
        for start in np.arange(starts) / starts:
            errors, tempo = beaten(library, motion, rate, float(start), jitter)
            beyond = np.flatnonzero(np.abs(errors) > LOCKED_WITHIN)
            settled.append((beyond[-1] + 1 if len(beyond) else 0) * 60.0 / rate)
            misses.append(np.abs(errors[round(4.0 * rate / 60.0) :]).max())
        yield f"| {motion} | {rate} | {tempo:.2f} | {max(settled):.1f} | {1e3 * max(misses):.1f} |"


def rows_of_decks(library: MotionLibrary, motion: str, offsets: int) -> Iterator[str]:
    generator = np.random.default_rng(7)
    after, left, tempos = [], [], []
    for offset in np.arange(offsets) / offsets:
        errors, tempo = two_decks(library, motion, float(generator.random()), float(offset))
        after.append(locked_after(errors))
        left.append(np.abs(errors[-200:]).max())
        tempos.append(tempo)
    spread = f"{np.min(tempos):.2f} to {np.max(tempos):.2f}"
    yield (
        f"| {motion} | {offsets} | {np.median(after):.2f} | {max(after):.2f} | {1e3 * max(left):.1f} | {spread} "
        f"| {sum(a <= 2.0 for a in after)} of {offsets} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks phase_lock", description=__doc__)
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--motions", nargs="+", default=["walk", "jog", "waltz"])
    parser.add_argument("--offsets", type=int, default=24, metavar="N", help="of two decks, evenly spread")
    parser.add_argument("--starts", type=int, default=3, metavar="N", help="phases at which each beat is begun")
    parser.add_argument(
        "--jitter", type=float, default=0.0, metavar="S", help="of single beats (standard deviation), s"
    )
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    print("| motion | beats a minute | tempo | within 20 ms after, s (worst) | largest miss after 4 s, ms |")
    print("|---|---|---|---|---|")
    for motion in options.motions:
        for row in rows_of_beats(library, motion, options.starts, options.jitter):
            print(row, flush=True)
    print("\n| motion | offsets | locked after, s (median) | (worst) | left in the end, ms | tempo | within 2 s |")
    print("|---|---|---|---|---|---|---|")
    for motion in options.motions:
        for row in rows_of_decks(library, motion, options.offsets):
            print(row, flush=True)


if __name__ == "__main__":
    sys.exit(main())
