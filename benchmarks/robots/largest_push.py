"""The largest push from each side under which a walking robot stays up.

A robot walks and is pushed once for 0.1 s, from behind, the right, the front or the left of its heading, at a time that
the seed draws from more than a stride, and is watched for 5 s. The push grows in steps of a quarter of the usual one
until the robot falls; the one before is its largest. Each side has a line: the least and the median over the seeds.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np
from joblib import delayed

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from controller.wire.messages.commands import Side
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.progress import progress
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.playback import PUSH_LASTS, PUSHES_TOWARDS, push_force, usual_push
from sim.physics.walk_trial import play_course, walk_trial
from sim.physics.walking.preview import AHEAD
from sim.robots.robot import DT, load_robot

# The push comes so long after the start, and the robot is watched for so long, s.
FIRST, LAST, WATCHED = 4.0, 5.5, 5.0
# In usual pushes.
STEP, MOST = 0.25, 20.0


def one_push(impulse: float, towards: float, at: float) -> Callable[[float], Array]:
    """The force (3,), N, at a time, s, of a push as `push_force` has it that comes once, at a time, s."""
    force = push_force(impulse, towards)
    return lambda now: force if 0.0 <= now - at < PUSH_LASTS else np.zeros(3)


def last_survived(survives: Callable[[float], bool]) -> float:
    """The last of 0, STEP, 2 STEP and so on before the first that is not survived; MOST if all are."""
    size = 0.0
    while size < MOST and survives(size + STEP):
        size += STEP
    return size


def largest(name: str, motion: str, side: Side, seed: int) -> tuple[str, Side, float, float]:
    """Robot and side again, and the largest push, N s and in usual ones."""
    library = load_library(find_library("thesis15"))
    robot = load_robot(find_robot(name), library.skeleton)
    at = float(np.random.default_rng(seed).uniform(FIRST, LAST))
    course = play_course(robot, Deck(library, robot.retarget, motion).update, at + WATCHED, SafetyEnvelope)
    usual = usual_push(robot.model)
    towards = PUSHES_TOWARDS[side] + float(course.headings[round((at - AHEAD) / DT)])

    def survives(size: float) -> bool:
        trial = walk_trial(robot, course, one_push(size * usual, towards, at))
        return math.isclose(trial.stood_s, course.seconds)

    size = last_survived(survives)
    return name, side, size * usual, size


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks largest_push",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--robots", nargs="+", default=["servo20", "mannequin"], help="names, or robot files")
    parser.add_argument("--motion", default="walk", help="of thesis15")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4, 5])
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    given = parser.parse_args()
    found: dict[tuple[str, Side], list[tuple[float, float]]] = {}
    cases = [(robot, side, seed) for robot in given.robots for side in PUSHES_TOWARDS for seed in given.seeds]
    with progress("pushing", len(cases)) as tick:
        tasks = (delayed(largest)(robot, given.motion, side, seed) for robot, side, seed in cases)
        for robot, side, impulse, size in spread(tasks, given.jobs):
            found.setdefault((robot, side), []).append((impulse, size))
            tick()
    print(f"{'robot':24} {'from':6} {'least N s':>10} {'median N s':>11} {'least':>6} {'median':>7}  usual pushes")
    for robot in given.robots:
        for side in PUSHES_TOWARDS:
            pushes = np.array(found[robot, side])
            (least, small), (middle, medium) = pushes.min(axis=0), np.median(pushes, axis=0)
            print(f"{robot:24.24} {side:6} {least:10.3g} {middle:11.3g} {small:6.3g} {medium:7.3g}")


if __name__ == "__main__":
    main()
