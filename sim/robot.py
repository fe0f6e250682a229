"""A robot: its MuJoCo model, its joints and their limits, and the way poses are carried onto it."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from controller.errors import FileFormatError, UnknownNameError
from controller.mocap.files import listed
from controller.mocap.joint_angles import JointBody, JointRetargeter
from controller.mocap.posture import Pose
from controller.mocap.skeleton import Skeleton
from controller.realtime.interfaces import JointLimits, Retargeter
from controller.rotations import Array
from sim.layout import Layout
from sim.mannequin import build_mannequin
from sim.retarget import MannequinRetargeter, ServoHumanoidRetargeter
from sim.robot_file import RobotFile, read_robot_file
from sim.servo import Servo
from sim.stage import add_gantry, add_lamp, set_stage


@dataclass(frozen=True)
class Robot:
    """One robot, ready to be played on.

    Attributes:
        name: what it is called.
        spec: the model as it can still be changed and saved; save with `spec.to_file(path)`.
        model: the same, compiled.
        layout: where each joint lives in qpos.
        limits: what each of its J joints may do at most.
        rest: joint positions to start from and return to, shape (J,), rad.
        retarget: carries poses to joint targets.
        path_scale: its size over that of the skeleton; scales the path of the root.
        servo: what each of its servos can do, where that is known.
    """

    name: str
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: Layout
    limits: JointLimits
    rest: Array
    retarget: Retargeter
    path_scale: float
    servo: Servo | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of its J joint coordinates."""
        return self.layout.joints

    def place(self, targets: Array, pose: Pose, qpos: Array) -> None:
        """Writes targets (J,), rad, and the scaled root of a pose into qpos (nq,)."""
        qpos[:3] = pose.root_position
        qpos[:3] *= self.path_scale
        qpos[3:7] = pose.rotation[0]
        self.layout.place(targets, qpos)


def load_robot(path: Path, skeleton: Skeleton) -> Robot:
    """Loads a robot file and fits the robot to the skeleton whose poses it will play.

    Raises:
        FileFormatError: if the robot file or its model cannot be used, or the skeleton lacks what the robot needs.
        UnknownNameError: if the file has a key or a joint that does not exist.
    """
    path = Path(path)
    file = read_robot_file(path)
    if file.kind == "mannequin" and isinstance(skeleton, JointBody):
        raise FileFormatError(
            f"{path}: these motions were taught on the joints {listed(skeleton.bones)}, which a mannequin has not. "
            "Give the robot that has them with --robot, or play them on the rig alone: motiondeck rig play."
        )
    spec = build_mannequin(skeleton) if file.kind == "mannequin" else _load_spec(path, file)
    model = spec.compile()
    layout = Layout.of(model)
    limits = _limits(path, file, model, layout)
    rest = _by_joint(path, layout, "rest", file.rest, np.zeros(len(layout.joints)))
    if isinstance(skeleton, JointBody):
        retarget: Retargeter = JointRetargeter(skeleton, layout.joints, rest)
    elif file.kind == "mannequin":
        retarget = MannequinRetargeter(skeleton)
    else:
        retarget = ServoHumanoidRetargeter(skeleton, layout.joints, limits.lower, limits.upper)
    outside = (rest < limits.lower) | (rest > limits.upper)
    if outside.any():
        joint = int(np.argmax(outside))
        raise FileFormatError(
            f"{path}: rest.{layout.joints[joint]} is {rest[joint]}, "
            f"outside {limits.lower[joint]:.2f} to {limits.upper[joint]:.2f} rad"
        )
    scale = file.root_height / skeleton.leg_length if file.root_height and skeleton.leg_length > 0.0 else 1.0
    return Robot(file.name, spec, model, layout, limits, rest, retarget, scale, file.servo)


def _load_spec(path: Path, file: RobotFile) -> mujoco.MjSpec:
    model_path = path.parent / str(file.model)
    if not model_path.is_file():
        raise FileFormatError(f"{path}: model: there is no file {model_path}")
    try:
        spec = mujoco.MjSpec.from_file(str(model_path))
        root = spec.worldbody.first_body()
        if root is None:
            raise FileFormatError(f"{model_path}: there is no body in it")
        height = max(float(root.pos[2]), 0.05)
        set_stage(spec, height)
        add_lamp(root, height)
        add_gantry(spec, root)
        spec.compile()
    except ValueError as error:
        raise FileFormatError(f"{model_path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
    return spec


def _limits(path: Path, file: RobotFile, model: mujoco.MjModel, layout: Layout) -> JointLimits:
    lower, upper = _positions(model, layout)
    count = len(layout.joints)
    table = {"lower": lower, "upper": upper}
    for key in ("velocity", "acceleration", "jerk"):
        table[key] = np.full(count, getattr(file.limits, key))
    for key, values in table.items():
        own = {name: value for name, joint in file.limits.joints.items() if (value := getattr(joint, key)) is not None}
        _by_joint(path, layout, "limits.joints", own, values)
    if np.any(table["lower"] >= table["upper"]):
        joint = layout.joints[int(np.argmax(table["lower"] >= table["upper"]))]
        raise FileFormatError(f"{path}: limits.joints.{joint}: lower must be less than upper")
    return JointLimits(**table)


def _positions(model: mujoco.MjModel, layout: Layout) -> tuple[Array, Array]:
    """The range of each joint in the model; a ball joint may turn equally far in every direction."""
    joint = model.actuator_trnid[:, 0]
    limited = model.jnt_limited[joint].astype(bool)
    reach = model.jnt_range[joint]
    lower = np.where(limited, reach[:, 0], -np.inf)
    upper = np.where(limited, reach[:, 1], np.inf)
    balls = layout.ball.ravel()
    lower[balls] = -upper[balls]
    return lower, upper


def _by_joint(path: Path, layout: Layout, place: str, own: dict[str, float], values: Array) -> Array:
    """Fills in what a table of the robot file says of single joints."""
    for name, value in own.items():
        if name not in layout.joints:
            raise UnknownNameError(f"{path}: {place}: {UnknownNameError.among('joint', name, layout.joints)}")
        values[layout.joints.index(name)] = value
    return values
