"""How far robots walk on their own feet, under pushes.

Plays the motions of thesis15 and cmu86 that travel on two feet with `--root free --walk`, at several tempos, and pushes
the root every 5 s for 0.1 s, in turn from behind, the right, the front and the left (with seeds other than 0 from any
side and at any time). Says how long the robot stood, how far it and the motion went, how far its joints were from the
motion, and what a tick cost. All seeds of one tempo come after one another, so that a run that is cut has whole rows.

With --conditions ground, robot or senses differ from what the robot knows of them. With --script a robot plays ten
minutes of boxing, walking, turning and stopping; where it falls it is put on its feet again, and the falls are counted.

With --rows FILE each run is added to a file of JSON lines as it ends, and those that are there already are not done
again: the same command goes on after Ctrl-C. Take a new file for new code.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from benchmarks.robots.walk_conditions import AS_MODELLED, CONDITIONS
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.progress import progress
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.playback import usual_push
from sim.physics.walk_trial import Course, Trial, play_course, pushes, walk_trial
from sim.robots.robot import DT, Robot, load_robot

# Of thesis15, or LIBRARY/MOTION.
MOTIONS = ("walk", "slow-walk", "exa-stride", "waltz", "jog", "cmu86/walk", "cmu86/stroll", "cmu86/run")
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
    """The commands of a motion, or of a script, which is repeated for the whole time."""
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

    return play_course(robot, play, seconds, SafetyEnvelope)


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        robot: its name or file.
        motion: of thesis15, or LIBRARY/MOTION, or a script.
        tempo: of the motion.
        condition: of CONDITIONS.
        push: in shares of the robot's push.
        seed: of the pushes.
        seconds: at most.
    """

    robot: str
    motion: str
    tempo: float
    condition: str
    push: float
    seed: int
    seconds: float


def measure(case: Case) -> dict[str, Any]:
    """One run: where the robot falls, it begins anew from there if the motion is a script."""
    *named, motion = case.motion.split("/")
    library = load_library(find_library(named[0] if named else "thesis15"))
    robot = load_robot(find_robot(case.robot), library.skeleton)
    course = played(robot, library, motion, case.tempo, case.seconds)
    impulse = case.push * PUSHES.get(case.robot, usual_push(robot.model))
    condition, trials = CONDITIONS[case.condition], list[Trial]()
    body = condition.applied(robot)
    falls: list[float] = []
    begin = 0
    while not trials or (" " in motion and begin < len(course.targets) - 1):
        rest = Course(course.targets[begin:], course.roots[begin:], course.headings[begin:])
        force = pushes(impulse, case.seed)
        trials.append(walk_trial(body, rest, force, sensors=condition.sensors, alter=condition.alter))
        begin += round(trials[-1].stood_s / DT)
        if begin < len(course.targets):
            falls.append(round(begin * DT, 1))
    sums = {name: sum(getattr(trial, name) for trial in trials) for name in ("asked_m", "walked_m")}
    return asdict(case) | {"push_ns": impulse} | asdict(trials[0]) | sums | {"falls_s": falls}


def done(file: Path | None) -> dict[Case, dict[str, Any]]:
    """The runs that are in a file, none if it is not there yet; without a line that was cut while it was written."""
    rows: dict[Case, dict[str, Any]] = {}
    if file is not None and file.exists():
        for line in file.read_text().splitlines():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                continue
            rows[Case(**{name: row[name] for name in Case.__dataclass_fields__})] = row
    return rows


def run(cases: Sequence[Case], jobs: Jobs, file: Path | None) -> Iterator[dict[str, Any]]:
    """The row of each case, those of the file first; new ones are added to it."""
    rows = done(file)
    yield from (rows[case] for case in cases if case in rows)
    left = [case for case in cases if case not in rows]
    if file is not None and file.exists() and not file.read_text().endswith("\n"):
        file.open("a").write("\n")
    with progress("walking", len(left)) as tick:
        for row in spread((delayed(measure)(case) for case in left), jobs):
            if file is not None:
                with file.open("a") as out:
                    out.write(json.dumps(row) + "\n")
            tick()
            yield row


