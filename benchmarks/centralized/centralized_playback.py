"""Ten minutes of every motion, a million steps, and all switches.

Ten minutes of every motion against the range of its first round; the amplitude of the centers after a million steps;
and the 99.9 % quantile of the joints' accelerations while the deck switches once between every ordered pair, over that
of the motions themselves (each counting alike). cmu86 if no library is named.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.motion.rotations import Array
from controller.networks.centralized.centralized import CentersPlayer
from controller.networks.centralized.network import CentralizedNetwork
from motiondeck_base.errors import MotiondeckError

DT = 1.0 / 120.0
SHIPPED = Path(__file__).parents[1] / "configs" / "libraries" / "cmu86.safetensors"


def outside(network: CentralizedNetwork, motion: str, minutes: float = 10.0) -> float:
    """How far ten minutes leave the range of the first round, as a share of that range (the worst channel)."""
    part = network[motion]
    voice, out = CentersPlayer(part, 0.0), np.empty(network.channels)
    taught = part.at(np.arange(0.0, part.seconds, DT))
    low, high = taught.min(0), taught.max(0)
    room = np.maximum(high - low, 1e-6)
    worst = 0.0
    for _ in range(round(60.0 * minutes / DT)):
        voice.advance(DT)
        voice.read(out)
        worst = max(worst, float(((out - high) / room).max()), float(((low - out) / room).max()))
    return worst


def drift(network: CentralizedNetwork, motion: str, steps: int = 1_000_000) -> float:
    """How far the amplitude of a center is from 1 after some steps."""
    voice = CentersPlayer(network[motion], 0.0)
    for _ in range(steps):
        voice.advance(DT)
    return float(np.abs(np.abs(voice.centers) - 1.0).max())


def accelerations(library: MotionLibrary, heights: Array, rotations: Array) -> Array:
    """Of the joints, seen from the root, m/s^2."""
    root = np.zeros((len(heights), 3))
    root[:, 2] = heights
    places = library.skeleton.joints(root, rotations)
    return (np.linalg.norm(np.diff(places, n=2, axis=0), axis=-1) / DT**2).ravel()


def switches(library: MotionLibrary) -> tuple[float, float]:
    """The 99.9 % quantile over all ordered pairs, m/s^2, and the longest switch, s."""
    rng, found, longest = np.random.default_rng(0), [], 0.0
    for source in library.network.motions:
        for target in library.network.motions:
            if source == target:
                continue
            deck = Deck(library, lambda pose: pose.root_position, source, direct=True)
            for _ in range(int(rng.integers(10, 150))):
                deck.update(DT)
            shown = []

            def run(ticks: int, deck: Deck = deck, shown: list = shown) -> None:
                for _ in range(ticks):
                    deck.update(DT)
                    shown.append((float(deck.posture.height), deck.posture.rotation))

            run(3)
            deck.switch(target)
            before = deck.time
            run(1)
            while not deck.settled and deck.time < before + 5.0:
                run(1)
            longest = max(longest, deck.time - before)
            run(12)
            found.append(accelerations(library, np.array([h for h, _ in shown]), np.array([r for _, r in shown])))
    return float(np.quantile(np.concatenate(found), 0.999)), longest


def main(
    library_file: Annotated[Path, typer.Argument(metavar="LIBRARY_FILE", help="Default: cmu86.")] = SHIPPED,
) -> None:
    library = load_library(library_file)
    network = library.network
    if not isinstance(network, CentralizedNetwork):
        raise MotiondeckError(f"{library_file}: this library holds no centralized network")
    rng, taught = np.random.default_rng(1), []
    for motion in network.motions:
        part = network[motion]
        said = library.encoding.decode(part.at(np.arange(0.0, 2.0 * part.seconds, DT)))
        taught.append(rng.choice(accelerations(library, said.height, said.rotation), 20_000))
        print(f"{motion:10} ten minutes leave its range by {100.0 * outside(network, motion):.2f} % of it", flush=True)
    print(f"a million steps change the centers' amplitude by {drift(network, network.motions[0]):.1e}", flush=True)
    own = float(np.quantile(np.concatenate(taught), 0.999))
    quantile, longest = switches(library)
    print(f"switches: acceleration p99.9 {quantile / own:.2f} of the motions' {own:.0f} m/s^2, {longest:.2f} s")


if __name__ == "__main__":
    command.run("centralized_playback", main, __doc__)
