"""Mixtures of all pairs of loops, by their conceptors and in the deck.

    python -m benchmarks phase_morphs [--library thesis15] [--mu -0.25 0.25 0.5 0.75 1.25] [--every 1] [--json]
    python -m benchmarks phase_morphs --data DIR --source cmu --seed 21      # of a network that is trained for it

Each mixture, (1 - mu) of one loop and mu of another (`controller/learning/motion_algebra.py`), plays until it has
settled; what counts is a round of it. Joints are those of the decoded body, whose bones keep their length.

- still: pairs whose joints move less than a quarter as fast as the motions do;
- activity: the root mean square speed of the joints, relative to the mean of both motions in step;
- jerk: the largest of any joint, relative to the larger of both motions' own; and that of both channels mixed in step;
- slide: the median speed of the lowest joint along the ground, less the mean of both motions' own, mm/s.

The deck's blend is that of `controller/deck/joins/posture_blend.py`, bone by bone along rotations, of both in step;
with mu below 0 or above 1 it goes beyond one of them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.reservoirs.phase_networks import learned, training_set
from controller.deck.joins.posture_blend import PostureBlend
from controller.learning.motion_algebra import mixed_conceptor, play_mixed
from controller.learning.trainers.shared_conceptor import SharedConceptorRecipe
from controller.library.motion_library import MotionLibrary, load_library
from controller.motion.clip import between_rows, walked_clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Posture
from controller.networks.phase_conceptor.network import PhaseConceptorMotion
from motiondeck_base.shipped import find_library

SETTLED_ROUNDS = 2
COLUMNS = ("activity", "jerk", "slide", "in step", "deck activity", "deck jerk", "deck slide")
SPREAD = {"activity": (0, 50, 100), "jerk": (50, 95, 100), "in step": (50, 95, 100), "slide": (50, 100)}


def in_step(motion: PhaseConceptorMotion, frames: int) -> Array:
    """The channels of a loop over a round of the reservoir's phase, from 0 on, between frames linearly."""
    channels = motion.read()
    share = np.arange(frames) / frames - motion.course.turn / (2.0 * np.pi)
    return between_rows(np.vstack([channels, channels[:1]]), np.arange(len(channels) + 1), share % 1.0 * len(channels))


def shown(library: MotionLibrary, postures: Posture) -> tuple[float, float, float]:
    """Speed (mm a frame) and largest jerk (mm a frame^3) of the joints over a round; slide (mm/s).

    The postures, (T + 3), are those of the round and of the three frames after it.
    """
    clip = walked_clip("", library.skeleton, postures, library.info.rate)
    places = library.skeleton.joints(clip.root_position, clip.rotation)
    joints = library.skeleton.joints(np.zeros_like(clip.root_position), clip.rotation)[:, 1:]
    seen = 1e3 * np.column_stack([joints.reshape(len(joints), -1), postures.height])
    speed = float(np.sqrt(np.square(np.diff(seen[:-2], axis=0)).mean()))
    lowest = places[:-1, :, 2].argmin(1)
    way = (places[1:] - places[:-1])[np.arange(len(lowest)), lowest, :2]
    slide = 1e3 * library.info.rate * float(np.median(np.linalg.norm(way, axis=1)))
    return speed, float(np.abs(np.diff(seen, n=3, axis=0)).max()), slide


def round_of(library: MotionLibrary, channels: Array) -> Posture:
    """The postures of a round (T, C) and of three frames more."""
    return library.encoding.decode(np.concatenate([channels, channels[:3]]))


def blended(library: MotionLibrary, channels: list[Array], tempos: list[float], mu: float) -> Posture:
    """The deck's blend over one round of either motion in step, (T, C), with mu of the second, and three frames more.

    The motions play at `tempos`, 1 being their own.
    """
    encoding, rate = library.encoding, library.info.rate
    rest = encoding.skeleton.rest_direction if encoding.twist_by_rule else None
    frames = len(channels[0])
    postures = [
        [
            replace(now, velocity=now.velocity * tempo, turn_rate=now.turn_rate * tempo)
            for now in (encoding.decode(frame) for frame in one)
        ]
        for one, tempo in zip(channels, tempos, strict=True)
    ]
    blend = PostureBlend(postures[0][0], rest)
    blend.add(postures[1][0])
    steps = range((SETTLED_ROUNDS + 1) * frames + 3)
    seen = [blend.advance([one[step % frames] for one in postures], (1.0 - mu, mu), 1.0 / rate) for step in steps]
    parts = [np.array([getattr(one, name) for one in seen[-frames - 3 :]]) for name in Posture.__dataclass_fields__]
    return Posture(**dict(zip(Posture.__dataclass_fields__, parts, strict=True)))


