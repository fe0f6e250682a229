"""How long motions on the spot stand with a free root, under pushes.

Every 5 seconds the root is pushed for 0.1 s with the robot's `usual_push`, in turn from behind, the right, the front
and the left (`walk_trial.pushes`).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.physics_model import feet_of
from sim.physics.playback import PhysicsPlayback, usual_push
from sim.physics.walk_trial import pushes
from sim.robots.robot import Robot, load_robot

CASES = (
    ("thesis15", "box1", "mannequin"),
    ("thesis15", "box2", "mannequin"),
    ("thesis15", "box3", "mannequin"),
    ("thesis15", "box1", "servo20"),
    ("thesis15", "box2", "servo20"),
    ("thesis15", "box3", "servo20"),
    ("cmu86", "box", "mannequin"),
    ("cmu86", "box", "servo20"),
    ("made up", "wave", "servo20"),
    ("made up", "squat", "mannequin"),
)
TICK = 0.005


@dataclass(frozen=True)
class Row:
    """How one motion stood; times in s, the whole run where it never fell.

    Attributes:
        turned_deg: how far the line between the feet had turned at the end, balanced and pushed, anticlockwise.
    """

    motion: str
    robot: str
    plain_s: float
    balanced_s: float
    turned_deg: float
    push_ns: float
    rms_current_a: float | None


def stand(
    robot: Robot, play: Callable[[float], tuple[Array, Pose]], seconds: float, balance: bool, impulse: float
) -> tuple[float, PhysicsPlayback, list[Array], float]:
    """Plays until the robot falls or time is over; how long it stood, its simulation, pictures, and its turn, rad."""
    stage, force = PhysicsPlayback(robot, TICK, "free", balance), pushes(impulse, seed=0)
    envelope = SafetyEnvelope(robot.limits, TICK)
    targets, pose = play(TICK)
    envelope.start(np.clip(targets, robot.limits.lower, robot.limits.upper))
    pictures: list[Array] = []
    feet = [stage.model.body(foot.body).id for foot in feet_of(robot)]
    lines: list[float] = []
    often = round((0.25 if not balance else 1.0) / TICK)
    for tick in range(round(seconds / TICK)):
        stage.push(force(tick * TICK))
        stage.write(envelope(targets), pose)
        x, y, _ = stage.data.xpos[feet[1]] - stage.data.xpos[feet[0]]
        lines.append(float(np.arctan2(y, x)))
        if tick % often == 0 or stage.fell_s is not None:
            pictures.append(stage.qpos.copy())
        if stage.fell_s is not None:
            break
        targets, pose = play(TICK)
    way = np.unwrap(lines)
    return seconds if stage.fell_s is None else stage.fell_s, stage, pictures, float(way[-1] - way[0])


def player(
    library: str, motion: str, robot_name: str
) -> tuple[Robot, Callable[[], Callable[[float], tuple[Array, Pose]]]]:
    """The robot, and what makes a fresh player of a motion for it."""
    loaded = load_library(find_library("thesis15" if library == "made up" else library))
    robot = load_robot(find_robot(robot_name), loaded.skeleton)
    if library == "made up":
        from benchmarks.robots.made_up_motions import MADE_UP

        return robot, lambda: MADE_UP[motion](loaded.skeleton, robot.retarget)
    return robot, lambda: Deck(loaded, robot.retarget, motion).update


def measure(library: str, motion: str, name: str, seconds: float, push: float) -> tuple[Row, list[Array], list[Array]]:
    """One case, and pictures of it played plainly and with balance."""
    robot, fresh = player(library, motion, name)
    impulse = push * usual_push(robot.model)
    plain, _, lying, _ = stand(robot, fresh(), seconds, False, 0.0)
    balanced, stage, standing, turned = stand(robot, fresh(), seconds, True, impulse)
    servos = stage.report().get("servos")
    current = servos["rms_current_a"] if isinstance(servos, dict) else None
    return (
        Row(f"{library} {motion}", name, plain, balanced, float(np.degrees(turned)), impulse, current),
        lying,
        standing,
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks balance", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--only", default="", help="cases with this in 'LIBRARY MOTION ROBOT'")
    parser.add_argument("--push", type=float, default=1.0, help="how many times the push above")
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    parser.add_argument("--sheet", type=Path, help="pictures of the thesis15 cases, one file a robot")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    cases = [case for case in CASES if given.only in " ".join(case)]
    tasks = (delayed(measure)(*case, given.seconds, given.push) for case in cases)
    found = list(spread(tasks, given.jobs))
    rows = [row for row, _, _ in found]
    if given.sheet:
        draw(cases, found, given.sheet)
    if given.json:
        print(json.dumps([asdict(row) for row in rows]))
        return
    print(f"{'motion':18}{'robot':11}{'plain s':>8}{'balanced s':>12}{'turned deg':>12}{'push N s':>10}{'rms A':>7}")
    for row in rows:
        current = "-" if row.rms_current_a is None else f"{row.rms_current_a:.2f}"
        print(
            f"{row.motion:18}{row.robot:11}{row.plain_s:8.1f}{row.balanced_s:12.1f}{row.turned_deg:12.0f}{row.push_ns:10.2f}{current:>7}",
        )


def draw(cases: list[tuple[str, str, str]], found: Any, path: Path) -> None:
    """A row for what fell and a row for what stood of each thesis15 case; time goes to the right."""
    from motiondeck.pictures.video import contact_sheet

    for name in ("mannequin", "servo20"):
        rows: list[tuple[str, list[Array]]] = []
        for (library, motion, robot), (_, lying, standing) in zip(cases, found, strict=True):
            if library == "thesis15" and robot == name:
                at = np.linspace(0, len(standing) - 1, 8).astype(int)
                rows += [
                    (f"{motion} plain", (lying + lying[-1:] * 8)[:8]),
                    (f"{motion} balanced", [standing[k] for k in at]),
                ]
        if rows:
            robot, _ = player("thesis15", "box1", name)
            contact_sheet([(label, robot.model, poses) for label, poses in rows], path.with_stem(f"{path.stem}-{name}"))


if __name__ == "__main__":
    main()
