"""A library of a robot's own motions, each played by itself on a free robot.

A library that `learn --physical` wrote, with its folder: each motion is played by deck, envelope and physics from its
start to its end, in simulated time: alone, with --balance, with --walk, and with the feedback that lies beside the
motion. Each row of JSON: fell_s; pose and legs, the root mean square of what joints (those of legs) are off what the
deck plays, degrees; path_m, the mean distance from the path that was found (feedback alone). With --pushes 0.33,0.67
such shares of the usual push, 0.5 s after the beginning and then every second, from any side by the seed.

    python -m benchmarks learned_feet mine.safetensors g1.toml --pushes 0,0.33,0.67 --seeds 3
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks import command
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck.run.robots.walk_choice import able_to_walk
from motiondeck_base.errors import MotiondeckError
from sim.physics.feedback import HOLD, Feedback
from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback, usual_push
from sim.physics.walk_trial import leg_joints
from sim.robots.robot import DT, Robot, load_robot

FIRST_PUSH, PUSHED_EVERY = 0.5, 1.0  # s


def played(
    library: MotionLibrary, motion: str, stage: PhysicsPlayback, robot: Robot, found: Feedback, push: float, seed: int
) -> dict[str, Any]:
    """A row of one run; `found` says for how long, and where the robot was."""
    deck, envelope = Deck(library, robot.twin(), motion), SafetyEnvelope(robot.limits, DT)
    random, legs = np.random.default_rng(seed), leg_joints(robot)
    off, path = list[Any](), list[float]()
    for tick in range(len(found.controls) + round(stage.behind_s / DT)):
        targets, pose = deck.update(DT)
        targets = np.clip(targets, robot.limits.lower, robot.limits.upper)
        if tick == 0:
            envelope.start(targets)
        if push and tick % round(PUSHED_EVERY / DT) == round(FIRST_PUSH / DT):
            stage.push_from("back", push * usual_push(robot.model), random.uniform(-np.pi, np.pi))
        stage.write(envelope(targets).copy(), pose)
        off.append((stage.qpos - stage.wanted)[robot.layout.hinge_qpos])
        if tick % HOLD == 0 and tick // HOLD < len(found.states):
            path.append(float(np.hypot(*(stage.qpos[:2] - found.states[tick // HOLD, :2]))))
        if stage.fell_s is not None:
            break
    degrees = np.degrees(np.array(off))
    sizes = {"pose": degrees, "legs": degrees[:, legs]}
    row = {"seconds": round(len(found.controls) * DT, 2), "fell_s": stage.fell_s}
    return (
        row
        | {name: round(float(np.sqrt(np.square(one).mean())), 1) for name, one in sizes.items()}
        | {"path_m": round(float(np.mean(path)), 3)}
    )


def main(
    file: Annotated[Path, typer.Argument(metavar="LIBRARY", help="A library of `learn --physical`.")],
    robot_file: Annotated[Path, typer.Argument(metavar="ROBOT", help="The robot's file.")],
    motions: Annotated[str, typer.Option(help="By commas; default: all.")] = "",
    modes: Annotated[
        str, typer.Option(help="Of alone, balance, walk, feedback; by commas.")
    ] = "alone,balance,walk,feedback",
    pushes: Annotated[str, typer.Option(help="Shares of the usual push, by commas.")] = "0",
    seeds: Annotated[int, typer.Option(help="Runs with each push.")] = 3,
) -> None:
    """Plays every motion."""
    library = load_library(file)
    robot = load_robot(robot_file, library.skeleton)
    walks: Robot | None = None
    compiled = physics_model(robot, "free")
    stands = dict[tuple[str, float], list[bool]]()
    for info in library.info.motions:
        if motions and info.name not in motions.split(","):
            continue
        found = Feedback.beside(file.parent / info.source, robot)
        if found is None:
            raise MotiondeckError(f"{info.name}: no feedback beside {info.source}. Learn it with --physical.")
        for mode in modes.split(","):
            body, feedback = robot, found if mode == "feedback" else None
            if mode == "walk":
                body = walks = walks or able_to_walk(robot, robot_file)
            for push in map(float, pushes.split(",")):
                for seed in range(seeds if push else 1):
                    balance, walk = mode == "balance", mode == "walk"
                    stage = PhysicsPlayback(body, DT, "free", balance, walk, compiled, feedback=feedback)
                    row = {"motion": info.name, "mode": mode, "push": push, "seed": seed}
                    row |= played(library, info.name, stage, body, found, push, seed)
                    stands.setdefault((mode, push), []).append(row["fell_s"] is None)
                    print(json.dumps(row), flush=True)
    for (mode, push), stood in stands.items():
        print(f"{mode}, push {push:g}: {sum(stood)} of {len(stood)} stand to the end")


if __name__ == "__main__":
    command.run("learned_feet", main, __doc__)