def summary(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each robot, motion, tempo, condition and push: over its seeds, how many stood and means."""
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        key = tuple(row[name] for name in ("robot", "motion", "tempo", "condition", "push_ns", "seconds"))
        groups.setdefault(key, []).append(row)
    lines: list[str] = []
    for (robot, motion, tempo, condition, push, seconds), group in sorted(groups.items()):
        mean = {name: float(np.mean([row[name] for row in group])) for name in ("upper_deg", "legs_deg", "tick_us")}
        asked = sum(row["asked_m"] for row in group)
        # Sitting and cartwheels go nowhere.
        went = f"{sum(row['walked_m'] for row in group) / asked:.0%}" if asked > 0.5 * len(group) else "-"
        stood = sum(not row["falls_s"] for row in group)
        shortest = min(row["stood_s"] for row in group)
        lines.append(
            f"{robot:10.24} {motion:12.12} {condition:18} {tempo:5.2f} {push:9.2f} {stood:3d} of {len(group):2d}"
            f" {shortest:6.1f} of {seconds:3.0f} s {went:>7} {mean['upper_deg']:10.2f} {mean['legs_deg']:9.1f}"
            f" {mean['tick_us']:8.0f}  {sum(len(row['falls_s']) for row in group)}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks walk", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", nargs="+", default=list(PUSHES), help="names, or robot files")
    parser.add_argument(
        "--motions",
        nargs="+",
        default=list(MOTIONS),
        help='motions of thesis15, LIBRARY/MOTION, or scripts such as "walk 5, box1 5"',
    )
    parser.add_argument("--tempos", nargs="+", type=float, default=[1.0, 0.5, 0.75, 1.25, 1.5])
    parser.add_argument(
        "--pushes", nargs="+", type=float, default=[1.0], help="in shares of 0.36 or 16 N s, or the usual one"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--seconds", type=float, help="of each run; 60, with --script 600")
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    parser.add_argument("--conditions", nargs="+", choices=list(CONDITIONS), default=[AS_MODELLED], metavar="NAME")
    parser.add_argument("--script", action="store_true", help="ten minutes of switches instead of motions")
    parser.add_argument("--rows", type=Path, metavar="FILE", help="add the runs to a file, and leave out those in it")
    given = parser.parse_args()
    cases = [
        Case(robot, motion, tempo, condition, push, seed, given.seconds or (600.0 if given.script else 60.0))
        for tempo in given.tempos
        for robot in given.robots
        for motion in ([SCRIPT] if given.script else given.motions)
        for condition in given.conditions
        for push in given.pushes
        for seed in (given.seeds if push else [0])
    ]
    print(
        f"{'robot':10} {'motion':22} {'condition':18} {'tempo':>5} {'push N s':>9} {'seed':>4} {'stood s':>8}"
        f" {'asked m':>8} {'walked m':>9} {'upper deg':>10} {'legs deg':>9} {'tick us':>8}  fell at, s"
    )
    rows: list[dict[str, Any]] = []
    try:
        for row in run(cases, given.jobs, given.rows):
            rows.append(row)
            print(
                f"{row['robot']:10} {row['motion']:22.22} {row['condition']:18} {row['tempo']:5.2f}"
                f" {row['push_ns']:9.2f} {row['seed']:4d} {row['stood_s']:8.1f} {row['asked_m']:8.1f}"
                f" {row['walked_m']:9.1f} {row['upper_deg']:10.2f} {row['legs_deg']:9.1f} {row['tick_us']:8.0f}"
                f"  {', '.join(f'{fell:g}' for fell in row['falls_s'])}",
                flush=True,
            )
    except KeyboardInterrupt:
        print(f"stopped after {len(rows)} of {len(cases)} runs")
    print(
        f"\n{'robot':10} {'motion':12} {'condition':18} {'tempo':>5} {'push N s':>9} {'stood':>9} {'shortest':>15}"
        f" {'the way':>7} {'upper deg':>10} {'legs deg':>9} {'tick us':>8}  falls"
    )
    print(*summary(rows), sep="\n")


if __name__ == "__main__":
    main()
