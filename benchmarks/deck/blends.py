"""Whether each blend of two motions keeps moving and no joint turns over.

Three shares of each blend, from several moments.

Each mixture is played inside the network, as its paper has it; bone by bone, each at its own tempo; and bone by bone in
step, as the deck does. It stands still if
in some half second after the share was reached no joint moves a tenth as far as in the motion that moves less; it turns
over if a joint goes farther in one frame than two and a half times what it ever does in either motion.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from itertools import permutations

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.joins.deck_motions import read_motions, rounds_beside, tempos_in_step  # noqa: E402
from controller.deck.joins.posture_blend import PostureBlend  # noqa: E402
from controller.deck.routes import Routes  # noqa: E402
from controller.deck.tracks.frame_player import FramePlayer  # noqa: E402
from controller.deck.tracks.playing_tracks import STILL, TURNS_OVER  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.motion.encodings.motion_matching import joint_features  # noqa: E402
from controller.motion.quintic import rise  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

WAYS = ("inside", "bone by bone", "in step")
SHARES = (0.25, 0.5, 0.75)
SECONDS = 8.0


def played(library: MotionLibrary, first: str, second: str, share: float, seed: int, way: str) -> Array:
    """Joint positions of a mixture from a random moment of the first motion on, shape (frames, F), mm."""
    encoding, rate = library.encoding, library.info.rate
    one, other = library.network.twin(), library.network.twin()
    frames = np.zeros((2, one.channels))
    begin = int(np.random.default_rng(seed).integers(len(one.anchors(first))))
    one.cue(first, begin)
    for _ in range(10):
        one.advance(frames[0])
    weights = [share * rise(min(1.0, k / round(share * rate))) for k in range(1, round(SECONDS * rate) + 1)]
    if way == "inside":
        autonomous = one.as_autonomous
        assert autonomous is not None
        mixture, out = autonomous.morph(first, second), np.zeros((len(weights), one.channels))
        for weight, frame in zip(weights, out, strict=True):
            mixture.advance(weight, frame)
        return joint_features(encoding, out)
    anchors = joint_features(encoding, one.anchors(second))
    near = int(np.square(anchors - joint_features(encoding, frames[:1])).sum(1).argmin())
    players = FramePlayer(one, rate), FramePlayer(other, rate)
    players[0].cue_anchor(first, begin)
    players[0].step(10.0 / rate)
    players[1].cue_anchor(second, near)
    twist_by_rule = encoding.twist_by_rule
    start = [encoding.decode(player.step(0.0)) for player in players]
    blend = PostureBlend(start[0], encoding.skeleton.rest_direction if twist_by_rule else None)
    blend.add(start[1])
    motions, postures = read_motions(library), []
    lasts = motions[first].seconds, motions[second].seconds * rounds_beside(motions[first], motions[second])
    for weight in weights:
        tempos = tempos_in_step(lasts, (1.0 - weight, weight)) if way == "in step" else (1.0, 1.0)
        now = [encoding.decode(player.step(own / rate)) for player, own in zip(players, tempos, strict=True)]
        postures.append(blend.advance(now, (1.0 - weight, weight), 1.0 / rate))
    rotation, height = np.array([p.rotation for p in postures]), np.array([p.height for p in postures])
    joints = encoding.skeleton.joints(np.zeros((len(postures), 3)), rotation)[:, 1:]
    return 1e3 * np.concatenate([joints.reshape(len(postures), -1), height[:, None]], axis=1)


def alone(library: MotionLibrary) -> dict[str, tuple[float, float]]:
    """How far the joints of each motion go, mm, and how far at most in one frame."""
    found = {}
    for motion in library.info.motions:
        places = joint_features(library.encoding, library.network.anchors(motion.name))
        frames = motion.frames / len(places)  # from one to the next
        found[motion.name] = float(np.ptp(places, axis=0).max()), float(np.abs(np.diff(places, axis=0)).max()) / frames
    return found


def judged(places: Array, rate: float, least: float, fastest: float) -> tuple[bool, bool]:
    """Whether a mixture stands still, and whether it turns over."""
    half = round(0.5 * rate)
    after = places[round(rate) :]
    moved = min(np.ptp(after[k : k + half], axis=0).max() for k in range(0, len(after) - half, half // 2))
    return bool(moved < STILL * least), bool(np.abs(np.diff(places, axis=0)).max() > TURNS_OVER * fastest)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks blends", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--seeds", type=int, default=2, help="moments at which each mixture begins")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take every Nth pair only")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    repertoire = read_motions(library)
    routes = Routes.of(library)
    loops = [name for name, motion in repertoire.items() if motion.loop]
    pairs = [pair for pair in permutations(loops, 2) if not routes.way(*pair)][:: options.every]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    own = alone(library)
    found = {}
    for way in WAYS if library.network.as_autonomous is not None else WAYS[1:]:
        still = turned = 0
        for first, second in pairs:
            least, fastest = (choose(own[first][k], own[second][k]) for k, choose in enumerate((min, max)))
            for share in SHARES:
                runs = [played(library, first, second, share, seed, way) for seed in seeds]
                verdicts = np.array([judged(places, library.info.rate, least, fastest) for places in runs])
                still, turned = still + verdicts[:, 0].any(), turned + verdicts[:, 1].any()
        found[way] = {"mixtures": len(pairs) * len(SHARES), "stand_still": int(still), "turn_over": int(turned)}
    if options.json:
        print(json.dumps(found))
        return 0
    print(f"{options.library}: {len(pairs)} ordered pairs, shares {', '.join(map(str, SHARES))}, {len(seeds)} moments")
    print(f"{'':14}{'mixtures':>10}{'stand still':>13}{'turn over':>11}")
    for way, row in found.items():
        print(f"{way:14}{row['mixtures']:10}{row['stand_still']:13}{row['turn_over']:11}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