def mixtures(library: MotionLibrary, pair: tuple[str, str], mus: list[float]) -> Array:
    """What COLUMNS says of a pair, at each mu, shape (mus, 7)."""
    motions = [library.network[name] for name in pair]
    own = [shown(library, round_of(library, motion.read())) for motion in motions]
    rows = []
    for mu in mus:
        shares = np.array([1.0 - mu, mu])
        mixed = mixed_conceptor(library.network, f"{1.0 - mu} {pair[0]} + {mu} {pair[1]}")
        played = play_mixed(library, mixed)[0].read()
        frames = len(played)
        channels = [in_step(motion, frames) for motion in motions]
        tempos = [len(motion) / frames for motion in motions]
        weight = np.abs(shares) / np.abs(shares).sum()
        speed = sum(w * one[0] * tempo for w, one, tempo in zip(weight, own, tempos, strict=True))
        slide = sum(w * one[2] * tempo for w, one, tempo in zip(weight, own, tempos, strict=True))
        jerk = max(one[1] for one in own)
        mine, both, deck = (
            shown(library, postures)
            for postures in (
                round_of(library, played),
                round_of(library, np.tensordot(shares, channels, 1)),
                blended(library, channels, tempos, mu),
            )
        )
        in_both = both[1] / jerk
        beside = [(one[0] / speed, one[1] / jerk, one[2] - slide) for one in (mine, deck)]
        rows.append((*beside[0], in_both, *beside[1]))
    return np.array(rows)


def trained(data: Path, source: str, seed: int) -> MotionLibrary:
    """The loops of a source in a network like the one that is shipped, in the header of the shipped library."""
    shipped, known = load_library(find_library("thesis15")), training_set(data, source)
    recipe = msgspec.convert(shipped.info.recipe["network"], SharedConceptorRecipe)
    network, _ = learned(recipe, known, seed)
    return MotionLibrary(msgspec.structs.replace(shipped.info, rate=known.rate), network, known.encoding)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks phase_morphs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--mu", type=float, nargs="+", default=[-0.25, 0.25, 0.5, 0.75, 1.25])
    parser.add_argument("--every", type=int, default=1, help="only each n-th pair")
    parser.add_argument("--data", type=Path, help="the folder with the recordings, for --source")
    parser.add_argument("--source", help="train a network for these recordings (phase_networks has their names)")
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    if options.source:
        library = trained(options.data, options.source, options.seed)
    else:
        library = load_library(find_library(options.library))
    network = library.network
    loops = [name for name in network.motions if network[name].course.loop]
    pairs = list(itertools.combinations(loops, 2))[:: options.every]
    found = np.stack([mixtures(library, pair, options.mu) for pair in pairs])
    rows = []
    for mu, columns in zip(options.mu, found.transpose(1, 2, 0), strict=True):
        row = {"mu": mu, "pairs": len(pairs), "still": int((columns[0] < 0.25).sum())}
        row["rough"] = int((columns[1] > 1.5).sum())
        for name, values in zip(COLUMNS, columns, strict=True):
            row[name] = np.percentile(values, SPREAD[name.removeprefix("deck ")]).tolist()
        rows.append(row)
    if options.json:
        print(json.dumps(rows))
        return 0
    print(
        "| mu | still, jerk beyond 1.5 | activity: least / median / most | jerk: median / 95 % / largest "
        "| slide: median / most | jerk in step | deck's blend: activity | jerk | slide |\n" + 9 * "|---" + "|"
    )
    for row in rows:
        columns = [" / ".join(f"{value:.{0 if 'slide' in name else 2}f}" for value in row[name]) for name in COLUMNS]
        print(f"| {row['mu']:g} | {row['still']}, {row['rough']} of {row['pairs']} | {' | '.join(columns)} |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
