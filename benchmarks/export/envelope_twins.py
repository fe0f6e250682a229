"""Whether the envelope in C does as its twin in Python, on a million targets.

Each run has limits and a tick of its own, and targets that wander, leap, leave the range or are
no numbers; now and then joints brake. Safe targets are compared bit for bit.
"""

from __future__ import annotations

import ctypes
import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run
from controller.deck.interfaces import JointLimits
from controller.loop.safety.compiled_envelope import SOURCE, CompiledEnvelope
from controller.loop.safety.safety_envelope import SafetyEnvelope
from hatch_build import compile_envelope

JOINTS, TICKS = 20, 500
KINDS = ("wander", "leap", "noise", "beyond")


def targets_of(kind: str, limits: JointLimits, rng: np.random.Generator) -> np.ndarray:
    """Targets of a run, shape (TICKS, JOINTS), rad."""
    middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
    if kind == "wander":
        return middle + half * np.sin(np.cumsum(rng.normal(0.0, 0.05, (TICKS, JOINTS)), axis=0))
    if kind == "leap":
        return np.repeat(rng.uniform(limits.lower, limits.upper, (TICKS // 50, JOINTS)), 50, axis=0)
    wild = middle + half * rng.normal(0.0, 1.0 if kind == "noise" else 5.0, (TICKS, JOINTS))
    if kind == "beyond":
        wild[rng.random(wild.shape) < 0.02] = rng.choice([np.nan, np.inf, -np.inf, 1e308])
    return wild


def differing(library: ctypes.CDLL, seed: int) -> int:
    """The number of safe targets of a run, of TICKS * JOINTS, in which the twins differ."""
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-3.0, 0.0, JOINTS)
    rates = (10.0 ** rng.uniform(*powers, JOINTS) for powers in ((-0.5, 1.5), (0.5, 2.5), (2.0, 4.5)))
    limits = JointLimits(lower, lower + rng.uniform(0.1, 4.0, JOINTS), *rates)
    dt = float(rng.choice([0.001, 0.005, 0.01, 0.02]))
    twins = SafetyEnvelope(limits, dt), CompiledEnvelope(library, limits, dt)
    for one in twins:
        one.start(0.5 * (limits.upper + lower))
    apart = 0
    for tick, targets in enumerate(targets_of(KINDS[seed % len(KINDS)], limits, rng)):
        ours, theirs = (one.brake() if tick % 120 > 110 else one(targets) for one in twins)
        apart += int((ours.view(np.int64) != theirs.view(np.int64)).sum())
    return apart


def main(
    targets: Annotated[int, typer.Option(help="How many targets.")] = 1_000_000,
    broken: Annotated[bool, typer.Option(help="With a braking law that is wrong in C: do the twins part?")] = False,
) -> None:
    """Compares the envelope in C with its twin in Python."""
    runs = -(-targets // (TICKS * JOINTS))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "envelope.c"
        text = SOURCE.read_text()
        source.write_text(text.replace("R(6.0)", "R(6.001)") if broken else text)
        if not compile_envelope(source, source.with_suffix(".so")):
            raise SystemExit("there is no C compiler here")
        library = ctypes.PyDLL(str(source.with_suffix(".so")))
        apart = [differing(library, seed) for seed in range(runs)]
    print(f"{runs * TICKS * JOINTS} targets in {runs} runs: {sum(apart)} differ, in {sum(map(bool, apart))} runs")


if __name__ == "__main__":
    run("envelope_twins", main)
