"""Does a pose at a known phase depend on the speed before? Jogs from a stand.

Each of HDM05's jogs in a circle speeds up from standing to 2 m/s and then turns. Three times a third of them is held
back, one or two of each person; the others are learned frame by frame from their phase (that of the ankles), speed and
turn rate (both smoothed over 0.2 s), and every person's mean difference from all is added. The error is the mean
distance of joints from the hips in the recording that is held back, mm: mean over recordings, with the least and the
most of the seeds.

- *network*: an echo-state network that phase, speed and turn rate drive.
- *no memory*: the same without recurrence and time constant.
- *rates*: the same with the rates of change of the three as inputs too.
- *clips*: frames near in phase and speed, mixed by a line in speed and turn rate.

    python -m benchmarks changing_speed --data DIR [--seeds 51 --seeds 52 --seeds 53]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy.ndimage import gaussian_filter1d
from threadpoolctl import threadpool_limits

from benchmarks import command
from controller.motion.canonical.canonical_body import carried, to_canonical
from controller.motion.canonical.clip_edits import resampled
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import drive, random_reservoir
from controller.networks.ridge import ridge

RATE = 120.0
SEEDS = (51, 52, 53)
MOTION = "jogLeftCircle4StepsRstart"
SMOOTH_SECONDS = 0.2
NEURONS, HARMONICS, LEAK, RIDGE, ROUNDS = 300, 4, 0.2, 0.01, 3
NEAR_PHASE, NEAR_SPEED, STRAIGHT = 0.25, 0.5, 0.3  # widths of clips, the second in deviations; ridge of their lines


@dataclass(frozen=True)
class Jog:
    """A recording: who, joints (T, D) in mm, phase (T,) in rad, speed and turn rate (T, 2), scaled."""

    person: str
    joints: Array
    phase: Array
    course: Array


def jogs(data: Path) -> list[Jog]:
    """All recordings on one body."""
    paths = sorted((data / "hdm05" / MOTION).iterdir())
    clips = [resampled(read_clip(path), RATE) for path in paths]
    encoding = encoding_of(to_canonical(clips[0]).skeleton)
    ankles = [3 * encoding.skeleton.bones.index(name) for name in ("lank", "rank")]
    joints: list[Array] = []
    courses: list[Array] = []
    for clip in clips:
        channels = encoding.encode(carried(clip, encoding.skeleton))
        joints.append(joint_features(encoding, channels)[:, :-1])
        courses.append(smooth(channels[:, [2, 1]], SMOOTH_SECONDS))
    together = np.concatenate(courses)
    scaled = [(one - together.mean(0)) / together.std(0) for one in courses]
    return [
        Jog(path.name[4:6], own, phase_of(own[:, ankles[0]] - own[:, ankles[1]]), course)
        for path, own, course in zip(paths, joints, scaled, strict=True)
    ]


def smooth(signal: Array, seconds: float) -> Array:
    return gaussian_filter1d(signal, seconds * RATE, axis=0, mode="nearest")


def phase_of(step: Array) -> Array:
    """How far a gait has come, by how far one ankle is before the other, (T,), in rad."""
    step = smooth(step, 0.04)
    rate = np.gradient(step)
    pace = np.sqrt(smooth(rate**2, 0.5)) / np.maximum(np.sqrt(smooth(step**2, 0.5)), 1e-6)
    return smooth(np.unwrap(np.arctan2(-rate / pace, step)), 0.04)


def seen(jog: Jog, *, rates: bool) -> Array:
    """What drives a network: harmonics of the phase, the course and, with them, the rates of change of both."""
    turns = np.arange(1, HARMONICS + 1) * jog.phase[:, None]
    parts = [3.0 / np.sqrt(HARMONICS) * np.concatenate([np.cos(turns), np.sin(turns)], axis=1), 0.5 * jog.course]
    if rates:
        parts += [0.5 * smooth(np.gradient(jog.course, axis=0) * RATE, 0.1)]
        parts += [0.5 * (smooth(np.gradient(jog.phase) * RATE, 0.1) / 7.0 - 1.0)[:, None]]
    return np.concatenate(parts, axis=1)


def by_network(
    learned: Sequence[Jog], held: Sequence[Jog], seed: int, *, memory: bool, rates: bool = False
) -> list[Array]:
    """The joints by a driven network."""
    signals = [seen(one, rates=rates) for one in (*learned, *held)]
    reservoir = random_reservoir(
        NEURONS,
        signals[0].shape[1],
        spectral_radius=0.9 if memory else 0.0,
        input_scale=1.7,  # of weights from a uniform distribution: deviation 1
        bias_scale=1.4,
        leak=LEAK if memory else 1.0,
        rng=np.random.default_rng(seed),
    )
    settling = round(RATE)
    driven = drive(reservoir, [np.concatenate([np.repeat(one[:1], settling, axis=0), one]) for one in signals])
    states = [one[settling:] for one in driven]
    own: dict[str, Array] = {}
    told: list[Array] = []
    for _ in range(ROUNDS):
        inputs = np.concatenate(states[: len(learned)])
        wanted = np.concatenate([one.joints - own.get(one.person, 0.0) for one in learned])
        centre, middle = inputs.mean(0), wanted.mean(0)
        weights = ridge(inputs - centre, wanted - middle, RIDGE * len(inputs))
        told = [(one - centre) @ weights.T + middle for one in states]
        own = persons(learned, told)
    return [frames + own.get(one.person, 0.0) for one, frames in zip(held, told[len(learned) :], strict=True)]


def by_clips(learned: Sequence[Jog], held: Sequence[Jog]) -> list[Array]:
    """The joints of frames near in phase and course."""
    phase, course = (np.concatenate([getattr(one, name)[::3] for one in learned]) for name in ("phase", "course"))

    def mixed(jog: Jog, joints: Array) -> Array:
        out = np.empty((len(jog.phase), joints.shape[1]))
        for frame, (at, there) in enumerate(zip(jog.phase, jog.course, strict=True)):
            off = course - there
            near_phase = np.exp((np.cos(phase - at) - 1.0) / NEAR_PHASE**2)
            weight = near_phase * (np.exp(-0.5 * np.square(off / NEAR_SPEED).sum(1)) + 1e-12)
            line = np.column_stack([np.ones(len(off)), off])
            gram = (line * weight[:, None]).T @ line
            gram[[1, 2], [1, 2]] += STRAIGHT * gram[0, 0]
            out[frame] = np.linalg.solve(gram, (line * weight[:, None]).T @ joints)[0]
        return out

    thinned = [Jog(one.person, one.joints[::6], one.phase[::6], one.course[::6]) for one in learned]
    own: dict[str, Array] = {}
    for _ in range(2):
        joints = np.concatenate([one.joints[::3] - own.get(one.person, 0.0) for one in learned])
        own = persons(thinned, [mixed(one, joints) for one in thinned])
    joints = np.concatenate([one.joints[::3] - own.get(one.person, 0.0) for one in learned])
    return [mixed(one, joints) + own.get(one.person, 0.0) for one in held]


def persons(jogs_: Sequence[Jog], told: Sequence[Array]) -> dict[str, Array]:
    """What each person's joints are off in the mean, shape (D,)."""
    off: dict[str, list[Array]] = {}
    for one, frames in zip(jogs_, told, strict=False):
        off.setdefault(one.person, []).append(one.joints - frames)
    return {person: np.concatenate(each).mean(0) for person, each in off.items()}


