"""Whether the envelope in C does as its twin in Python, on a million targets.

Each run has limits and a tick of its own, and targets that wander, leap, leave the range or are
no numbers; now and then joints brake. Safe targets are compared bit for bit.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run
from benchmarks.export._c_player import SANITIZED
from controller.deck.interfaces import JointLimits
from controller.loop.safety.compiled_envelope import SOURCE, CompiledEnvelope
from controller.loop.safety.safety_envelope import SafetyEnvelope
from hatch_build import compile_envelope
from motiondeck.export.c_folder import PLAYER
from motiondeck.export.figure import UNIT, limit_rows

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


def compiled_fixed(folder: Path, *, broken: bool = False) -> Path:
    """The program that plays targets in fixed point, compiled in a folder with the sanitizers."""
    for source in (*PLAYER, Path(__file__).with_name("_envelope.c")):
        shutil.copy(source, folder)
    if broken:  # stops are taken to be shorter
        text = (folder / "envelope.c").read_text()
        (folder / "envelope.c").write_text(text.replace("run += way_in(q, fast,", "run += way_in(q, fast / 2,"))
    words = ["c++", "-std=c++17", "-DMD_FIXED", "-O1", *SANITIZED, "-x", "c++", folder / "_envelope.c"]
    subprocess.run([*words, "-o", folder / "envelope"], check=True)
    return folder / "envelope"


def beyond_limits(program: Path, seed: int) -> float:
    """By which share, or rad, a run in fixed point breaks a limit; at most 0 if none."""
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-3.0, 0.0, JOINTS)
    rates = (10.0 ** rng.uniform(*powers, JOINTS) for powers in ((-0.5, 1.5), (0.5, 2.5), (2.0, 4.5)))
    limits, dt = (
        JointLimits(lower, lower + rng.uniform(0.1, 4.0, JOINTS), *rates),
        float(rng.choice([0.005, 0.01, 0.02])),
    )
    start = 0.5 * (limits.upper + lower)
    wanted = np.nan_to_num(targets_of(KINDS[seed % len(KINDS)], limits, rng), posinf=60.0, neginf=-60.0).clip(
        -60.0, 60.0
    )
    brakes = (np.arange(TICKS) % 120 > 110).astype("<i4")
    given = np.column_stack([brakes, np.rint(wanted / UNIT).astype("<i4")])
    head = np.array([JOINTS, TICKS], "<i4").tobytes() + limit_rows(limits, dt, fixed=True)
    said = head + np.rint(start / UNIT).astype("<i4").tobytes() + given.tobytes()
    safe = UNIT * np.frombuffer(subprocess.run([program], input=said, capture_output=True, check=True).stdout, "<i4")
    path = np.concatenate([np.rint(start / UNIT)[None].repeat(3, axis=0) * UNIT, safe.reshape(TICKS, JOINTS)])
    rated = ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk))
    shares = [float((np.abs(np.diff(path, order, axis=0)) / (rate * dt**order)).max()) - 1.0 for order, rate in rated]
    return max(*shares, float((limits.lower - path).max()), float((path - limits.upper).max()))


def main(
    targets: Annotated[int, typer.Option(help="How many targets.")] = 1_000_000,
    broken: Annotated[bool, typer.Option(help="With a braking law that is wrong in C: is it found?")] = False,
    fixed: Annotated[bool, typer.Option(help="Limits that fixed-point numbers break, instead of twins.")] = False,
) -> None:
    """Compares the envelope in C with its twin in Python."""
    runs = -(-targets // (TICKS * JOINTS))
    with tempfile.TemporaryDirectory() as folder:
        if fixed:
            program = compiled_fixed(Path(folder), broken=broken)
            excess = [beyond_limits(program, seed) for seed in range(runs)]
            print(
                f"{runs * TICKS * JOINTS} targets in {runs} runs: limits broken in {sum(one > 0.0 for one in excess)}"
            )
            print(f"the largest excess is {max(excess):.1e} (none below 0)")
            return
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
