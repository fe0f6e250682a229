"""Mixtures of all pairs of loops, inside a network and in the deck.

    python -m benchmarks phase_morphs [--library thesis15] [--mu -0.3 0.25 0.5 0.75 1.3] [--json]

Each mixture plays until it has settled; what counts is a round of it. Joints are those of the decoded body, whose bones
keep their length whatever the channels are.

- still: pairs whose joints move less than a tenth as much as those of both motions played in step;
- activity: the root mean square speed of the joints, relative to both played in step (channels mixed, then decoded);
- jerk: the largest of any joint, relative to the larger of both motions' own; and that of both played in step.

The deck's blend is that of `controller/deck/joins/posture_blend.py`, bone by bone along rotations, of both in step;
with mu below 0 or above 1 it goes beyond one of them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import itertools
import json
import sys
from dataclasses import replace

import numpy as np

from controller.deck.joins.posture_blend import PostureBlend
from controller.library.motion_library import MotionLibrary, load_library
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.phase_conceptor.morph import PhaseMorph, channels_at
from controller.networks.phase_conceptor.network import PhaseConceptorNetwork
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library

SETTLED_ROUNDS = 2
COLUMNS = ("activity", "jerk", "in step", "deck activity", "deck jerk")


def speed_and_jerk(encoding: Encoding, channels: Array) -> tuple[float, float]:
    """The root mean square speed and the largest jerk of the joints over a round, mm a frame and mm a frame^3."""
    return _speed_and_jerk(joint_features(encoding, np.concatenate([channels, channels[:3]])))


def _speed_and_jerk(joints: Array) -> tuple[float, float]:
    """The same of features (T + 3, F): a round and the three frames after it."""
    speed = np.sqrt(np.square(np.diff(joints[:-2], axis=0)).mean())
    return float(speed), float(np.abs(np.diff(joints, n=3, axis=0)).max())


def blended(library: MotionLibrary, channels: tuple[Array, Array], tempos: tuple[float, float], mu: float) -> Array:
    """The features of the deck's blend over one round and three frames more, shape (T + 3, F), mm.

    Args:
        library: whose body it is.
        channels: a round of either motion in step, shape (T, C).
        tempos: of either, 1 being its own.
        mu: the share of the second.
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
    shown = [
        blend.advance([one[step % frames] for one in postures], (1.0 - mu, mu), 1.0 / rate)
        for step in range((SETTLED_ROUNDS + 1) * frames + 3)
    ][-frames - 3 :]
    joints = encoding.skeleton.joints(np.zeros((len(shown), 3)), np.array([one.rotation for one in shown]))[:, 1:]
    height = np.array([one.height for one in shown])
    return 1e3 * np.column_stack([joints.reshape(len(shown), -1), height])


def mixtures(library: MotionLibrary, network: PhaseConceptorNetwork, pair: tuple[str, str], mus: list[float]) -> Array:
    """Activity and jerk of a pair at each mu, the jerk of both in step, activity and jerk of the deck's: (mus, 5)."""
    encoding = library.encoding
    knots = sorted({0.0, 1.0, *mus})
    morph = PhaseMorph(network.twin(), *pair, knots)
    motions = [network[name] for name in pair]
    own = [speed_and_jerk(encoding, channels_at(motion, np.arange(len(motion)) / len(motion))) for motion in motions]
    rows = []
    for mu in mus:
        frames = round(len(motions[0]) ** (1.0 - mu) * len(motions[1]) ** mu)
        played = np.empty((frames, network.channels))
        for _ in range(SETTLED_ROUNDS):
            for frame in played:
                morph.advance(mu, frame)
        share = np.arange(frames) / frames
        source, target = (channels_at(motion, share) for motion in motions)
        speed, jerk = speed_and_jerk(encoding, played)
        together, beside = speed_and_jerk(encoding, (1.0 - mu) * source + mu * target)
        largest = max(own[0][1], own[1][1])
        tempos = len(motions[0]) / frames, len(motions[1]) / frames
        blend_speed, blend_jerk = _speed_and_jerk(blended(library, (source, target), tempos, mu))
        rows.append((speed / together, jerk / largest, beside / largest, blend_speed / together, blend_jerk / largest))
    return np.array(rows)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks phase_morphs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--mu", type=float, nargs="+", default=[-0.3, 0.25, 0.5, 0.75, 1.3])
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    network = library.network
    if not isinstance(network, PhaseConceptorNetwork):
        raise MotiondeckError(f"library '{options.library}' is not driven by its phase")
    loops = [motion.name for motion in library.info.motions if motion.plays == "loop"]
    pairs = list(itertools.combinations(loops, 2))
    found = np.stack([mixtures(library, network, pair, options.mu) for pair in pairs])
    rows = [
        {
            "mu": mu,
            "pairs": len(pairs),
            "still": int((activity < 0.1).sum()),
            "below 0.8": [" and ".join(pairs[place]) for place in np.flatnonzero(activity < 0.8)],
            "activity": np.percentile(activity, (0, 50, 100)).tolist(),
            "jerk": np.percentile(jerk, (50, 95, 100)).tolist(),
            "in step": np.percentile(beside, (50, 95, 100)).tolist(),
            "deck activity": np.percentile(deck_activity, (0, 50, 100)).tolist(),
            "deck jerk": np.percentile(deck_jerk, (50, 95, 100)).tolist(),
        }
        for mu, (activity, jerk, beside, deck_activity, deck_jerk) in zip(
            options.mu, found.transpose(1, 2, 0), strict=True
        )
    ]
    if options.json:
        print(json.dumps(rows))
        return 0
    print(
        "| mu | still | activity: least / median / most | jerk: median / 95 % / largest | jerk in step "
        "| deck's blend: activity | jerk |\n|---|---|---|---|---|---|---|"
    )
    for row in rows:
        columns = [" / ".join(f"{value:.2f}" for value in row[name]) for name in COLUMNS]
        print(f"| {row['mu']:g} | {row['still']} of {row['pairs']} | {' | '.join(columns)} |")
    for row in rows:
        if row["below 0.8"]:
            print(f"below 0.8 at {row['mu']:g}: {', '.join(row['below 0.8'])}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