Way = Callable[[Sequence[Jog], Sequence[Jog], int], list[Array]]
WAYS: dict[str, Way] = {
    "network": lambda learned, held, seed: by_network(learned, held, seed, memory=True),
    "no memory": lambda learned, held, seed: by_network(learned, held, seed, memory=False),
    "rates": lambda learned, held, seed: by_network(learned, held, seed, memory=False, rates=True),
    "clips": lambda learned, held, _: by_clips(learned, held),
}


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    seeds: Annotated[list[int] | None, typer.Option(help="Of the networks.")] = None,
) -> None:
    recordings = jogs(data)
    names = [one.person for one in recordings]
    folds = [names[:k].count(name) % 3 for k, name in enumerate(names)]
    with threadpool_limits(1):
        for name, way in WAYS.items():
            found: list[float] = []
            for seed in (seeds or SEEDS) if name != "clips" else SEEDS[:1]:
                off: list[float] = []
                for fold in range(3):
                    learned = [one for one, own in zip(recordings, folds, strict=True) if own != fold]
                    held = [one for one, own in zip(recordings, folds, strict=True) if own == fold]
                    for one, told in zip(held, way(learned, held, seed), strict=True):
                        distance = np.linalg.norm((told - one.joints).reshape(len(told), -1, 3), axis=-1)
                        off.append(float(distance.mean()))
                found.append(float(np.mean(off)))
            print(f"{name}: {np.mean(found):.1f} mm ({min(found):.1f}-{max(found):.1f})", flush=True)


if __name__ == "__main__":
    command.run("changing_speed", main, __doc__)
