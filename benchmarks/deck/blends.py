"""Whether each blend of two motions keeps moving and no joint turns over.

Three shares of each blend, from several moments.

Each mixture is played inside the network, as its paper has it, and side by side. It stands still if in some half second
after the share was reached no joint moves a tenth as far as in the motion that moves less; it turns over if a joint
goes farther in one frame than two and a half times what it ever does in either motion.
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

from controller.deck.joins.blend_check import STILL, TURNS_OVER  # noqa: E402
from controller.deck.joins.deck_motions import read_motions  # noqa: E402
from controller.deck.routes import Routes  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.measures.motion_matching import joint_features  # noqa: E402
from controller.networks.base import Channels, FrameNetwork  # noqa: E402
from controller.networks.reservoirs.morph import ReservoirNetwork, morph  # noqa: E402
from controller.quintic import rise  # noqa: E402
from controller.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library  # noqa: E402

WAYS = ("inside", "side by side")
SHARES = (0.25, 0.5, 0.75)
SECONDS = 8.0


class SideBySide:
    """Two runs of a network, their frames mixed."""

    def __init__(self, first: FrameNetwork, second: FrameNetwork) -> None:
        self._runs, self._frames = (first, second), np.zeros((2, first.channels))

    def advance(self, mu: float, out: Channels) -> None:
        """Steps both one frame on and writes their mixture, mu of the second, into out."""
        for run, frame in zip(self._runs, self._frames, strict=True):
            run.advance(frame)
        out[:] = (1.0 - mu) * self._frames[0] + mu * self._frames[1]


def played(library: MotionLibrary, first: str, second: str, share: float, seed: int, inside: bool) -> Array:
    """Joint positions of a mixture from a random moment of the first motion on, shape (frames, F), mm."""
    network, rate = library.network.twin(), library.info.rate
    frame = np.zeros(network.channels)
    anchors = joint_features(library.encoding, network.anchors(second))
    network.cue(first, int(np.random.default_rng(seed).integers(len(network.anchors(first)))))
    for _ in range(10):
        network.advance(frame)
    if inside:
        assert isinstance(network, ReservoirNetwork)
        mixture = morph(network, first, second)
    else:
        near = np.square(anchors - joint_features(library.encoding, frame[None])).sum(1).argmin()
        other = library.network.twin()
        other.cue(second, int(near))
        mixture = SideBySide(network, other)
    out = []
    for k in range(1, round(SECONDS * rate) + 1):
        mixture.advance(share * rise(min(1.0, k / round(share * rate))), frame)
        out.append(frame.copy())
    return joint_features(library.encoding, np.array(out))


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
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    repertoire = read_motions(library)
    routes = Routes.between(repertoire)
    loops = [name for name, motion in repertoire.items() if motion.loop]
    pairs = [pair for pair in permutations(loops, 2) if not routes.by_way_of(*pair)]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    own = alone(library)
    found = {}
    for way in WAYS if isinstance(library.network, ReservoirNetwork) else WAYS[1:]:
        still = turned = 0
        for first, second in pairs:
            least, fastest = (choose(own[first][k], own[second][k]) for k, choose in enumerate((min, max)))
            for share in SHARES:
                runs = [played(library, first, second, share, seed, way == "inside") for seed in seeds]
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
