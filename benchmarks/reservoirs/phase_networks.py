"""Phase-driven networks beside autonomous ones and a clip player.

On recordings of every source.

    python -m benchmarks phase_networks --data DIR [--sources thesis15 cmu ...] [--seeds 21 22 23] [--ablation]

Every network learns all motions of a source with its recipe's defaults, whatever they are, and with one seed at a time:
nothing is chosen and nothing is tried again. Per source and network:

- passed: motions that pass the self-test, of all seeds together;
- error: of the free run, mm; the median and the largest of all motions. Of phase-driven networks and of the clip player
  it is the mean distance at the same phase, of the others the self-test's distance to the nearest window;
- lost: runs that are not on their motion 2.5 s after a start at x(0) = s + U[-50, 50], with the 95 % interval over
  motions (runs of one motion are not independent of each other);
- training s, file MB beside the float32 channels, and the median step, us.

With --ablation, what each input of a phase-driven network brings. With --tolerances, the
phase-driven echo-state network that keeps to each of some errors, mm, beside the clip that does.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from controller.deck.tracks.frame_player import FramePlayer
from controller.learning.evaluation.failure_rates import wilson
from controller.learning.measures.disturbance import disturbed
from controller.learning.measures.self_test import Judge, after_disturbance, self_test
from controller.learning.recipe import MotionRecipe, NetworkRecipe, read_recipe
from controller.learning.reservoirs.conceptor_training import ConceptorRecipe
from controller.learning.trainers.clip import ClipRecipe
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.learning.trainers.trainer import trainer_of
from controller.learning.training_set import TrainingSet, prepare, to_learn
from controller.motion.encodings.encoding import encoding_of
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.networks.base import AnyNetwork
from controller.networks.clip.network import ClipPlayer
from motiondeck_base.errors import FileFormatError
from motiondeck_base.shipped import shipped_configs

RATE = 120.0
RUNS, RECOVERY_FRAMES = 4, 300
KEYS_EVERY, DIGITS = (2, 4, 6), 10  # frames, and binary digits of a key, of clips that are compressed
PHASE = PhaseRecipe()

NETWORKS: dict[str, NetworkRecipe] = {
    "phase-driven conceptors": PHASE,
    "phase-driven echo state": PhaseEchoStateRecipe(),
    "conceptors that share weights": SharedConceptorRecipe(),
    "conceptors": ConceptorRecipe(),
    "echo state": EchoStateRecipe(),
}
ABLATION: dict[str, NetworkRecipe] = {
    "phase, recurrence and V": PHASE,
    "no V (W_in = 0)": msgspec.structs.replace(PHASE, input_scale=0.0),
    "no recurrence (W = 0)": msgspec.structs.replace(PHASE, spectral_radius=0.0),
    "phase only (W = W_in = 0)": msgspec.structs.replace(PHASE, spectral_radius=0.0, input_scale=0.0),
    "no phase (W_phi = 0)": msgspec.structs.replace(PHASE, phase_scale=0.0),
}

# One-shots; every other motion is made a loop.
ONCE = ("10_0", "16_0", "02_04", "kick", "hop", "bow", "bye", "punch", "slash", "throw", "guide")


@dataclass(frozen=True)
class Row:
    """One network on one source, all seeds together; see the docstring of this file."""

    source: str
    network: str
    motions: int
    passed: float
    error_mm: float
    largest_error_mm: float
    lost: float | None
    lost_at_most: float | None
    training_s: float
    file_mb: float
    channels_mb: float
    step_us: float
    failing: tuple[str, ...]


def recordings(data: Path, source: str) -> list[Path]:
    """The files of a source other than thesis15."""
    cmu = sorted((data / "cmu").glob("[01][0-9]/*.amc")) + sorted((data / "cmu" / "35").glob("*.amc"))
    cmu = [file for file in cmu if file.with_name(f"{file.parent.name}.asf").exists()]
    people = sorted((data / "hdm05").glob("*/*.amc"))
    folders = sorted({file.parent for file in people})
    files = {
        "cmu": cmu,
        "hdm05": [sorted(folder.glob("*.amc"))[place] for folder in folders for place in (0, -1)],
        "bandai": sorted((data / "bvh" / "bandai").glob("*.bvh")),
        "hundred": people + cmu,
    }
    return files[source]


def training_set(data: Path, source: str) -> TrainingSet:
    """What the networks learn of a source; recordings that cannot be used are named."""
    if source in ("thesis15", "cmu86"):
        folder = data / "cmu" if source == "cmu86" else data
        return prepare(read_recipe(shipped_configs() / "libraries" / f"{source}.toml"), folder)
    if source == "long":
        clip = read_clip(data / "cmu" / "86" / "86_01.amc")
        encoding = encoding_of(clip.skeleton)
        motions = {plays: MotionRecipe(name=plays, file="86_01.amc", plays=plays) for plays in ("loop", "once")}
        frames = {plays: to_learn(encoding, clip, motion, clip.rate, 0.8)[0] for plays, motion in motions.items()}
        return TrainingSet(encoding, clip.rate, frames, {"loop": True, "once": False}, {})
    frames: dict[str, Array] = {}
    loops: dict[str, bool] = {}
    encoding = None
    for file in recordings(data, source):
        plays = "once" if any(word in file.name for word in ONCE) else "loop"
        try:
            clip = read_clip(file)
            encoding = encoding or encoding_of(clip.skeleton)
            motion = MotionRecipe(name=file.stem, file=file.name, plays=plays)
            frames[file.stem], _ = to_learn(encoding, clip, motion, RATE, 0.6)
            loops[file.stem] = plays == "loop"
        except FileFormatError as error:
            print(f"left out: {error}", file=sys.stderr)
    assert encoding is not None
    return TrainingSet(encoding, RATE, frames, loops, {})


def learned(recipe: NetworkRecipe, known: TrainingSet, seed: int) -> tuple[AnyNetwork, float]:
    """A network of a recipe, and how long its training took, s."""
    lessons = known.lessons()
    began = time.perf_counter()
    network = trainer_of(recipe).train(recipe, lessons, seed)
    return network, time.perf_counter() - began


def lost_runs(network: AnyNetwork, judge: Judge, seed: int) -> dict[str, int]:
    """How many of RUNS runs of each motion are lost after RECOVERY_FRAMES."""
    found: dict[str, int] = {}
    for motion in network.motions:
        rng = np.random.default_rng([seed, *motion.encode()])
        runs = disturbed("robustness", network, motion, RUNS, rng)[:, :RECOVERY_FRAMES]
        found[motion] = sum(
            not after_disturbance(network, judge, motion, run.astype(np.float64)).passed for run in runs
        )
    return found


def step_us(network: AnyNetwork, motion: str, rate: float) -> float:
    """The median time of a tick in continuous time, us."""
    player = FramePlayer(network, rate)
    player.cue(motion)
    spent = np.empty(2000)
    for tick in range(len(spent)):
        began = time.perf_counter()
        player.step(1.0 / rate)
        spent[tick] = time.perf_counter() - began
    return 1e6 * float(np.median(spent))


def measured(source: str, name: str, recipe: NetworkRecipe, known: TrainingSet, seeds: list[int]) -> Row:
    """One row of the table."""
    judge = Judge(known.encoding, known.frames, known.loops, known.rate)
    errors: list[float] = []
    failing: list[str] = []
    lost: dict[str, int] = {}
    seconds: list[float] = []
    megabytes = tick = 0.0
    for seed in seeds:
        network, spent = learned(recipe, known, seed)
        seconds.append(spent)
        verdicts = self_test(network, judge)
        errors += [verdict.error_mm for verdict in verdicts.values()]
        failing += [f"{motion} ({verdict.reason})" for motion, verdict in verdicts.items() if not verdict.passed]
        lost |= {f"{seed} {motion}": count for motion, count in lost_runs(network, judge, seed).items()}
        megabytes = 1e-6 * network.stored_bytes
        tick = step_us(network, network.motions[0], known.rate)
    bad = sum(count > 0 for count in lost.values())
    return Row(
        source,
        name,
        len(known.frames),
        1.0 - len(failing) / (len(seeds) * len(known.frames)),
        float(np.median(errors)),
        max(errors),
        sum(lost.values()) / (RUNS * len(lost)),
        wilson(bad, len(lost))[1],
        float(np.median(seconds)),
        megabytes,
        channels_mb(known),
        tick,
        tuple(failing),
    )


def clip_row(source: str, known: TrainingSet, every: int = 0) -> Row:
    """The row of a clip player: nothing to train, nothing that could be lost; a key in `every` frames, 0 for all."""
    recipe = ClipRecipe(keys_every=every, digits=DIGITS)
    player = learned(recipe, known, 0)[0] if every else ClipPlayer(known.frames, known.loops)
    verdicts = self_test(player, Judge(known.encoding, known.frames, known.loops, known.rate))
    errors = [verdict.error_mm for verdict in verdicts.values()]
    passed = sum(verdict.passed for verdict in verdicts.values()) / len(verdicts)
    whole, tick = channels_mb(known), step_us(player, player.motions[0], known.rate)
    size = 1e-6 * player.stored_bytes if every else whole
    name = f"clip, a key every {every} frames" if every else "clip player"
    return Row(
        source, name, len(errors), passed, float(np.median(errors)), max(errors), 0.0, None, 0.0, size, whole, tick, (),
    )  # fmt: skip


def channels_mb(known: TrainingSet) -> float:
    """The channels of all motions in single precision, MB."""
    return 4e-6 * sum(frames.size for frames in known.frames.values())


def rows(data: Path, sources: list[str], seeds: list[int], networks: dict[str, NetworkRecipe]) -> Iterator[Row]:
    """The table, row by row."""
    for source in sources:
        known = training_set(data, source)
        for name, recipe in networks.items():
            yield measured(source, name, recipe, known, seeds)
        yield clip_row(source, known)
        for every in KEYS_EVERY:
            yield clip_row(source, known, every)


def within(data: Path, sources: list[str], tolerances: list[float], seeds: list[int]) -> Iterator[str]:
    """A table, line by line: the phase-driven echo-state network within some errors beside the clip within them."""
    yield "| source | tolerance, mm | N | error, mm: median / largest | kB | clip: error, mm | kB | network / clip |"
    yield "|---|---|---|---|---|---|---|---|"
    for source in sources:
        known = training_set(data, source)
        for tolerance in tolerances:
            (clip,) = fitted(ClipRecipe(tolerance_mm=tolerance), known, [0])
            found = fitted(PhaseEchoStateRecipe(tolerance_mm=tolerance), known, seeds)
            neurons = ", ".join(str(size) for size in sorted({one.neurons for one, _ in found}))
            errors = [error for _, own in found for error in own]
            sizes = [one.stored_bytes for one, _ in found]
            times = " to ".join(f"{size / clip[0].stored_bytes:.3f}" for size in sorted({min(sizes), max(sizes)}))
            yield (
                f"| {source} | {tolerance:g} | {neurons} | {np.median(errors):.2f} / {max(errors):.2f} "
                f"| {1e-3 * np.median(sizes):.1f} | {np.median(clip[1]):.2f} / {max(clip[1]):.2f} "
                f"| {1e-3 * clip[0].stored_bytes:.1f} | {times} |"
            )


def fitted(recipe: NetworkRecipe, known: TrainingSet, seeds: list[int]) -> list[tuple[AnyNetwork, list[float]]]:
    """The network of a recipe with a tolerance for each seed, with the errors of its motions in the self-test, mm."""
    lessons, judge = known.lessons(), known.judge
    found: list[tuple[AnyNetwork, list[float]]] = []
    for seed in seeds:
        sized = trainer_of(recipe).sized(recipe, lessons, seed, judge, lambda _: None)
        network = trainer_of(recipe).settle(sized, lessons, seed, judge).network
        found.append((network, [verdict.error_mm for verdict in self_test(network, judge).values()]))
    return found


HEAD = (
    "| source | motions | network | passed | error, mm: median / largest | lost (95 %) | training, s "
    "| file, MB (channels) | tick, us |\n|---|---|---|---|---|---|---|---|---|"
)


def line(row: Row) -> str:
    """A row as the table in docs/networks.md has it."""
    bound = "" if row.lost_at_most is None else f" (up to {row.lost_at_most:.1%} of motions)"
    return (
        f"| {row.source} | {row.motions} | {row.network} | {row.passed:.1%} "
        f"| {row.error_mm:.2f} / {row.largest_error_mm:.2f} | {row.lost:.1%}{bound} | {row.training_s:.1f} "
        f"| {row.file_mb:.2f} ({row.channels_mb:.2f}) | {row.step_us:.0f} |"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks phase_networks",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="the folder with the recordings")
    parser.add_argument("--sources", nargs="+", default=["thesis15", "cmu", "hdm05", "bandai", "hundred", "long"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[21, 22, 23])
    parser.add_argument("--ablation", action="store_true", help="what each input of a phase-driven network brings")
    parser.add_argument("--only", nargs="+", help="networks by the beginning of their name")
    parser.add_argument("--tolerances", nargs="+", type=float, help="networks and clips within these, mm")
    parser.add_argument("--json", action="store_true", help="one JSON object a row")
    options = parser.parse_args()
    networks = ABLATION if options.ablation else NETWORKS
    if options.only:
        networks = {name: recipe for name, recipe in networks.items() if name.startswith(tuple(options.only))}
    if options.tolerances:
        with threadpool_limits(1):
            for text in within(options.data, options.sources, options.tolerances, options.seeds):
                print(text, flush=True)
        return 0
    if not options.json:
        print(HEAD)
    with threadpool_limits(1):
        for row in rows(options.data, options.sources, options.seeds, networks):
            print(json.dumps(asdict(row)) if options.json else line(row), flush=True)
            for failure in row.failing:
                print(f"{row.source}, {row.network}: {failure}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
