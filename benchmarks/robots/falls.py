"""How hard robots fall, with and without protecting themselves.

A robot walks and is pushed once, from any side, at any time and so hard that it often falls. Says, of the falls, how
hard and how fast head and trunk hit the floor, how hard the arms do, and what the gears of the joints carry: the mean
of all falls and the worst. Each fall happens twice, with the fall guard of `--walk` and without it.

With --rise guarded robots are watched for longer: how many stand again, and how long after the push.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass, field

import mujoco
import numpy as np
from joblib import delayed

from benchmarks.robots.largest_push import one_push
from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.playback import PUSH_LASTS, PhysicsPlayback, usual_push
from sim.physics.walk_trial import Course, placed_pose, play_course
from sim.robots.robot import DT, Robot, load_robot

# The push comes so long after the start, and the fall is watched for so long, s.
FIRST, LAST, WATCHED = 1.3, 2.4, 2.0
# With --rise, s.
RISES = 20.0
# How hard it is, in usual pushes.
WEAKEST, HARDEST = 5.0, 10.0
# Which bodies they are, by their names; the root's body belongs to the trunk.
PARTS = {"head": "head", "trunk": "back|neck|torso|chest", "arms": "arm|shoulder|elb|wri|han$"}


@dataclass
class Blows:
    """The worst that a fall did to a robot.

    Attributes:
        force: of the floor on head, trunk and arms, N.
        speed: of head and trunk when they first touched the floor, m/s; 0 if they never did.
        gear: the torque that the gears of a joint carried, with that of the rotor that they drive, N m.
        up: when it stood again, s after the push; None if it did not while it was watched.
    """

    force: dict[str, float] = field(default_factory=lambda: dict.fromkeys(PARTS, 0.0))
    speed: dict[str, float] = field(default_factory=dict)
    gear: float = 0.0
    up: float | None = None


class Watched(PhysicsPlayback):
    """A robot of whose falls every step is seen.

    Attributes:
        blows: since the push.
        watching: whether the push is over.
    """

    def __init__(self, robot: Robot, guard: bool) -> None:
        super().__init__(robot, DT, "free", walk=True, guard=guard)
        model = self.model
        names = [model.body(body).name for body in range(model.nbody)]
        self._parts = {
            part: {body for body, name in enumerate(names) if re.search(pattern, name)}
            for part, pattern in PARTS.items()
        }
        self._parts["trunk"].add(int(model.jnt_bodyid[0]))
        self._dof = robot.layout.dof
        self.blows, self.watching = Blows(), False

    def step(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Takes a step and looks at it."""
        before = {part: self._speed(part) for part in ("head", "trunk") if self.watching and self._parts[part]}
        mujoco.mj_step(model, data)
        if not self.watching:
            return
        blows, force = self.blows, self._forces()
        for part, newtons in force.items():
            blows.force[part] = max(blows.force[part], newtons)
            if newtons > 0.0 and part in before:
                blows.speed.setdefault(part, before[part])
        rotor = self.model.dof_armature[self._dof] * self.data.qacc[self._dof]
        blows.gear = max(blows.gear, float(np.abs(self.data.actuator_force - rotor).max()))

    def _forces(self) -> dict[str, float]:
        """How hard the floor pushes each part, N."""
        model, data, force = self.model, self.data, np.empty(6)
        found = dict.fromkeys(self._parts, 0.0)
        for index in range(data.ncon):
            bodies = {int(model.geom_bodyid[geom]) for geom in data.contact[index].geom}
            if 0 not in bodies:
                continue
            mujoco.mj_contactForce(model, data, index, force)
            for part, own in self._parts.items():
                found[part] += float(force[0]) * bool(bodies & own)
        return found

    def _speed(self, part: str) -> float:
        velocity = np.empty(6)
        kind, body = mujoco.mjtObj.mjOBJ_BODY.value, max(self._parts[part])
        mujoco.mj_objectVelocity(self.model, self.data, kind, body, velocity, 0)
        return float(np.linalg.norm(velocity[3:]))


