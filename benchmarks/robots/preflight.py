"""Whether preflight's verdicts come true in simulated physics.

Every motion on every robot at several tempos. "follows": no joint is held back or lags, against: no joint is off its
target in a simulation with servos. "stands": never off balance for long, against: does not fall in ten seconds with a
free root. A table of each: said yes and came true, said yes and did not, and so on.
"""

from __future__ import annotations

import argparse
import json
import sys

from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck.run.sampled_motions import play_motions
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.loads import loads_of
from sim.physics.physics_model import feet_of
from sim.physics.played_motions import DT
from sim.physics.preflight.preflight import Preflight
from sim.robots.robot import load_robot
from sim.robots.self_collision import SelfCollision

ROBOTS = ("servo20", "mannequin")
TEMPOS = (0.25, 0.5, 1.0)
FOLLOWS = ("out of reach", "held back", "torque", "servo lag")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks preflight", description=__doc__)
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    library = load_library(find_library(given.library))
    rows = []
    for name in ROBOTS:
        robot = load_robot(find_robot(name), library.skeleton, dt=DT)
        free = Preflight(robot, robot.limits, SafetyEnvelope, "free")
        collisions, feet = SelfCollision(robot), feet_of(robot)
        for played in play_motions(library, robot):
            hanging = loads_of(free.robot, played, free=False, collisions=collisions, feet=feet)
            for tempo in TEMPOS:
                gantry = Preflight(robot, robot.limits, SafetyEnvelope, "gantry")
                said = {f.check: f.ok for f in gantry.static.findings(played, hanging, tempo)}
                said |= {f.check: f.ok for f in free.static.standing(hanging, tempo)}
                done = {f.check: f.ok for f in free.simulated(played, tempo)}
                rows.append(
                    {
                        "motion": played.name,
                        "robot": name,
                        "tempo": tempo,
                        "follows": (all(said.get(check, True) for check in FOLLOWS), done["off target"]),
                        "stands": (said["off balance"], done["falls"]),
                    }
                )
            print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if given.json:
        print(json.dumps(rows))
        return
    for question in ("follows", "stands"):
        heads = "".join(f"{words:>14}" for words in ("yes, was", "yes, was not", "no, was not", "no, was", "agree"))
        print(f"{question:10}{'robot':12}{heads}")
        for name in ROBOTS:
            pairs = [row[question] for row in rows if row["robot"] == name]
            counts = [pairs.count(pair) for pair in ((True, True), (True, False), (False, False), (False, True))]
            agree = (counts[0] + counts[2]) / len(pairs)
            print(f"{'':10}{name:12}{''.join(f'{count:14}' for count in counts)}{agree:14.0%}")
        for row in rows:
            if row[question][0] != row[question][1]:
                said, was = ("yes" if answer else "no" for answer in row[question])
                print(f"    {row['robot']} {row['motion']} at {row['tempo']:g}: said {said}, was {was}")


if __name__ == "__main__":
    main()
