"""A robot: its MuJoCo model, its joints and their limits, and the way poses are carried onto it."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits, PlacedPose, Retargeter
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import listed
from sim.models.formats.urdf_visuals import with_visuals
from sim.models.joint_layout import JointLayout
from sim.models.mannequin.mannequin import build_mannequin
from sim.models.model_file import read_model
from sim.models.rise_settings import RiseSettings, Row
from sim.models.robot_file import RobotFile, Solver, read_robot_file
from sim.models.scenery import add_gantry, add_lamp, set_stage
from sim.models.servo_motor import ServoMotor
from sim.models.upright_pelvis import UprightPelvis
from sim.models.walk_settings import WalkSettings
from sim.retargeting.footing import Footing
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.retarget import MannequinRetargeter, ServoHumanoidRetargeter
from sim.retargeting.robot_limbs import RobotLimbs
from sim.retargeting.symmetric_pose import TUCKED, Bends, symmetric_pose

# How often a robot is posed where nobody says, s.
DT = 0.005
FEET = ("r_foot", "l_foot")
"""The parts that a robot stands on, as a robot file names them."""


@dataclass(frozen=True)
class Rise:
    """How a robot gets up: how long each posture takes, s, and its joints (J,), rad; then it goes to its rest pose.

    Attributes:
        front: from its belly to its feet.
        back: from its back onto its belly.
    """

    front: tuple[tuple[float, Array], ...]
    back: tuple[tuple[float, Array], ...]


@dataclass(frozen=True)
class Robot:
    """One robot, ready to be played on.

    Attributes:
        name: what it is called.
        spec: the model as it can still be changed and saved; save with `spec.to_file(path)`.
        model: the same, compiled.
        layout: where each joint lives in qpos and qvel.
        limits: what each of its J joints may do at most.
        rest: joint positions to start from and return to, shape (J,), rad.
        tucked: those in which it falls with least harm, shape (J,), rad; where it rests, if its motions are no human's.
        retarget: carries poses to joint targets.
        path_scale: its size over that of the skeleton; scales the path of the root.
        servo: what each of its servos can do, where that is known.
        footing: finds its root's place; none for a mannequin, whose root goes where the human's goes.
        walk: how it walks on its own feet.
        rise: how it gets up from the floor; None if it cannot, or its motions are no human's.
    """

    name: str
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: JointLayout
    limits: JointLimits
    rest: Array
    tucked: Array
    retarget: Retargeter
    path_scale: float
    servo: ServoMotor | None = None
    footing: Footing | None = None
    walk: WalkSettings = field(default_factory=WalkSettings)
    rise: Rise | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of its J joint coordinates."""
        return self.layout.joints

    @property
    def drawn(self) -> mujoco.MjModel:
        """The model for pictures and films: with the visual shapes of its URDF, if it is from one."""
        return with_visuals(self.spec)

    def place(self, targets: Array, pose: Pose, qpos: Array) -> None:
        """Writes targets (J,), rad, and the root that fits them and a pose, or goes with it, into qpos (nq,)."""
        self.layout.place(targets, qpos)
        if isinstance(pose, PlacedPose):
            qpos[:7] = pose.robot_root
        elif self.footing is not None:
            self.footing.place(pose, qpos)
        else:
            qpos[:3] = pose.root_position
            qpos[:3] *= self.path_scale
            qpos[3:7] = pose.rotation[0]


def load_robot(path: Path, skeleton: Skeleton, solver: Solver | None = None, dt: float = DT) -> Robot:
    """Loads a robot file and fits the robot to the skeleton whose poses it will play.

    Args:
        path: the robot file.
        skeleton: whose poses will come.
        solver: how they are carried onto a humanoid, in place of what its file says.
        dt: seconds from one pose to the next.

    Raises:
        FileFormatError: if the robot file or its model cannot be used, or the skeleton lacks what the robot needs.
        UnknownNameError: if the file has a part, a body or a joint that does not exist.
    """
    return RobotLoader(path)(skeleton, solver, dt)