def fall(robot: Robot, course: Course, impulse: float, towards: float, at: float, guard: bool) -> tuple[bool, Blows]:
    """Whether a robot fell that was pushed with an impulse, N s, in a direction, rad, at a time, s; and its blows."""
    stage, force = Watched(robot, guard), one_push(impulse, towards, at)
    for tick, (targets, root, heading) in enumerate(zip(course.targets, course.roots, course.headings, strict=True)):
        since = tick * DT - at
        stage.push(force(tick * DT))
        stage.watching = PUSH_LASTS <= since < WATCHED
        stage.write(targets, placed_pose(root, float(heading)))
        if stage.fallen:
            stage.blows.up = None
        elif stage.fell_s is not None and stage.blows.up is None:
            stage.blows.up = since
    return stage.fell_s is not None, stage.blows


def measure(name: str, motion: str, seed: int, seconds: float) -> tuple[bool, list[Blows]]:
    """One push of a seed: whether the robot fell without the guard; its blows without and with it over some seconds."""
    library = load_library(find_library("thesis15"))
    robot = load_robot(find_robot(name), library.skeleton)
    random = np.random.default_rng(seed)
    impulse = usual_push(robot.model) * random.uniform(WEAKEST, HARDEST)
    towards, at = random.uniform(0.0, 2.0 * np.pi), random.uniform(FIRST, LAST)
    course = play_course(robot, Deck(library, robot.retarget, motion).update, at + seconds, SafetyEnvelope)
    short = round((at + WATCHED) / DT)
    brief = Course(course.targets[:short], course.roots[:short], course.headings[:short])
    fell, plain = fall(robot, brief, impulse, towards, at, guard=False)
    return fell, [plain, fall(robot, course, impulse, towards, at, guard=True)[1]] if fell else [plain]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks falls", description=__doc__)
    parser.add_argument("--robots", nargs="+", default=["servo20", "mannequin"], help="names, or robot files")
    parser.add_argument("--motion", default="walk", help="of thesis15")
    parser.add_argument("--seeds", nargs=2, type=int, default=[100, 130], metavar=("FIRST", "END"))
    parser.add_argument("--rise", action="store_true", help="also watch how they get up")
    parser.add_argument("--jobs", type=Jobs.parse, default=Jobs(), help="processes, or dask://HOST:PORT")
    given = parser.parse_args()
    columns = ("head N", "trunk N", "arms N", "head m/s", "trunk m/s", "gear N m")
    print(f"{'robot':10} {'falls':>7} {'guard':>6}" + "".join(f"{column:>16}" for column in columns))
    for name in given.robots:
        tasks = [
            delayed(measure)(name, given.motion, seed, RISES if given.rise else WATCHED) for seed in range(*given.seeds)
        ]
        falls = [blows for fell, blows in spread(tasks, given.jobs) if fell]
        for number, guard in enumerate(("no", "yes")):
            rows = np.array([_row(blows[number]) for blows in falls]).reshape(-1, len(columns))
            cells = (
                f"{mean:8.2f} {worst:7.2f}" for mean, worst in zip(rows.mean(axis=0), rows.max(axis=0), strict=True)
            )
            print(f"{name:10} {len(falls):3d}/{len(tasks):3d} {guard:>6}" + "".join(cells), flush=True)
        if given.rise:
            up = [blows[1].up for blows in falls if blows[1].up is not None]
            print(
                f"{name:10} {len(up)} of {len(falls)} stand again, {np.round(sorted(up), 1).tolist()} s after the push"
            )


def _row(blows: Blows) -> Array:
    return np.array([*blows.force.values(), *(blows.speed.get(part, 0.0) for part in ("head", "trunk")), blows.gear])


if __name__ == "__main__":
    main()
