"""Accelerations at the seams between the pieces of long motions.

Of each motion of a phase-driven library that has several pieces: how much harder a joint is accelerated in the world
than the recording's is at the same frame, m/s^2, within two frames of a seam and everywhere else.

    python -m benchmarks seams LIBRARY RECIPE --data DIR
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from controller.learning.recipe import read_recipe
from controller.learning.training_set import prepare
from controller.library.motion_library import MotionLibrary, load_library
from controller.motion.rotations import Array
from controller.motion.skeleton import walk_path
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork

NEAR = 2  # frames


def accelerations(library: MotionLibrary, frames: Array) -> Array:
    """Of the joints in the world, shape (T - 2, joints), m/s^2."""
    rate = library.info.rate
    pose = walk_path(library.encoding.decode(frames), 1.0 / rate)
    bent = np.diff(library.skeleton.joints(pose.root_position, pose.rotation), 2, axis=0)
    return np.linalg.norm(bent, axis=-1) * rate**2


def main(
    library_file: Annotated[Path, typer.Argument(metavar="LIBRARY")],
    recipe_file: Annotated[Path, typer.Argument(metavar="RECIPE", help="What it was learned by.")],
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
) -> None:
    library = load_library(library_file)
    network, taught = library.network, prepare(read_recipe(recipe_file), data).frames
    assert isinstance(network, PhaseDrivenNetwork)
    print("| motion | seams | largest of the recording | beyond it: at seams | elsewhere |\n|---|---|---|---|---|")
    for name in network.motions:
        played = network.moving(name)[: len(taught[name])]
        seams = np.flatnonzero(np.diff(network[name].course.piece[: len(played)]))
        if not len(seams):
            continue
        recorded = accelerations(library, taught[name][: len(played)])
        beyond = accelerations(library, played) - recorded
        near = (np.abs(np.arange(len(beyond))[:, None] - seams) <= NEAR).any(1)
        at_seams, elsewhere = beyond[near].max(), beyond[~near].max()
        print(f"| {name} | {len(seams)} | {recorded.max():.0f} | {at_seams:.1f} | {elsewhere:.1f} |", flush=True)


if __name__ == "__main__":
    command.run("seams", main, __doc__)