class RobotLoader:
    """Fits one robot to one skeleton after another; a humanoid's model is read and compiled once.

    Attributes:
        file: what the robot file says.
    """

    def __init__(self, path: Path) -> None:
        """Reads a robot file; FileFormatError as for `load_robot`."""
        self._path = Path(path)
        self.file = read_robot_file(self._path)
        self._built: tuple[mujoco.MjSpec, mujoco.MjModel] | None = None

    def __call__(self, skeleton: Skeleton, solver: Solver | None = None, dt: float = DT) -> Robot:
        """The robot for one skeleton, as `load_robot` gives it; robots of one loader share their model."""
        if self.file.kind == "mannequin":
            return _mannequin(self._path, self.file, skeleton)
        self._built = self._built or _load_model(self._path, self.file)
        plain = _PlainRobot.of(self._path, self.file, *self._built)
        height, leg = self.file.root_height, skeleton.leg_length
        scale = height / leg if height and leg > 0.0 else 1.0
        if skeleton.is_rig:
            return plain.playing(JointRetargeter(skeleton, plain.layout.joints, plain.rest), scale)
        return _humanoid(plain, skeleton, scale, solver or self.file.solver, dt)


@dataclass(frozen=True)
class _PlainRobot:
    """A robot as its file and its model say, whatever motions it is to play; the attributes are those of `Robot`."""

    path: Path
    file: RobotFile
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: JointLayout
    limits: JointLimits
    rest: Array

    @classmethod
    def of(cls, path: Path, file: RobotFile, spec: mujoco.MjSpec, model: mujoco.MjModel) -> _PlainRobot:
        layout = JointLayout.of(model)
        limits = _limits(path, file, model, layout)
        return cls(path, file, spec, model, layout, limits, _rest(path, file, layout, limits))

    def playing(self, retarget: Retargeter, path_scale: float) -> Robot:
        """The robot that plays what a retargeter makes of poses; it neither protects itself nor gets up."""
        return Robot(
            name=self.file.name,
            spec=self.spec,
            model=self.model,
            layout=self.layout,
            limits=self.limits,
            rest=self.rest,
            tucked=self.rest,
            retarget=retarget,
            path_scale=path_scale,
            servo=self.file.servo,
        )

    def playing_a_human(self, retarget: Retargeter, path_scale: float, skeleton: Skeleton) -> Robot:
        """The robot that plays a human's poses, tucks itself in as it falls, and walks and gets up as its file says."""
        return replace(
            self.playing(retarget, path_scale),
            tucked=bent_joints(retarget, skeleton, self.limits, TUCKED),
            walk=self.file.walk,
            rise=_rise(self.file.rise, retarget, skeleton, self.limits),
        )


def _mannequin(path: Path, file: RobotFile, skeleton: Skeleton) -> Robot:
    """A mannequin, built from the skeleton."""
    if skeleton.is_rig:
        raise FileFormatError(
            f"{path}: these motions were taught on the joints {listed(skeleton.bones)}, which a mannequin "
            "has not. Give the robot that has them with --robot, or play them on the rig alone: "
            "motiondeck rig play."
        )
    spec = build_mannequin(skeleton)
    plain = _PlainRobot.of(path, file, spec, spec.compile())
    return plain.playing_a_human(MannequinRetargeter(skeleton), 1.0, skeleton)


def _humanoid(plain: _PlainRobot, skeleton: Skeleton, scale: float, solver: Solver, dt: float) -> Robot:
    """A humanoid of this size over that of the skeleton, with its feet on the ground."""
    file, model = plain.file, plain.model
    stance = HumanStance(skeleton, dt)
    retarget = _retargeter(plain, skeleton, solver, dt, stance)
    feet = [model.body(file.parts[foot]).id for foot in FEET if foot in file.parts]
    turned, waist = np.array(file.root_rotation), None
    if "pelvis" in file.parts:
        pelvis = UprightPelvis(model, model.body(file.parts["pelvis"]).id, turned)
        if pelvis.below_a_waist:
            waist = pelvis
            scale *= 1.0 + pelvis.above_root / file.root_height if file.root_height else 1.0
    footing = Footing(stance, model, feet, turned, scale, waist)
    return replace(plain.playing_a_human(retarget, scale, skeleton), footing=footing)


