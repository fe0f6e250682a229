"""One motion over speed, played at a speed that was held back, and clips.

Each family is a gait of one person, or of several, recorded at different speeds. Each recording between the slowest and
the fastest is held back once; the network learns the others, in the manner of the person who is held back, and is
driven with the speed of the one held back. Of several people each is held back with all recordings too ("nobody
known"); the network then learns the average manner. Settings were chosen on six people; "two more recordings" of them
and "one more person", whose walk is known and whose run is held back, or the other way round, are tried beside these
six. The clips beside the network are those of the two nearest speeds, in step, mixed linearly, and the one clip of the
same person nearest in speed. The error is the mean distance of joints at the same phase, in mm, from the root, the
played one rolled into step, mean over seeds; "as learned" is that of the network at the values that it learned.

    python -m benchmarks driven_motions --data DIR [--seeds 51 52 53]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks import command
from controller.learning.preparation.cycles import aligned_cycles, person_variants, phase_lag
from controller.learning.preparation.training_motion import Lessons, TrainingMotion, Variant
from controller.learning.trainers.phase_conceptor import TRAINER, PhaseRecipe
from controller.motion.canonical.canonical_body import carried, to_canonical
from controller.motion.canonical.clip_edits import resampled
from controller.motion.encodings.encoding import Encoding, encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork
from controller.networks.storage import DrivingInput

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
MORE = {"cmu/35/35_05.amc": 1, "cmu/08/08_02.amc": 3}  # of these people
ONE_MORE = ("bvh/bandai/walk_normal_001.bvh", "bvh/bandai/run_normal_001.bvh")


def family(data: Path, files: Sequence[str]) -> tuple[Encoding, list[Variant]]:
    """Recordings in step."""
    clips = [resampled(read_clip(data / file), RATE) for file in files]
    encoding = encoding_of(to_canonical(clips[0]).skeleton)
    return encoding, aligned_cycles(encoding, [carried(clip, encoding.skeleton) for clip in clips], (), RATE)


@dataclass(frozen=True)
class Case:
    """A recording that is held back, and those that are learned, each with its person."""

    held: Variant
    person: int
    rest: list[Variant]
    people: list[int]

    @property
    def between(self) -> bool:
        """Whether it lies between the slowest and the fastest of the others."""
        speeds = [one.value for one in self.rest]
        return min(speeds) < self.held.value < max(speeds)

    @property
    def taught(self) -> list[Variant]:
        """What the network learns: the others as this person would do them; as recorded, if all are of one person."""
        if {*self.people} == {self.person}:
            return sorted(self.rest, key=speed_of)
        values = sorted({one.value for one in self.rest})
        return person_variants(str(self.person), self.rest, [str(one) for one in self.people], values)


def cases(variants: list[Variant], people: Sequence[int], *, known: bool, held: Sequence[int] = ()) -> list[Case]:
    """Recordings that are held back, by rising speed: some, or all that lie between others.

    Args:
        variants, people: the recordings, and who made each.
        known: whether other recordings of the same person are learned.
        held: which are held back; without it, all that can be.
    """
    found: list[Case] = []
    for index in held or range(len(variants)):
        left = [k for k in range(len(variants)) if k != index and (known or people[k] != people[index])]
        case = Case(variants[index], people[index], [variants[k] for k in left], [people[k] for k in left])
        found += [case] if held or case.between else []
    return sorted(found, key=lambda case: case.held.value)


def speed_of(variant: Variant) -> float:
    """Its speed."""
    return variant.value


def learned(variants: list[Variant], seed: int) -> PhaseDrivenNetwork[Any]:
    """A network of one motion over its input."""
    normalisation = Normalisation.fit([variant.frames for variant in variants])
    values, seconds = zip(*((variant.value, variant.seconds) for variant in variants), strict=True)
    taught = tuple(Variant(one.value, one.seconds, normalisation.apply(one.frames)) for one in variants)
    motion = TrainingMotion(
        GAIT, taught[0].frames, True, None, DrivingInput("speed", values, seconds, values[0]), taught
    )
    return TRAINER.train(RECIPE, Lessons([motion], normalisation, RATE), seed)


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
    """The clips of the two nearest values, mixed linearly; beyond them the last one."""
    rising = sorted(variants, key=speed_of)
    after = int(np.clip(np.searchsorted([one.value for one in rising], value), 1, len(rising) - 1))
    low, high = rising[after - 1], rising[after]
    share = float(np.clip((value - low.value) / (high.value - low.value), 0.0, 1.0))
    return (1.0 - share) * low.frames + share * high.frames


def error_mm(encoding: Encoding, frames: Array, wanted: Array) -> float:
    """The mean distance of joints from those wanted, once both run in step, mm."""
    ours, theirs = (joint_features(encoding, one) for one in (frames, wanted))
    ours = np.roll(ours, phase_lag(ours, theirs), axis=0)
    return float(np.linalg.norm((ours - theirs)[:, :-1].reshape(len(ours), -1, 3), axis=-1).mean())


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    seeds: Annotated[list[int] | None, typer.Option(help="Of the networks.")] = None,
) -> None:
    print("| family | held back, m/s | network (seeds), mm | interpolated clips | same person's clip | as learned |")
    print("|---|---|---|---|---|---|")
    with threadpool_limits(1):
        for name, files in ONE_PERSON.items():
            encoding, variants = family(data, files)
            report(name, encoding, cases(variants, [0] * len(variants), known=True), seeds or SEEDS)
        files = [file for files in SIX_PEOPLE for file in files]
        people = [person for person, own in enumerate(SIX_PEOPLE) for _ in own]
        encoding, variants = family(data, [*files, *MORE, *ONE_MORE])
        six, one_more = len(files), len(SIX_PEOPLE)
        report("six people, one recording", encoding, cases(variants[:six], people, known=True), seeds or SEEDS)
        report("six people, nobody known", encoding, cases(variants[:six], people, known=False), seeds or SEEDS)
        beside = six + len(MORE)
        more = cases(variants[:beside], [*people, *MORE.values()], known=True, held=range(six, beside))
        report("two more recordings", encoding, more, seeds or SEEDS)
        both = variants[:six] + variants[beside:]
        more = cases(both, [*people, one_more, one_more], known=True, held=range(six, len(both)))
        report("one more person", encoding, more, seeds or SEEDS)
        more = [replace(one, rest=one.rest[:six], people=one.people[:six]) for one in more]
        report("one more person, nobody known", encoding, more, seeds or SEEDS)


def report(name: str, encoding: Encoding, tried: list[Case], seeds: Sequence[int]) -> None:
    """A row for each recording that is held back, and their mean."""
    found: list[Array] = []
    for case in tried:
        value, wanted = case.held.value, case.held.frames
        errors, own = [], []
        for seed in seeds:
            network = learned(case.taught, seed)
            errors.append(error_mm(encoding, played(network, value), wanted))
            own += [
                error_mm(encoding, played(network, one.value), one.frames)
                for one in case.taught[:: len(case.taught) - 1]
            ]
        clips = error_mm(encoding, mixed(case.rest, value), wanted)
        same = [one for one, person in zip(case.rest, case.people, strict=True) if person == case.person]
        nearest = min(same, key=lambda one: abs(one.value - value), default=None)
        alone = error_mm(encoding, nearest.frames, wanted) if nearest is not None else np.nan
        found.append(np.array([np.mean(errors), clips, alone]))
        network_cell = f"{np.mean(errors):.1f} ({min(errors):.1f}-{max(errors):.1f})"
        print(
            f"| {name} | {value:.2f} | {network_cell} | {clips:.1f} | {number(alone)} | {np.mean(own):.1f} |",
            flush=True,
        )
    ours, clips, alone = np.mean(found, axis=0)
    print(f"| {name} | mean of {len(found)} | {ours:.1f} | {clips:.1f} | {number(alone)} | |", flush=True)


def number(value: float) -> str:
    """A figure, or a dash where there is none."""
    return "-" if np.isnan(value) else f"{value:.1f}"


if __name__ == "__main__":
    command.run("driven_motions", main, __doc__)
