"""Walk trials: a robot walks a played motion under pushes from all sides."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller.deck.interfaces import PlacedPose
from controller.motion.rotations import Array, Flags
from controller.motion.skeleton import Pose
from sim.models.kinematic_tree import path_to
from sim.models.robot_file import WalkSettings
from sim.physics.physics_model import Alteration, feet_of
from sim.physics.playback import PUSH_LASTS, PhysicsPlayback, push_force
from sim.physics.walking.preview import AHEAD
from sim.physics.walking.state_estimate import Sensors
from sim.robots.robot import DT, Limiter, Robot

PERIOD = 5.0  # s from push to push
SIDES = 4  # one after another: behind, right, front, left
# A servo is at its torque limit above this share of it; a time constant, s; the share of it that strains a joint.
AT_LIMIT, LATELY, STRAINED = 0.98, 1.0, 0.1


@dataclass(frozen=True)
class Course:
    """The commands of a motion, K ticks of DT."""

    targets: Array  # after the safety envelope, shape (K, J), rad
    roots: Array  # position and quaternion of the root, shape (K, 7), m
    headings: Array  # of the motion, shape (K,), rad

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self.targets) * DT


@dataclass(frozen=True)
class Trial:
    """Result of one trial."""

    stood_s: float  # time until the fall, or of the whole course
    asked_m: float  # distance of the motion
    walked_m: float  # distance of the robot
    upper_deg: float  # joint error of the upper body, root mean square over joints and time
    legs_deg: float  # the same of the legs
    tick_us: float  # median time of a tick, simulation included
    strained: str = ""  # the leg's joint that was longest at its torque limit in the last second or so; "" without one


def play_course(robot: Robot, play: Callable[[float], tuple[Array, Pose]], seconds: float, limiter: Limiter) -> Course:
    """Records a motion without simulating it; `play` gives targets and pose of the next dt seconds."""
    limits, limited = robot.limits, limiter(robot.limits, DT)
    qpos = robot.model.qpos0.copy()
    rows: list[tuple[Array, Array, float]] = []
    for _ in range(round(seconds / DT)):
        targets, pose = play(DT)
        targets = np.clip(targets, limits.lower, limits.upper)
        if not rows:
            limited.start(targets)
        safe = limited(targets).copy()
        robot.place(safe, pose, qpos)
        rows.append((safe, qpos[:7].copy(), float(pose.heading)))
    targets, roots, headings = zip(*rows, strict=True)
    return Course(np.array(targets), np.array(roots), np.array(headings))


def pushes(impulse: float, seed: int) -> Callable[[float], Array]:
    """The force (3,), N, on the root over time, s: pushes of an impulse, N s, from one side after another."""
    # The first one comes from behind with seed 0, at a random time from a random side with others.
    random = np.random.default_rng(seed)
    first, late = (random.uniform(0.0, 2.0 * np.pi), random.uniform(0.0, 0.5 * PERIOD)) if seed else (0.0, 0.0)

    def force(now: float) -> Array:
        count, since = divmod(now - late, PERIOD)
        if count < 1.0 or since >= PUSH_LASTS:
            return np.zeros(3)
        return push_force(impulse, first + 2.0 * np.pi * (count - 1.0) / SIDES)

    return force


def walk_trial(
    robot: Robot,
    course: Course,
    force: Callable[[float], Array] | None = None,
    settings: WalkSettings | None = None,
    *,
    sensors: Sensors | None = None,
    alter: Alteration | None = None,
) -> Trial:
    """Walks a course until its end or a fall, under a force (3,), N, on the root over time, s, as `pushes` gives.

    `settings` replace the robot's own walk settings; `sensors` and `alter` are those of `PhysicsPlayback`.
    """
    body = robot if settings is None else replace(robot, walk=settings)
    stage = PhysicsPlayback(body, DT, "free", walk=True, sensors=sensors, alter=alter)
    lag, legs = round(AHEAD / DT), leg_joints(robot)
    costs: list[float] = []
    square, strain, strength = np.zeros(len(robot.joints)), np.zeros(len(robot.joints)), robot.strength
    for tick, (targets, root, heading) in enumerate(zip(course.targets, course.roots, course.headings, strict=True)):
        stage.push(np.zeros(3) if force is None else force(tick * DT))
        began = time.thread_time()
        stage.write(targets, placed_pose(root, float(heading)))
        costs.append(time.thread_time() - began)
        square += np.square(stage.measured() - course.targets[max(tick - lag, 0)])
        strain += DT / LATELY * ((np.abs(stage.data.actuator_force) > AT_LIMIT * strength) - strain)
        if stage.fell_s is not None:
            break
    asked, walked = stage.travel or (0.0, 0.0)
    mean = np.degrees(np.sqrt([square[~legs].mean() / len(costs), square[legs].mean() / len(costs)]))
    stood = course.seconds if stage.fell_s is None else stage.fell_s
    joint = int(np.argmax(strain * legs))
    strained = robot.joints[joint] if strain[joint] > STRAINED and legs[joint] else ""
    return Trial(stood, asked, walked, float(mean[0]), float(mean[1]), 1e6 * float(np.median(costs)), strained)


def placed_pose(root: Array, heading: float) -> PlacedPose:
    """A pose with a known root, position (m) and quaternion, shape (7,)."""
    return PlacedPose(root[:3], np.array(heading), root[None, 3:7], root)


def leg_joints(robot: Robot) -> Flags:
    """Which joint coordinates belong to legs, shape (J,)."""
    model = robot.model
    bodies = {body for foot in feet_of(robot) for body in path_to(model, int(model.body(foot.body).id))}
    return np.isin(model.jnt_bodyid[model.actuator_trnid[:, 0]], [*bodies])
