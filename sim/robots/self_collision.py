"""Self-collision: the depth of overlaps between a robot's bodies, and a guard that keeps its limbs apart.

Only the joints between two bodies move them against each other. If the bodies overlap, the guard holds those joints
where they last did not, and all others go on. Held joints that catch up go no faster than their limit: they cannot pass
through the other limb from tick to tick, as long as a tick's way is less than a limb's thickness.

The guard looks at targets, not at positions, before envelope and servo. A joint that is held cannot stop within one
tick, so the limbs then go somewhat deeper into each other.
"""

from collections import Counter

import mujoco
import numpy as np

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError
from sim.models.kinematic_tree import followers, path_to
from sim.models.overlaps import OVERLAP, near_bodies, overlaps
from sim.models.scenery import FLOOR
from sim.robots.robot import Robot

ROUNDS = 3  # checks of a pose: holding some joints may bring other limbs together


class SelfCollision:
    """Measures overlaps between bodies that do not overlap in the rest pose and are not neighbours."""

    def __init__(self, robot: Robot) -> None:
        spec = robot.spec.copy()
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = int(geom.name != FLOOR)
        try:
            model = spec.compile()
        except ValueError as error:  # a flat mesh that only draws the robot has no hull
            text = " ".join(str(error).split())
            raise MotiondeckError(f"{robot.name}: which of its bodies touch cannot be judged: {text}") from None
        self._near = near_bodies(model, robot.rest_qpos)
        for a, b in self._near:
            if model.body(a).name and model.body(b).name:
                spec.add_exclude(bodyname1=model.body(a).name, bodyname2=model.body(b).name)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def __call__(self, qpos: Array) -> tuple[float, str]:
        """The deepest overlap at qpos (nq,), m, and the two bodies: "r_forearm and head"."""
        touching = self.touching(qpos)
        if not touching:
            return 0.0, ""
        pair, depth = max(touching.items(), key=lambda item: item[1])
        return depth, self.called(*pair)

    def called(self, a: int, b: int) -> str:
        """Two bodies by their names."""
        return f"{self._model.body(a).name} and {self._model.body(b).name}"

    def touching(self, qpos: Array) -> dict[tuple[int, int], float]:
        """The bodies that overlap at qpos (nq,), and by how much, m."""
        self._data.qpos[:] = qpos
        depths = overlaps(self._model, self._data)
        return {pair: depth for pair, depth in depths.items() if pair not in self._near}


class CollisionGuard:
    """Carries poses to joints as the robot does, and keeps its limbs apart; fits `interfaces.Retargeter`."""

    def __init__(self, robot: Robot, dt: float) -> None:
        """A guard for poses dt seconds apart."""
        self._robot, self._collisions, model = robot, SelfCollision(robot), robot.model
        # Which bodies hang from each joint coordinate, or from a joint that follows it.
        self._moved, driven = np.zeros((model.nu, model.nbody), dtype=np.bool_), model.actuator_trnid[:, 0]
        self._moved[np.arange(model.nu), model.jnt_bodyid[driven]] = True
        for follower, (leader, _) in followers(model).items():
            self._moved[driven == leader, model.jnt_bodyid[follower]] = True
        self._qpos = robot.model.qpos0.copy()
        self._step = robot.limits.velocity * dt
        self._good = robot.rest.copy()  # where nothing counts as a collision
        self._begun = False
        self.kept_apart: Counter[str] = Counter()  # number of poses with joints held, by the names of the two bodies

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
            self._robot.layout.place(targets, self._qpos)
            depths = self._collisions.touching(self._qpos)
            overlapping = [pair for pair, depth in depths.items() if depth > OVERLAP]
            if not overlapping:
                break
            for pair in overlapping:
                self.kept_apart[self._collisions.called(*pair)] += 1
                ways = [set(path_to(self._robot.model, body)) for body in pair]
                held |= self._moved[:, sorted(ways[0] ^ ways[1])].any(axis=1)
        else:
            targets = self._good
        self._good = targets
        return targets
