"""How deep limbs meet with and without the guard, and what it costs.

Depths are those of the target poses, mm: without the guard, with it, and of what the safety envelope, which comes after
it, makes of these. `beyond` is the share of ticks deeper than the guard lets pass, without it, and `after` the same
after the envelope. The cost of a tick is CPU time, the guard's without that of the retargeting.
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
import time

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.deck import Deck  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.safety.safety_envelope import SafetyEnvelope  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library, find_robot  # noqa: E402
from sim.models.overlaps import OVERLAP  # noqa: E402
from sim.robots.robot import Robot, load_robot  # noqa: E402
from sim.robots.self_collision import CollisionGuard, SelfCollision  # noqa: E402

DT = 0.005


def measured(library: MotionLibrary, robot: Robot, motion: str, ticks: int) -> tuple[Array, Array, str]:
    """Depths without and with the guard and after the envelope, shape (ticks, 3), m; costs without and with the guard,
    (ticks, 2), s; whom it held."""
    alone = copy.deepcopy(robot.retarget)  # one that remembers the last pose must not be given each pose twice
    guard, envelope, collisions = CollisionGuard(robot, DT), SafetyEnvelope(robot.limits, DT), SelfCollision(robot)
    poses = Deck(library, lambda pose: np.zeros(0), motion)
    qpos = robot.model.qpos0.copy()
    depths, costs = np.zeros((ticks, 3)), np.zeros((ticks, 2))
    for tick in range(ticks):
        _, pose = poses.update(DT)
        asked = []
        for way, retarget in enumerate((alone, guard)):
            began = time.thread_time()
            asked.append(retarget(pose))
            costs[tick, way] = time.thread_time() - began
        if tick == 0:
            envelope.start(asked[1])  # where the approach to the first pose ends
        for way, targets in enumerate((*asked, envelope(asked[1]))):
            robot.layout.place(np.clip(targets, robot.limits.lower, robot.limits.upper), qpos)
            depths[tick, way] = collisions(qpos)[0]
    return depths, costs, ", ".join(f"{pair} {count}" for pair, count in guard.kept_apart.most_common(2))


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks collisions",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--robots", nargs="+", default=["servo20", "mannequin"])
    parser.add_argument("--motions", nargs="+", default=["walk", "waltz", "cartwheel", "box1"])
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    print(
        f"{'robot':<12}{'motion':<14}{'deepest':>9}{'guarded':>9}{'enveloped':>11}{'beyond':>8}{'after':>8}"
        f"{'us a tick':>11}  kept apart, ticks"
    )
    for name in options.robots:
        robot = load_robot(find_robot(name), library.skeleton)
        for motion in options.motions:
            depths, costs, held = measured(library, robot, motion, round(options.seconds / DT))
            deep, guarded, enveloped = 1e3 * depths.max(axis=0)
            beyond, _, after = (depths > OVERLAP).mean(axis=0)
            cost = 1e6 * np.diff(np.median(costs, axis=0))[0]
            print(
                f"{name:<12}{motion:<14}{deep:9.1f}{guarded:9.1f}{enveloped:11.1f}{beyond:8.0%}{after:8.1%}"
                f"{cost:11.0f}  {held}"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
