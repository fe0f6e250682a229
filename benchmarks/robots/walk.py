"""How far robots walk on their own feet, under pushes.

Plays motions of thesis15 with `--root free --walk`, at several tempos, and pushes the root every 5 s for 0.1 s, in turn
from behind, the right, the front and the left (with seeds other than 0 from any side and at any time). Says how long
the robot stood, how far it and the motion went, how far its joints were from the motion, and what a tick cost.

With --conditions ground, robot or senses differ from what the robot knows of them. With --script a robot plays ten
minutes of boxing, walking, turning and stopping; where it falls it is put on its feet again, and the falls are counted.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from controller.deck.deck import Deck
from controller.jobs import Jobs, spread
from controller.library.motion_library import MotionLibrary, load_library
from controller.mocap.posture import Pose
from controller.rotations import Array
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.physics_model import usual_push
from sim.physics.walk_conditions import AS_MODELLED, CONDITIONS
from sim.physics.walk_trial import Course, Trial, play_course, walk_trial
from sim.robots.robot import DT, Robot, load_robot

MOTIONS = ("walk", "slow-walk", "exa-stride", "waltz", "jog", "box1")
# N s; robots without an entry get their `usual_push`.
PUSHES = {"servo20": 0.36, "mannequin": 16.0}
# In a script: the motion stops where it is.
PAUSE = "pause"
# With --script, again and again; 2 min 45 s, so that each round meets other phases and other pushes.
SCRIPT = (
    "box1 15, walk 25, box2 10, slow-walk 20, pause 5, waltz 20, box3 15, exa-stride 15, pause 5, walk 10, waltz 15,"
    " box1 10"
)


def script(text: str) -> list[tuple[str, float]]:
    """What is played for how long: "walk 5, box1 5"."""
    return [(part.split()[0], float(part.split()[1])) for part in text.split(",")]


def played(robot: Robot, library: MotionLibrary, motion: str, tempo: float, seconds: float) -> Course:
    """What a robot is told to do; `motion` may be a script, which is repeated until the time is over."""
    parts = script(motion) if " " in motion else [(motion, np.inf)]
    deck = Deck(library, robot.retarget, parts[0][0])
    deck.set_tempo(tempo)
    number, until = 0, parts[0][1]

    def play(dt: float) -> tuple[Array, Pose]:
        nonlocal number, until
        if deck.time >= until:
            number += 1
            name, length = parts[number % len(parts)]
            until += length
            deck.set_tempo(0.0 if name == PAUSE else tempo)
            if name != PAUSE:
                deck.switch(name)
        return deck.update(dt)

    return play_course(robot, play, seconds)


def measure(
    robot_name: str, motion: str, tempo: float, share: float, seed: int, seconds: float, condition: str
) -> dict[str, Any]:
    """One run: where the robot falls, it begins anew from there if `motion` is a script."""
    library = load_library(find_library("thesis15"))
    robot = load_robot(find_robot(robot_name), library.skeleton)
    course = played(robot, library, motion, tempo, seconds)
    impulse = share * PUSHES.get(robot_name, usual_push(robot.model))
    trials: list[Trial] = []
    falls: list[float] = []
    begin = 0
    while not trials or (" " in motion and begin < len(course.targets) - 1):
        rest = Course(course.targets[begin:], course.roots[begin:], course.headings[begin:])
        trials.append(walk_trial(robot, rest, impulse, seed, condition=CONDITIONS[condition]))
        begin += round(trials[-1].stood_s / DT)
        if begin < len(course.targets):
            falls.append(round(begin * DT, 1))
    case = {"robot": robot.name, "motion": motion, "tempo": tempo, "push_ns": impulse, "seed": seed}
    sums = {name: sum(getattr(trial, name) for trial in trials) for name in ("asked_m", "walked_m")}
    return case | {"condition": condition} | asdict(trials[0]) | sums | {"falls_s": falls}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks walk", description=__doc__)
    parser.add_argument("--robots", nargs="+", default=list(PUSHES), help="names, or robot files")
    parser.add_argument(
        "--motions", nargs="+", default=list(MOTIONS), help='motions, or scripts such as "walk 5, box1 5"'
    )
    parser.add_argument("--tempos", nargs="+", type=float, default=[0.5, 0.75, 1.0, 1.25, 1.5])
    parser.add_argument(
        "--pushes", nargs="+", type=float, default=[0.0, 1.0], help="in shares of 0.36 or 16 N s, or the usual one"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--seconds", type=float, help="of each run; 60, with --script 600")
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=[AS_MODELLED], metavar="NAME")
    parser.add_argument("--script", action="store_true", help="ten minutes of switches instead of motions")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows")
    given = parser.parse_args()
    cases = [
        (robot, motion, tempo, push, seed, given.seconds or (600.0 if given.script else 60.0), condition)
        for robot in given.robots
        for motion in ([SCRIPT] if given.script else given.motions)
        for tempo in given.tempos
        for condition in given.conditions
        for push in given.pushes
        for seed in (given.seeds if push else [0])
    ]
    print(
        f"{'robot':10} {'motion':22} {'condition':18} {'tempo':>5} {'push N s':>9} {'seed':>4} {'stood s':>8}"
        f" {'asked m':>8} {'walked m':>9} {'upper deg':>10} {'legs deg':>9} {'tick us':>8}  fell at, s"
    )
    rows: list[dict[str, Any]] = []
    for row in spread((delayed(measure)(*case) for case in cases), given.jobs, ordered=True):
        rows.append(row)
        print(
            f"{row['robot']:10} {row['motion']:22.22} {row['condition']:18} {row['tempo']:5.2f} {row['push_ns']:9.2f}"
            f" {row['seed']:4d} {row['stood_s']:8.1f} {row['asked_m']:8.1f} {row['walked_m']:9.1f}"
            f" {row['upper_deg']:10.2f} {row['legs_deg']:9.1f} {row['tick_us']:8.0f}"
            f"  {', '.join(f'{fell:g}' for fell in row['falls_s'])}",
            flush=True,
        )
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
