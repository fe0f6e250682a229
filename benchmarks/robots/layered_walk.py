"""Falls of robots that walk while a layer moves their arms, or does not.

Each seed begins the walk at another phase, with pushes from its own sides every 5 s, and commands `layer GROUP MOTION`
at its own time within 2 to 6 s. With the motion `live` the group follows 50 live values a second from then on, to and
fro by 0.4 every 2 s. All walks of a seed have all of that in common but the layer. The state is exact, as in `play
--walk`; with --sensors it is estimated with the seed's own noise. A robot without a table [walk] is tried first, as
`play --walk` does it. Printed are falls, and how far the robot goes of what the motion asks for (mean of the seeds that
stand).

python -m benchmarks layered_walk servo20 mannequin g1.toml --layer arms:waltz --layer head:live
"""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import Annotated, Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import typer

from benchmarks.command import run
from controller.deck.deck import Deck
from controller.deck.layers import Layers
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.run.robots.walk_choice import able_to_walk
from motiondeck_base.shipped import find_library, find_robot
from sim.models.robot_file import read_robot_file
from sim.physics.playback import usual_push
from sim.physics.walk_trial import play_course, pushes, walk_trial
from sim.physics.walking.state_estimate import Sensors
from sim.robots.joint_groups import Groups, joint_groups
from sim.robots.robot import DT, Robot, load_robot


@cache
def opened(file: Path) -> tuple[Robot, Groups]:
    """The robot of a file, as it walks, and the groups of its joints."""
    skeleton = load_library(find_library("thesis15")).skeleton
    robot = able_to_walk(load_robot(file, skeleton), file)
    return robot, joint_groups(robot, read_robot_file(file), skeleton)


def walk(
    library: MotionLibrary, file: Path, motion: str, layer: str, seed: int, seconds: float, share: float, *, exact: bool
) -> dict[str, Any]:
    """One walk; the layer is GROUP:MOTION, or "" for none."""
    rng = np.random.default_rng(seed)
    phase, begins = float(rng.uniform()), float(rng.uniform(2.0, 6.0))
    robot, groups = opened(file)
    deck = Deck(library, robot.twin(), motion, phase=phase)
    deck.layers = Layers(library, robot.joints, robot.limits, groups, robot.twin)

    def play(dt: float) -> tuple[Array, Pose]:
        group, _, one = layer.partition(":")
        if one == "live" and deck.time >= begins and deck.time % 0.02 < dt:
            deck.set_input(group, 0.4 * float(np.sin(np.pi * (deck.time - begins))))
        elif one not in ("", "live") and deck.time <= begins < deck.time + dt:
            deck.layer(group, one)
        return deck.update(dt)

    course = play_course(robot, play, seconds, SafetyEnvelope)
    force = pushes(share * usual_push(robot.model), seed + 1)
    trial = walk_trial(robot, course, force, sensors=None if exact else Sensors(seed=seed))
    return {
        "robot": file.stem, "motion": motion, "layer": layer, "seed": seed, "fell": trial.stood_s < seconds - DT,
        "stood_s": trial.stood_s, "went": trial.walked_m / max(trial.asked_m, 1e-9), "upper_deg": trial.upper_deg,
    }  # fmt: skip


def main(
    robots: Annotated[list[str], typer.Argument(help="Names or robot files.")],
    layer: Annotated[list[str], typer.Option("--layer", metavar="GROUP:MOTION", help="Each beside none.")],
    motion: Annotated[str, typer.Option(help="Of thesis15, that is walked.")] = "walk",
    seeds: Annotated[int, typer.Option(help="How many walks of a kind.")] = 20,
    first: Annotated[int, typer.Option(help="The first seed.")] = 0,
    seconds: Annotated[float, typer.Option(help="Of each walk.")] = 20.0,
    push: Annotated[float, typer.Option(help="Of the usual push.")] = 0.5,
    sensors: Annotated[bool, typer.Option("--sensors", help="With noisy sensors.")] = False,
    rows: Annotated[Path | None, typer.Option(help="A file of JSON lines; what is there is not done again.")] = None,
) -> None:
    library, found = load_library(find_library("thesis15")), list[dict[str, Any]]()
    if rows is not None and rows.exists():
        found = [json.loads(line) for line in rows.read_text().splitlines()]
    known = {(row["robot"], row["motion"], row["layer"], row["seed"]): row for row in found}
    print("| robot | layer | falls | of the way | upper body off, degrees |\n|---|---|---|---|---|")
    for name in robots:
        file = find_robot(name)
        for one in ("", *layer):
            some: list[dict[str, Any]] = []
            for seed in range(first, first + seeds):
                row = known.get((file.stem, motion, one, seed))
                if row is None:
                    row = walk(library, file, motion, one, seed, seconds, push, exact=not sensors)
                    if rows is not None:
                        with rows.open("a") as kept:
                            kept.write(json.dumps(row) + "\n")
                some.append(row)
            stood = [row for row in some if not row["fell"]] or some
            way, off = (np.mean([row[column] for row in stood]) for column in ("went", "upper_deg"))
            print(f"| {file.stem} | {one or 'none'} | {len(some) - len(stood) if stood is not some else len(some)} of"
                  f" {len(some)} | {way:.0%} | {off:.1f} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    run("layered_walk", main, __doc__)
