"""A style carried to another action, beside the recording of it.

Walk and bow were recorded in an old person's style and in another one. What tells the two walks apart is added to the
other bow and compared with the old bow, and what tells the bows apart to the walk. The error is the mean distance of
joints at the same share of the way, in mm, from the root, walks rolled into step.

    python -m benchmarks style_directions --data DIR
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks import command
from benchmarks.centralized.restyling import in_the_style
from controller.learning.learn import learn
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from controller.networks.reservoirs.phase_driven import PhaseDrivenNetwork

FILES = ("walk_normal_001", "walk_old_001", "bow_happy_001", "bow_old_001")
CASES = (  # what is changed, the style and its opposite, what it should become
    ("bow_happy_001", "walk_old_001", "walk_normal_001", "bow_old_001"),
    ("walk_normal_001", "bow_old_001", "bow_happy_001", "walk_old_001"),
)
STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25)
PLACES = 120  # shares of the way at which bodies are compared


def on_the_way(library: MotionLibrary, motion: str) -> Array:
    """Joints of a motion while it moves, shape (PLACES, F), mm."""
    network = library.network
    assert isinstance(network, PhaseDrivenNetwork)
    joints = joint_features(library.encoding, network.moving(motion))
    at, places = np.linspace(0, len(joints) - 1, PLACES), np.arange(len(joints))
    return np.stack([np.interp(at, places, channel) for channel in joints.T], axis=1)


def error_mm(ours: Array, theirs: Array, *, loop: bool) -> float:
    """The mean distance of joints, mm; of loops in the best step."""
    rolls = range(PLACES) if loop else (0,)
    apart = [(np.roll(ours, by, axis=0) - theirs)[:, :-1].reshape(PLACES, -1, 3) for by in rolls]
    return min(float(np.linalg.norm(one, axis=-1).mean()) for one in apart)


def main(data: Annotated[Path, typer.Option(help="The folder with the recordings.")]) -> None:
    with threadpool_limits(1):
        library = learn([data / f"bvh/bandai/{file}.bvh" for file in FILES], "styles").library
        print("| changed | by | beside |" + "".join(f" {strength:g} |" for strength in STRENGTHS))
        print("|---|---|---|" + "---|" * len(STRENGTHS))
        for motion, like, unlike, wanted in CASES:
            errors = []
            for strength in STRENGTHS:
                styled, _ = in_the_style(library, motion, like, unlike, strength)
                ours, theirs = on_the_way(styled, styled.network.motions[-1]), on_the_way(library, wanted)
                errors.append(error_mm(ours, theirs, loop=motion.startswith("walk")))
            row = "".join(f" {error:.1f} |" for error in errors)
            print(f"| {motion} | {like} - {unlike} | {wanted} |{row}", flush=True)


if __name__ == "__main__":
    command.run("style_directions", main, __doc__)
