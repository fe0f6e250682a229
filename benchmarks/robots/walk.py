"""How far robots walk on their own feet, under pushes.

Plays motions of thesis15 with `--root free --walk`, at several tempos, and pushes the root every 5 s for 0.1 s, in turn
from behind, the right, the front and the left (with seeds other than 0 from any side and at any time). Says how long
the robot stood, how far it and the motion went, how far its joints were from the motion, and what a tick cost.
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
from controller.library.motion_library import load_library
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.walk_trial import play_course, walk_trial
from sim.robots.robot import load_robot

MOTIONS = ("walk", "slow-walk", "exa-stride", "waltz", "jog", "box1")
# N s: 0.3 and 0.04 of a root height times sqrt(g height) times the mass.
PUSHES = {"servo20": 0.36, "mannequin": 16.0}


def script(text: str) -> list[tuple[str, float]]:
    """What is played for how long: "walk 5, box1 5"."""
    return [(part.split()[0], float(part.split()[1])) for part in text.split(",")]


def measure(robot_name: str, motion: str, tempo: float, share: float, seed: int, seconds: float) -> dict[str, Any]:
    """One run; `motion` may be a script such as "walk 5, box1 5", which is repeated until the time is over."""
    library = load_library(find_library("thesis15"))
    robot = load_robot(find_robot(robot_name), library.skeleton)
    parts = script(motion) if " " in motion else [(motion, np.inf)]
    deck = Deck(library, robot.retarget, parts[0][0])
    deck.set_tempo(tempo)
    number, until = 0, parts[0][1]

    def play(dt: float) -> Any:
        nonlocal number, until
        if deck.time >= until:
            number += 1
            name, length = parts[number % len(parts)]
            until += length
            deck.switch(name)
        return deck.update(dt)

    impulse = share * PUSHES[robot_name]
    trial = walk_trial(robot, play_course(robot, play, seconds), impulse, seed)
    return {"robot": robot_name, "motion": motion, "tempo": tempo, "push_ns": impulse, "seed": seed} | asdict(trial)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks walk", description=__doc__)
    parser.add_argument("--robots", nargs="+", default=list(PUSHES))
    parser.add_argument(
        "--motions", nargs="+", default=list(MOTIONS), help='motions, or scripts such as "walk 5, box1 5"'
    )
    parser.add_argument("--tempos", nargs="+", type=float, default=[0.5, 0.75, 1.0, 1.25, 1.5])
    parser.add_argument("--pushes", nargs="+", type=float, default=[0.0, 1.0], help="in shares of 0.36 or 16 N s")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows")
    given = parser.parse_args()
    cases = [
        (robot, motion, tempo, push, seed, given.seconds)
        for robot in given.robots
        for motion in given.motions
        for tempo in given.tempos
        for push in given.pushes
        for seed in (given.seeds if push else [0])
    ]
    print(
        f"{'robot':10} {'motion':22} {'tempo':>5} {'push N s':>9} {'seed':>4} {'stood s':>8} {'asked m':>8}"
        f" {'walked m':>9} {'upper deg':>10} {'legs deg':>9} {'tick us':>8}"
    )
    rows: list[dict[str, Any]] = []
    for row in spread((delayed(measure)(*case) for case in cases), given.jobs, ordered=True):
        rows.append(row)
        print(
            f"{row['robot']:10} {row['motion']:22} {row['tempo']:5.2f} {row['push_ns']:9.2f} {row['seed']:4d}"
            f" {row['stood_s']:8.1f} {row['asked_m']:8.1f} {row['walked_m']:9.1f} {row['upper_deg']:10.2f}"
            f" {row['legs_deg']:9.1f} {row['tick_us']:8.0f}",
            flush=True,
        )
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
