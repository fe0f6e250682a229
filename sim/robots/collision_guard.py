"""The collision guard: targets of a robot in which none of its limbs runs into another.

Where two bodies lie to each other is the affair of the joints between them alone. So if they overlap, those joints are
held where they were when they last did not, and all others go on. What is held, or has to catch up afterwards, goes no
faster than its limit: then it cannot pass through the other limb from one tick to the next, while a tick's way at the
velocity limit is less than a limb is thick.

It looks at what is asked of the joints, not at where they are: what the envelope or a servo makes of it comes after. A
joint held from one tick to the next cannot stop in one, so the limbs then go somewhat deeper into each other.
"""

from __future__ import annotations

from collections import Counter

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.posture import Pose
from controller.motion.rotations import Array
from sim.models.coupled_joints import followers
from sim.models.overlaps import OVERLAP
from sim.robots.robot import Robot
from sim.robots.self_collision import SelfCollision

# So often a pose is looked at again after joints were held: holding some may bring others together.
ROUNDS = 3


class CollisionGuard:
    """Carries poses to joints as the robot does, and keeps its limbs apart; fits `interfaces.Retargeter`.

    Attributes:
        kept_apart: for how many poses the joints between two bodies were held, by their names.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """A guard for poses dt seconds apart."""
        self._robot = robot
        self._collisions = SelfCollision(robot)
        self._joints_of = _moved_bodies(robot)
        self._between: dict[tuple[int, int], NDArray[np.bool_]] = {}
        self._qpos = robot.model.qpos0.copy()
        self._step = robot.limits.velocity * dt
        self._good = robot.rest.copy()  # where nothing counts as a collision
        self._begun = False
        self.kept_apart: Counter[str] = Counter()

    def __call__(self, pose: Pose) -> Array:
        """Joint targets (J,), rad, in which no two limbs overlap by more than OVERLAP; copy what you keep."""
        limits = self._robot.limits
        asked = np.clip(self._robot.retarget(pose), limits.lower, limits.upper)
        asked = np.where(np.isfinite(asked), asked, self._good)
        if self._begun:
            asked = self._good + np.clip(asked - self._good, -self._step, self._step)
        self._begun = True
        held = np.zeros(len(asked), dtype=np.bool_)
        for _ in range(ROUNDS):
            targets = np.where(held, self._good, asked)
            overlapping = self._overlapping(targets)
            if not overlapping:
                break
            for pair in overlapping:
                self.kept_apart[self._collisions.called(*pair)] += 1
                held |= self._joints_between(*pair)
        else:
            targets = self._good
        self._good = targets
        return targets

    def _overlapping(self, targets: Array) -> list[tuple[int, int]]:
        self._robot.layout.place(targets, self._qpos)
        return [pair for pair, depth in self._collisions.touching(self._qpos).items() if depth > OVERLAP]

    def _joints_between(self, a: int, b: int) -> NDArray[np.bool_]:
        """Which joint coordinates decide where two bodies lie to each other, shape (J,)."""
        if (a, b) not in self._between:
            ways = [_way_to_world(self._robot.model, body) for body in (a, b)]
            moved = self._joints_of[:, sorted(ways[0] ^ ways[1])]
            self._between[a, b] = np.asarray(moved.any(axis=1), dtype=np.bool_)
        return self._between[a, b]


def _way_to_world(model: mujoco.MjModel, body: int) -> set[int]:
    """A body and all that it hangs from."""
    way = set()
    while body:
        way.add(body)
        body = int(model.body_parentid[body])
    return way


def _moved_bodies(robot: Robot) -> NDArray[np.bool_]:
    """Which bodies hang from each joint coordinate, or from a joint that follows it, shape (J, bodies)."""
    model = robot.model
    moved = np.zeros((model.nu, model.nbody), dtype=np.bool_)
    driven = model.actuator_trnid[:, 0]
    moved[np.arange(model.nu), model.jnt_bodyid[driven]] = True
    for follower, (leader, _) in followers(model).items():
        moved[driven == leader, model.jnt_bodyid[follower]] = True
    return moved
