"""One motion over speed, played at a speed that was held back, and clips.

Each family is a gait of one person, or of several, recorded at different speeds. Each recording between the slowest and
the fastest is held back once; the network learns the others and is driven with the speed of the one held back. Of
several people each is held back with all recordings too ("nobody known"): another recording of the same person at
nearly the same speed says more than any speed does, and clips copy it. The clips beside the network are those of the
two nearest speeds, in step, mixed linearly. Both get the pace of the held-back one from the same rule. The error is the
mean distance of joints at the same phase, in mm, from the root, the played one rolled into step, mean over seeds; "as
learned" is that of the network at the values that it learned.

    python -m benchmarks driven_motions --data DIR [--seeds 51 52 53]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks import command
from controller.measures.motion_matching import joint_features
from controller.mocap.canonical.canonical_body import carried, to_canonical
from controller.mocap.canonical.clip_edits import resampled
from controller.mocap.encodings.encoding import Encoding, encoding_of
from controller.mocap.encodings.normalisation import Normalisation
from controller.mocap.formats.reading import read_clip
from controller.networks.reservoirs.driving_input import DrivingInput
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from controller.rotations import Array
from controller.training.preparation.cycles import in_step, steps_behind
from controller.training.preparation.training_motion import TrainingMotion, Variant
from controller.training.reservoirs.phase_conceptor_training import PhaseRecipe
from controller.training.reservoirs.phase_training import train_phase_driven

RATE = 120.0
RECIPE = PhaseRecipe(neurons=500, rank=100)
GAIT = "gait"
SEEDS = (51, 52, 53)

ONE_PERSON = {
    "thesis15: slow walk, walk, jog": ("jaeger/nnRawSlowWalk.mat", "jaeger/nnRawWalk.mat", "jaeger/nnRawRunJog.mat"),
    "CMU 08: slow walk, two walks": ("c3d/08_04_slowwalk.c3d", "cmu/08/08_03.amc", "cmu/08/08_01.amc"),
    "CMU 02: two walks, jog": ("cmu/02/02_01.amc", "cmu/02/02_02.amc", "cmu/02/02_03.amc"),
}
SIX_PEOPLE = (
    ("cmu/02/02_01.amc", "cmu/02/02_02.amc", "cmu/02/02_03.amc"),
    ("cmu/35/35_02.amc", "cmu/35/35_01.amc"),
    ("cmu/07/07_02.amc", "cmu/07/07_01.amc"),
    ("cmu/08/08_03.amc", "cmu/08/08_01.amc"),
    ("c3d/16_36_runjog.c3d",),
    ("cmu/09/09_06.amc",),
)


def family(data: Path, files: Sequence[str]) -> tuple[Encoding, list[Variant]]:
    """Recordings in step."""
    clips = [resampled(read_clip(data / file), RATE) for file in files]
    encoding = encoding_of(to_canonical(clips[0]).skeleton)
    return encoding, in_step(encoding, [carried(clip, encoding.skeleton) for clip in clips], (), RATE)


def splits(variants: list[Variant], people: Sequence[int]) -> Iterator[tuple[Variant, list[Variant]]]:
    """Each recording whose speed lies between those of the recordings that are left without its person, and those."""
    for held, person in zip(variants, people, strict=True):
        rest = [one for one, other in zip(variants, people, strict=True) if other != person]
        rest.sort(key=lambda variant: variant.value)
        if rest[0].value < held.value < rest[-1].value:
            yield held, rest


def learned(variants: list[Variant], seed: int) -> PhaseDrivenNetwork[Any]:
    """A network of one motion over its input."""
    normalisation = Normalisation.fit([variant.frames for variant in variants])
    values, seconds = zip(*((variant.value, variant.seconds) for variant in variants), strict=True)
    taught = tuple(Variant(one.value, one.seconds, normalisation.apply(one.frames)) for one in variants)
    motion = TrainingMotion(
        GAIT, taught[0].frames, True, None, DrivingInput("speed", values, seconds, values[0]), taught
    )
    return train_phase_driven([motion], normalisation, RECIPE, RATE, seed)


def played(network: PhaseDrivenNetwork[Any], value: float) -> Array:
    """A round at a value of the input, after one in which it settles."""
    network.set_input("speed", value)
    network.seek(GAIT, 0.0)
    frames = len(network[GAIT])
    out = np.empty((2 * frames, network.channels))
    for frame in out:
        network.advance(frame)
    return out[frames:]


def mixed(variants: list[Variant], value: float) -> Array:
    """The clips of the two nearest values, mixed linearly."""
    after = int(np.clip(np.searchsorted([one.value for one in variants], value), 1, len(variants) - 1))
    low, high = variants[after - 1], variants[after]
    share = (value - low.value) / (high.value - low.value)
    return (1.0 - share) * low.frames + share * high.frames


def error_mm(encoding: Encoding, frames: Array, wanted: Array) -> float:
    """The mean distance of joints from those wanted, once both run in step, mm."""
    ours, theirs = (joint_features(encoding, one) for one in (frames, wanted))
    ours = np.roll(ours, steps_behind(ours, theirs), axis=0)
    return float(np.linalg.norm((ours - theirs)[:, :-1].reshape(len(ours), -1, 3), axis=-1).mean())


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    seeds: Annotated[list[int] | None, typer.Option(help="Of the networks.")] = None,
) -> None:
    print("| family | held back, m/s | network (seeds), mm | interpolated clips, mm | as learned, mm |")
    print("|---|---|---|---|---|")
    with threadpool_limits(1):
        for name, files in ONE_PERSON.items():
            encoding, variants = family(data, files)
            report(name, encoding, splits(variants, range(len(variants))), seeds or SEEDS)
        encoding, variants = family(data, [file for files in SIX_PEOPLE for file in files])
        people = [person for person, files in enumerate(SIX_PEOPLE) for _ in files]
        report("six people, one recording", encoding, splits(variants, range(len(variants))), seeds or SEEDS)
        report("six people, nobody known", encoding, splits(variants, people), seeds or SEEDS)


def report(name: str, encoding: Encoding, cases: Iterator[tuple[Variant, list[Variant]]], seeds: Sequence[int]) -> None:
    """A row for each recording that is held back, by rising speed, and their mean."""
    found: list[Array] = []
    for held, rest in sorted(cases, key=lambda case: case[0].value):
        errors, own = [], []
        for seed in seeds:
            network = learned(rest, seed)
            errors.append(error_mm(encoding, played(network, held.value), held.frames))
            own += [error_mm(encoding, played(network, one.value), one.frames) for one in (rest[0], rest[-1])]
        clips = error_mm(encoding, mixed(rest, held.value), held.frames)
        found.append(np.array([np.mean(errors), clips]))
        network_cell = f"{np.mean(errors):.1f} ({min(errors):.1f}-{max(errors):.1f})"
        print(f"| {name} | {held.value:.2f} | {network_cell} | {clips:.1f} | {np.mean(own):.1f} |", flush=True)
    ours, clips = np.mean(found, axis=0)
    print(f"| {name} | mean of {len(found)} | {ours:.1f} | {clips:.1f} | |", flush=True)


if __name__ == "__main__":
    command.run("driven_motions", main, __doc__)
