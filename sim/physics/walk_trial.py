"""Walk trials: how far a robot gets on its own feet with a played motion, under pushes from all sides."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import PlacedPose
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from sim.models.kinematic_tree import path_to
from sim.models.walk_settings import WalkSettings
from sim.physics.physics_model import feet_of
from sim.physics.playback import PhysicsPlayback
from sim.physics.pushes import PUSH_LASTS, push_force
from sim.physics.walk_conditions import AS_MODELLED, CONDITIONS, Condition
from sim.physics.walking.preview import AHEAD
from sim.robots.robot import DT, Robot
from sim.robots.target_limiter import Limiter

PERIOD = 5.0  # s from one push to the next
# Of a push from behind, the right, the front and the left each comes in turn.
SIDES = 4


@dataclass(frozen=True)
class Course:
    """A motion as a robot is told to move by it, K ticks of DT.

    Attributes:
        targets: after the safety envelope, shape (K, J), rad.
        roots: where the root is put, shape (K, 7), m.
        headings: of the motion, shape (K,), rad.
    """

    targets: Array
    roots: Array
    headings: Array

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self.targets) * DT


@dataclass(frozen=True)
class Trial:
    """How a robot walked.

    Attributes:
        stood_s: when it fell, or the whole length of the course, s.
        asked_m, walked_m: how far the motion went, and the robot.
        upper_deg, legs_deg: how far the joints were from the motion, root mean square over joints and time; legs, and
            all others.
        tick_us: what a tick cost with the simulation, at the median.
    """

    stood_s: float
    asked_m: float
    walked_m: float
    upper_deg: float
    legs_deg: float
    tick_us: float


def play_course(robot: Robot, play: Callable[[float], tuple[Array, Pose]], seconds: float, limiter: Limiter) -> Course:
    """Plays a motion for a robot without simulating it; `play` gives targets and pose of the next dt seconds."""
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
    """The force (3,), N, on the root at a time, s: pushes of an impulse, N s, in turn from four sides.

    The first one comes from behind with seed 0, from any side and at any time with others.
    """
    random = np.random.default_rng(seed)
    first, late = (random.uniform(0.0, 2.0 * np.pi), random.uniform(0.0, 0.5 * PERIOD)) if seed else (0.0, 0.0)

    def force(now: float) -> Array:
        count, since = divmod(now - late, PERIOD)
        if count < 1.0 or since >= PUSH_LASTS:
            return np.zeros(3)
        return push_force(impulse, first + 2.0 * np.pi * (count - 1.0) / SIDES)

    return force


def unpushed(now: float) -> Array:
    """No force at any time."""
    return np.zeros(3)


def walk_trial(
    robot: Robot,
    course: Course,
    force: Callable[[float], Array] = unpushed,
    settings: WalkSettings | None = None,
    condition: Condition = CONDITIONS[AS_MODELLED],
) -> Trial:
    """Walks a course until its end or a fall, under a force (3,) on the root, N, by the time, s.

    Args:
        robot: which.
        course: what it is told.
        force: such as `pushes` gives.
        settings: how it walks, if not as the robot's own say.
        condition: what differs from its model.
    """
    body = condition.applied(robot if settings is None else replace(robot, walk=settings))
    stage = PhysicsPlayback(body, DT, "free", walk=True, sensors=condition.sensors, alter=condition.alter)
    lag, legs = round(AHEAD / DT), _legs(robot)
    costs: list[float] = []
    square = np.zeros(len(robot.joints))
    for tick, (targets, root, heading) in enumerate(zip(course.targets, course.roots, course.headings, strict=True)):
        stage.push(force(tick * DT))
        began = time.thread_time()
        stage.write(targets, placed_pose(root, float(heading)))
        costs.append(time.thread_time() - began)
        square += np.square(stage.measured() - course.targets[max(tick - lag, 0)])
        if stage.fell_s is not None:
            break
    asked, walked = stage.travel or (0.0, 0.0)
    mean = np.degrees(np.sqrt([square[~legs].mean() / len(costs), square[legs].mean() / len(costs)]))
    stood = course.seconds if stage.fell_s is None else stage.fell_s
    return Trial(stood, asked, walked, float(mean[0]), float(mean[1]), 1e6 * float(np.median(costs)))


def placed_pose(root: Array, heading: float) -> PlacedPose:
    """What a robot is given of a pose whose root, position (m) and quaternion, shape (7,), is known."""
    return PlacedPose(root[:3], np.array(heading), root[None, 3:7], root)


def _legs(robot: Robot) -> NDArray[np.bool_]:
    """Which joint coordinates belong to legs, shape (J,)."""
    model = robot.model
    bodies = {body for foot in feet_of(robot) for body in path_to(model, int(model.body(foot.body).id))}
    return np.isin(model.jnt_bodyid[model.actuator_trnid[:, 0]], [*bodies])
