"""Random schedules of layers and switches: how fast joints become.

Each schedule begins with a motion of the library and gives three to seven commands, 0.05 to 2.5 s apart: a layer of a
group or a joint with any motion, its weight 0.3, 0.7 or 1 and its tempo 0.5 or 1, the end of all layers, or a switch of
the deck. The same schedule is played without its layers. Joints that no layer named must be the same in both bit for
bit. The largest speed and acceleration of any joint are over those of the motions that the schedule has, each played
alone; 1.5 and 2 are the limits of a join.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run
from controller.deck.deck import Deck
from controller.deck.joins.join_limits import FASTEST, HARDEST
from controller.deck.layers import OFF, Layers
from controller.library.motion_library import load_library
from controller.motion.rotations import Array
from motiondeck_base.shipped import find_library, find_robot
from sim.models.robot_file import read_robot_file
from sim.robots.joint_groups import joint_groups
from sim.robots.robot import DT, RobotLoader

ALONE = 6.0  # s of each motion
SWITCH = "switch"


class Schedules:
    """Schedules of one library on one robot."""

    def __init__(self, library: Path, robot: Path) -> None:
        self._library, self._loader = load_library(library), RobotLoader(robot)
        self._motions = self._library.network.motions
        first = self._loader(self._library.skeleton)
        self._groups = joint_groups(first, read_robot_file(robot), self._library.skeleton)
        self._joints = first.joints
        self._own = {name: peaks(play(self._deck(name), ALONE, set())) for name in self._motions}

    def _deck(self, motion: str) -> Deck:
        robot = self._loader(self._library.skeleton)
        deck = Deck(self._library, robot.retarget, motion)
        deck.layers = Layers(self._library, robot.joints, robot.limits, self._groups, robot.twin)
        return deck

    def measured(self, seed: int) -> tuple[Array, Array, bool]:
        """Speed and acceleration with layers and without, over the motions' own, and if other joints are the same."""
        rng = np.random.default_rng(seed)
        first = str(rng.choice(self._motions))
        decks, played = (self._deck(first), self._deck(first)), ([], [])
        seen, named = {first}, set[int]()
        for _ in range(rng.integers(4, 9)):
            group = str(rng.choice([*self._groups, *self._joints[:4], OFF, SWITCH]))
            motion, seconds = str(rng.choice(self._motions)), float(rng.uniform(0.05, 2.5))
            weight, tempo = float(rng.choice([1.0, 0.7, 0.3])), float(rng.choice([1.0, 0.5]))
            if group == SWITCH:
                for deck in decks:
                    deck.switch(motion)
            else:
                decks[0].layer(group, OFF if group == OFF else motion, weight, tempo)
            if group not in (OFF, SWITCH):
                named.update(self._joints.index(one) for one in self._groups.get(group, (group,)))
                seen.add(motion)
            for deck, targets in zip(decks, played, strict=True):
                targets.append(play(deck, seconds, seen))
        layered, plain = (np.concatenate(targets) for targets in played)
        beside = np.setdiff1d(np.arange(len(self._joints)), [*named])
        own = np.max([self._own[name] for name in seen], axis=0)
        return peaks(layered) / own, peaks(plain) / own, np.array_equal(layered[:, beside], plain[:, beside])


def play(deck: Deck, seconds: float, seen: set[str]) -> Array:
    """Joint targets while a deck plays on, shape (ticks, J), rad; what it plays is added to `seen`."""
    targets: list[Array] = []
    for _ in range(max(1, round(seconds / DT))):
        targets.append(deck.update(DT)[0].copy())
        seen.add(deck.playing)
    return np.array(targets)


def peaks(targets: Array) -> Array:
    """The largest speed, rad/s, and acceleration, rad/s^2, of any joint."""
    step = np.diff(targets, axis=0) / DT
    return np.array([np.abs(step).max(), np.abs(np.diff(step, axis=0)).max() / DT])


def main(
    library: Annotated[str, typer.Argument(help="A shipped one, or a file, also a baked one.")],
    robot: Annotated[str, typer.Argument(help="A name or a robot file.")],
    count: Annotated[int, typer.Option(help="How many schedules.")] = 200,
    first: Annotated[int, typer.Option(help="The seed of the first.")] = 0,
) -> None:
    schedules, rows = Schedules(find_library(library), find_robot(robot)), list[tuple[Array, Array, bool]]()
    for seed in range(first, first + count):
        rows.append(schedules.measured(seed))
        layered, plain, _ = rows[-1]
        if (layered > [FASTEST, HARDEST]).any():
            print(f"seed {seed}: {layered.round(2)} with layers, {plain.round(2)} without")
    print("| | speed | acceleration | beyond the limits |\n|---|---|---|---|")
    for way, name in enumerate(("with layers", "without")):
        worst = np.array([row[way] for row in rows])
        beyond = int((worst > [FASTEST, HARDEST]).any(axis=1).sum())
        print(f"| {name} | {worst[:, 0].max():.2f} | {worst[:, 1].max():.2f} | {beyond} of {count} |")
    print(f"other joints are the same bit for bit in {sum(row[2] for row in rows)} of {count}")


if __name__ == "__main__":
    run("layers", main, __doc__)