def _retargeter(plain: _PlainRobot, skeleton: Skeleton, solver: Solver, dt: float, stance: HumanStance) -> Retargeter:
    path, model, parts, joints, limits = plain.path, plain.model, plain.file.parts, plain.layout.joints, plain.limits
    upright = np.array(plain.file.root_rotation)
    if solver == "angles":
        if parts:
            RobotLimbs(path, model, parts, upright, joints)  # refuses parts that it cannot have
        try:
            return ServoHumanoidRetargeter(
                skeleton, joints, limits.lower, limits.upper, plain.file.angles, plain.rest, stance.flat, dt
            )
        except UnknownNameError as error:
            raise UnknownNameError(f"{path}: {error}") from None
    from sim.retargeting.inverse_kinematics import InverseKinematics

    if not parts:
        raise FileFormatError(f"{path}: solver 'ik' needs a table [parts]: `motiondeck robot calibrate` writes one")
    limbs = RobotLimbs(path, model, parts, upright, joints)
    return InverseKinematics(skeleton, limbs, limits, plain.rest, dt, stance)


def bent_joints(retarget: Retargeter, skeleton: Skeleton, limits: JointLimits, bends: Bends) -> Array:
    """The joints (J,), rad, of a symmetric pose, found by a copy: a retargeter remembers what it was asked."""
    return np.clip(deepcopy(retarget)(symmetric_pose(skeleton, bends)), limits.lower, limits.upper)


def _rise(table: RiseSettings, retarget: Retargeter, skeleton: Skeleton, limits: JointLimits) -> Rise | None:
    if not table.front:
        return None

    def postures(rows: tuple[Row, ...]) -> tuple[tuple[float, Array], ...]:
        return tuple((row[0], bent_joints(retarget, skeleton, limits, Bends(*row[1:]))) for row in rows)

    return Rise(postures(table.front), postures(table.back))


def _load_model(path: Path, file: RobotFile) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    model_path = path.parent / Path(str(file.model)).expanduser()
    if not model_path.exists():
        raise FileFormatError(f"{path}: its model {model_path} is missing; put it there, or correct `model`")
    packages = {name: path.parent / Path(folder).expanduser() for name, folder in file.packages.items()}
    spec = read_model(model_path, packages, [file.parts[foot] for foot in FEET if foot in file.parts])
    root = next(body for body in spec.worldbody.bodies if body.joints)
    height = file.root_height or max(float(root.pos[2]), 0.05)
    root.pos = [0.0, 0.0, height]
    root.quat = list(file.root_rotation)
    try:
        set_stage(spec, height)
        add_lamp(root, height)
        add_gantry(spec, root)
        return spec, spec.compile()
    except ValueError as error:
        raise FileFormatError(f"{model_path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error


def _rest(path: Path, file: RobotFile, layout: JointLayout, limits: JointLimits) -> Array:
    rest = _by_joint(path, layout, "rest", file.rest, np.clip(0.0, limits.lower, limits.upper))
    outside = (rest < limits.lower) | (rest > limits.upper)
    if outside.any():
        joint = int(np.argmax(outside))
        raise FileFormatError(
            f"{path}: rest.{layout.joints[joint]} is {rest[joint]}, "
            f"outside {limits.lower[joint]:.2f} to {limits.upper[joint]:.2f} rad"
        )
    return rest


def _limits(path: Path, file: RobotFile, model: mujoco.MjModel, layout: JointLayout) -> JointLimits:
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


def _positions(model: mujoco.MjModel, layout: JointLayout) -> tuple[Array, Array]:
    """The range of each joint in the model, or half a turn; a ball joint may turn equally far in every direction."""
    joint = model.actuator_trnid[:, 0]
    limited = model.jnt_limited[joint].astype(bool)
    reach = model.jnt_range[joint]
    lower = np.where(limited, reach[:, 0], -np.pi)
    upper = np.where(limited, reach[:, 1], np.pi)
    balls = layout.ball.ravel()
    lower[balls] = -upper[balls]
    return lower, upper


def _by_joint(path: Path, layout: JointLayout, place: str, own: dict[str, float], values: Array) -> Array:
    """Fills in what a table of the robot file says of single joints."""
    for name, value in own.items():
        if name not in layout.joints:
            raise UnknownNameError(f"{path}: {place}: {UnknownNameError.among('joint', name, layout.joints)}")
        values[layout.joints.index(name)] = value
    return values
