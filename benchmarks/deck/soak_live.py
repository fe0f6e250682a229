"""30 minutes of real time with everything switched on.

`play` on servo20 at 200 Hz with simulated servos and masses, emulated servos, recognition, kept-apart limbs, the page,
a recording, commands over the network and a subscriber whose heartbeat is watched. Twice a second comes a command of
any kind, local or sealed over the network. Every ten seconds the memory of each process is looked at (its own pages,
/proc/PID/smaps_rollup), and the recording judges the end: each target is finite and within its four limits, and no
target moves from two seconds after an emergency stop on. A command that stays without an answer is counted, and any
word that the deck said.

Prints one JSON object; the exit code is 1 if anything did not hold.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from benchmarks.deck.memory_growth import growth
from benchmarks.deck.soak_run import random_command
from controller.deck.interfaces import JointLimits
from controller.deck.switch_plan import REMEMBERED_SWITCHES
from controller.library.motion_library import load_library
from controller.motion.rotations import Array
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import DeckCommand, GetStatus, GiveBeat, Jump, LockPhase, Stop, Switch, Unlock
from controller.wire.messages.deck_snapshot import MODES
from controller.wire.messages.replies import State
from controller.wire.run_recording import RunRecording, load_recording
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library, find_robot
from sim.robots.robot import load_robot

RATE = 200.0  # Hz, the default of `play`
COMMAND_EVERY_S, LOOK_EVERY_S, STOPPED_WITHIN_S = 0.5, 10.0, 2.0
FILLED_EVERY_S = 0.02
OPTIONS = "--robot servo20 --rig emulated --recognize --check-collisions --port 0 --command-port 7000 --json"
PATIENCE = 60.0  # s
ROUNDING = 1e-6


def start(folder: Path) -> subprocess.Popen[str]:
    """The deck, its shared files and its words in a folder."""
    token = folder / "token"
    token.touch(0o600)
    token.write_text("soak" * 8)
    words = ["play", *OPTIONS.split(), "--record", str(folder / "run.rec")]
    words += ["--listen", "127.0.0.1", "--token-file", str(token)]
    return subprocess.Popen(
        [sys.executable, "-m", "motiondeck.cli.main", *words],
        env=os.environ | {"TMPDIR": str(folder), "XDG_RUNTIME_DIR": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=(folder / "report.json").open("w"),
        stderr=(folder / "words.txt").open("w"),
        text=True,
        start_new_session=True,
    )


def subscriber(folder: Path) -> subprocess.Popen[str]:
    """Prints the deck's events into a file, and is missed when it is gone."""
    return subprocess.Popen(
        [sys.executable, "-m", "motiondeck.cli.main", "events", "--command-port", "7000", "--heartbeat", "5", "--json"],
        env=os.environ | {"XDG_RUNTIME_DIR": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=(folder / "events.txt").open("w"),
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def processes(folder: Path) -> dict[str, int]:
    """The processes of the run by name."""
    found: dict[str, int] = {}
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if f"XDG_RUNTIME_DIR={folder}\0".encode() in (place / "environ").read_bytes():
                words = (place / "cmdline").read_text().split("\0")
                name = words[words.index("-m") + 1].rpartition(".")[2] if "-m" in words else words[0]
                found[f"{name} {words[words.index('-m') + 2]}" if name == "main" else name] = int(place.name)
    return found


def own_kb(process: int) -> float | None:
    """The memory that belongs to one process alone, kB, without shared files (the recording's ring is one)."""
    with contextlib.suppress(OSError):
        for line in (Path("/proc") / str(process) / "smaps_rollup").read_text().splitlines():
            if line.startswith("Private_Dirty:"):
                return float(line.split()[1])
    return None


def any_command(rng: np.random.Generator, motions: tuple[str, ...]) -> DeckCommand:
    """A command of any kind; a third of them are those that only decks with a phase know."""
    kinds: tuple[DeckCommand, ...] = (
        Jump(phase=float(rng.uniform())),
        GiveBeat(ago=float(rng.uniform(0.0, 0.1))),
        LockPhase("beat", phase=float(rng.uniform()), steps=int(rng.integers(1, 4))),
        LockPhase("body"),
        Unlock(),
    )
    if rng.random() < 1.0 / 3.0:
        return kinds[int(rng.integers(len(kinds)))]
    return random_command(rng, motions, 0)


def plays(client: CommandClient) -> bool:
    """Whether the deck answers already."""
    try:
        return isinstance(client.request(GetStatus(), 1.0), State)
    except MotiondeckError:
        return False


def written(targets: Array) -> Array:
    """The targets (T, J) without those of ticks that were not written, in which a record repeats the ones before.

    After a stall fewer ticks are written than run (`controller.loop.safety.pace`). No robot that moves stands exactly
    still for one tick, so a row that is the same as the one before, between rows that are not, is such a tick.
    """
    same = np.r_[False, (targets[1:] == targets[:-1]).all(axis=1)]
    alone = same & ~np.r_[False, same[:-1]] & ~np.r_[same[1:], False]
    return targets[~alone]


def judge(run: RunRecording, limits: JointLimits) -> dict[str, int]:
    """How many targets of a recording were not finite, beyond one of the limits, or moved in an emergency stop."""
    dt = 1.0 / RATE
    targets = run.fields["targets"]
    in_turn = written(targets)
    inside = (targets >= limits.lower - ROUNDING) & (targets <= limits.upper + ROUNDING)
    found = {"not finite": int((~np.isfinite(targets)).sum()), "position": int((~inside).sum())}
    for order, (name, limit) in enumerate(
        (("velocity", limits.velocity), ("acceleration", limits.acceleration), ("jerk", limits.jerk)), start=1
    ):
        steps = np.abs(np.diff(in_turn, n=order, axis=0))
        found[name] = int((steps > limit * dt**order * (1.0 + ROUNDING) + 1e-12).sum())
    stopped = run.fields["mode"].ravel() == MODES.index("emergency stop")
    since = np.array([*itertools.accumulate(stopped, lambda count, stop: (count + 1) * int(stop), initial=0)][1:])
    still = since[1:] > STOPPED_WITHIN_S * RATE
    found["moved in an emergency stop"] = int((np.diff(targets, axis=0)[still] != 0.0).any(axis=-1).sum())
    return found


def soak(folder: Path, seconds: float, seed: int) -> dict[str, Any]:
    """Plays and commands for so long; what was seen."""
    rng = np.random.default_rng(seed)
    library = load_library(find_library("thesis15"))
    motions, limits = library.network.motions, load_robot(find_robot("servo20"), library.skeleton).limits
    deck = start(folder)
    memory: dict[str, list[tuple[float, float]]] = {}
    counts: Counter[str] = Counter()
    try:
        until = time.monotonic() + PATIENCE
        os.environ["XDG_RUNTIME_DIR"] = str(folder)  # where this process looks for the deck's socket
        clients = [CommandClient(7000), CommandClient(7000, "127.0.0.1", b"soak" * 8)]
        while not plays(clients[0]):
            if deck.poll() is not None or time.monotonic() > until:
                raise MotiondeckError(f"the deck has not started: {(folder / 'words.txt').read_text()}")
            time.sleep(0.1)
        events = subscriber(folder)
        # The record of the latest switches is filled first, or it would look like growth for an hour.
        for motion in itertools.islice(itertools.cycle(motions), REMEMBERED_SWITCHES):
            clients[0].request(Switch(motion), 5.0)
            time.sleep(FILLED_EVERY_S)
        began = looked = time.monotonic()
        while (now := time.monotonic()) - began < seconds and deck.poll() is None:
            message = any_command(rng, motions)
            try:
                reply = clients[int(rng.integers(2))].request(message, 2.0)
                counts[str(type(reply).__struct_config__.tag)] += 1
            except MotiondeckError as error:
                counts[f"unanswered: {error}"] += 1
            if now - looked >= LOOK_EVERY_S:
                looked = now
                for name, process in processes(folder).items():
                    if (kb := own_kb(process)) is not None:
                        memory.setdefault(name, []).append((now - began, kb))
            time.sleep(max(COMMAND_EVERY_S - (time.monotonic() - now), 0.0))
        with contextlib.suppress(MotiondeckError):
            clients[0].request(Stop(), 5.0)
        deck.wait(PATIENCE)
        events.wait(PATIENCE)
        for client in clients:
            client.close()
    finally:
        for process in processes(folder).values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, 9)
    report = json.loads((folder / "report.json").read_text() or "{}")
    run = load_recording(folder / "run.rec")
    told = Counter(
        json.loads(line)["kind"] for line in (folder / "events.txt").read_text().splitlines() if line[:1] == "{"
    )
    second_half = {name: points[len(points) // 2 :] for name, points in memory.items()}
    return {
        "exit_code": deck.returncode,
        "seconds": seconds,
        "ticks": run.ticks,
        "not written": run.ticks - len(written(run.fields["targets"])),
        "answers": dict(counts),
        "events": dict(told),
        "violations": judge(run, limits),
        "own_kb": {name: (points[0][1], points[len(points) // 2][1], points[-1][1]) for name, points in memory.items()},
        "growth_kb_per_hour": {name: msgspec.to_builtins(growth(points)) for name, points in second_half.items()},
        "faults": report.get("faults"),
        "overruns": report.get("overruns"),
        "reason": report.get("reason"),
        "words": (folder / "words.txt").read_text().splitlines()[-20:],
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks soak_live", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="an empty folder for recording, events and words")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        found = soak(options.keep or Path(folder), 60.0 * options.minutes, options.seed)
    print(json.dumps(found, indent=1))
    unanswered = any(answer.startswith("unanswered") for answer in found["answers"])
    return int(found["exit_code"] != 0 or any(found["violations"].values()) or unanswered)


if __name__ == "__main__":
    sys.exit(main())
