"""Preflight checks of how the robot's body points beside the human's, at any tempo."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace

import numpy as np

from controller.motion.clip import Clip
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from sim.physics.played_motions import DT, PlayedMotion, poses_at
from sim.robots.carried_findings import carried_findings
from sim.robots.fidelity import followed
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot
from sim.robots.verdict import Finding


class CarriedChecks:
    """Carries motions of one skeleton onto one robot of known parts, again for each tempo.

    Inverse kinematics keeps to the joints' speeds: what it cannot follow at one tempo it follows at a slower one.
    """

    def __init__(
        self, robot: Robot, parts: Mapping[str, str], root_rotation: tuple[float, ...], skeleton: Skeleton
    ) -> None:
        """Args: as of `LimbDirections` and of the poses; the robot is posed once per sample."""
        self._robot, self._skeleton = robot, skeleton
        self._directions = LimbDirections(robot.model, parts, np.array(root_rotation))

    def findings(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Limbs and trunk at a tempo."""
        shared = {id(self._robot.model): self._robot.model}
        retarget, footing = deepcopy((self._robot.retarget, self._robot.footing), shared)
        robot = replace(self._robot, retarget=retarget, footing=footing)
        if footing is not None:
            footing.reset(DT)
        poses = list(played.poses) if tempo == 1.0 else poses_at(played, tempo, DT)
        roots, turns = (np.array([getattr(p, name) for p in poses]) for name in ("root_position", "rotation"))
        clip = Clip(played.name, self._skeleton, 1.0 / DT, roots, turns)
        joints, qpos = np.empty((len(poses), len(robot.joints))), np.tile(robot.model.qpos0, (len(poses), 1))
        for k, pose in enumerate(poses):
            joints[k] = _inside(robot, retarget(pose))
            robot.place(joints[k], pose, qpos[k])
        return carried_findings(robot, self._directions, followed(clip, robot, joints, qpos), 1.0 / DT)


def _inside(robot: Robot, targets: Array) -> Array:
    return np.clip(targets, robot.limits.lower, robot.limits.upper)
