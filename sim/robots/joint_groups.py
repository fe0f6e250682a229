"""Groups of a humanoid's joints by name: arms, legs, head and trunk, and each arm and leg."""

from collections.abc import Mapping

import mujoco
import numpy as np

from controller.motion.anatomy import anatomy
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import UnknownNameError
from sim.models.kinematic_tree import joints_above, posed
from sim.models.robot_file import RobotFile
from sim.robots.robot import Robot

Groups = dict[str, tuple[str, ...]]

_OUTERMOST = {"arm": ("hand", "forearm", "upper_arm"), "leg": ("foot", "shank", "thigh")}
_OF_PARTS = {
    "clavicle": "arms", "upper arm": "arms", "forearm": "arms", "hand": "arms", "thigh": "legs", "shank": "legs",
    "foot": "legs", "hip": "legs", "head": "head", "neck": "head", "trunk": "trunk",
}  # fmt: skip


def named_groups(
    where: str, joints: tuple[str, ...], named: Mapping[str, tuple[str, ...]], table: str = "groups."
) -> Groups:
    """The groups that a table of a file names; UnknownNameError if one has a joint that there is not."""
    for group, members in named.items():
        for joint in members:
            UnknownNameError.check("joint", joint, joints, f"{where}: {table}{group}: ")
    return dict(named)


def gaze_gains(robot: Robot, groups: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[float, float]]:
    """How the joints of a robot's head look somewhere: the angle of each per angle to the left and up.

    They turn the head by these angles about z and against y, with the least squares of their own.
    """
    names, data = groups.get("head", ()), posed(robot.model)
    mujoco.mj_comPos(robot.model, data)
    axes = data.cdof[[robot.layout.dof[robot.joints.index(name)] for name in names], :3] if names else np.zeros((0, 3))
    gains = np.linalg.pinv(axes.T, rcond=1e-3) @ [[0.0, 0.0], [0.0, -1.0], [1.0, 0.0]]
    return {name: (float(pan), float(tilt)) for name, (pan, tilt) in zip(names, gains, strict=True)}


def joint_groups(robot: Robot, file: RobotFile, skeleton: Skeleton) -> Groups:
    """The groups of a robot as far as they are found, and those that its file names, which come first."""
    model, found = robot.model, dict[str, set[int]]()
    coordinates = model.actuator_trnid[:, 0].tolist()  # the joint of each coordinate
    if file.kind == "mannequin" and not skeleton.is_rig:
        of_bone = dict(zip(skeleton.bones, anatomy(skeleton).part, strict=True))
        for joint in set(coordinates):
            group = _OF_PARTS.get(of_bone.get(model.body(int(model.jnt_bodyid[joint])).name, "other"), "")
            found.setdefault(group, set()).add(joint)
    elif "pelvis" in file.parts:
        above = {part: {*joints_above(model, model.body(body).id)} for part, body in file.parts.items()}
        root = above["pelvis"]
        chest = above.get("chest", root)
        found["trunk"], found["head"] = chest - root, above.get("head", chest) - chest
        for kind, parts in _OUTERMOST.items():
            for side in ("r", "l"):
                limb = next((above[f"{side}_{part}"] for part in parts if f"{side}_{part}" in above), root)
                found[f"{side}_{kind}"] = limb - (chest if kind == "arm" else root)
            found[f"{kind}s"] = found[f"r_{kind}"] | found[f"l_{kind}"]
    names = np.array(robot.joints)
    groups = {group: tuple(names[np.isin(coordinates, [*joints])].tolist()) for group, joints in found.items()}
    own = named_groups(file.name, robot.joints, file.groups)
    return {group: joints for group, joints in groups.items() if group and joints} | own
