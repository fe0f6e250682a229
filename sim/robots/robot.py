"""A robot: its MuJoCo model, its joints with their limits, and how human poses become joint targets.

A robot is a file, not code (`sim/models/robot_file.py` lists its keys). From it `load_robot` builds, in this order,

    model (MJCF, URDF or mannequin) -> joint layout -> limits and rest pose -> retargeter -> footing

`sim/robots/calibrate.py` writes a first file for any model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import NamedTuple, Protocol

import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits, PlacedPose, Retargeter
from controller.motion.anatomy import Part, anatomy
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.encodings.robot_joints import RobotBody
from controller.motion.rotations import IDENTITY, Array, between
from controller.motion.skeleton import ROOT, Pose, Skeleton
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import listed
from sim.models.formats.urdf_visuals import with_visuals
from sim.models.joint_layout import JointLayout
from sim.models.kinematic_tree import UprightPelvis
from sim.models.mannequin.mannequin import build_mannequin
from sim.models.model_file import read_model, set_joints
from sim.models.robot_file import JointLimit, RobotFile, Row, Solver, WalkSettings, read_robot_file
from sim.models.scenery import add_gantry, add_lamp, set_stage
from sim.models.servo_motor import Motors, ServoMotor, strength
from sim.retargeting.footing import BakedRoot, FixedBase, Footing
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.limb_finder import without_legs
from sim.retargeting.retarget import MannequinRetargeter, ServoHumanoidRetargeter
from sim.retargeting.robot_limbs import RobotLimbs
from sim.retargeting.robot_trunk import STIFF, RobotTrunk, UprightTrunk

DT = 0.005  # default time from pose to pose, s
FEET = ("r_foot", "l_foot")  # the parts that a robot stands on, as a robot file names them


@dataclass(frozen=True)
class Rise:
    """Getting up: postures from the belly to the feet (`front`) and from the back onto the belly (`back`).

    Each has its duration, s, and joints (J,), rad; the rest pose follows.
    """

    front: tuple[tuple[float, Array], ...]
    back: tuple[tuple[float, Array], ...]


@dataclass(frozen=True)
class Robot:
    """One robot, ready to be played on."""

    name: str
    spec: mujoco.MjSpec  # the editable model; save with `spec.to_file(path)`
    model: mujoco.MjModel  # the same, compiled
    layout: JointLayout  # where each joint lives in qpos and qvel
    limits: JointLimits  # of its J joints
    rest: Array  # joint positions to start from and return to, shape (J,), rad
    tucked: Array  # joint positions for a fall, shape (J,), rad; the rest pose for motions taught on joints
    retarget: Retargeter  # carries poses to joint targets
    path_scale: float  # its size over that of the skeleton; scales the path of the root
    servo: ServoMotor | None = None
    footing: Footing | None = None  # places the root; None for a mannequin, whose root follows the human's
    walk: WalkSettings = field(default_factory=WalkSettings)
    rise: Rise | None = None  # postures of getting up; None without them, or for motions taught on joints
    own: Mapping[str, JointLimit] = field(default_factory=dict[str, JointLimit])  # limits of single joints, by name

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of its J joint coordinates."""
        return self.layout.joints

    @property
    def has_legs(self) -> bool:
        """Whether it goes where the human goes; an upper body stays upright in its place."""
        return not isinstance(self.footing, FixedBase)

    def twin(self) -> Retargeter:
        """A copy of its retargeter as it is now; both share the model."""
        return deepcopy(self.retarget, {id(self.model): self.model})

    @property
    def motors(self) -> Motors | None:
        """Its servos, with joints' own torques at stall and own speeds above the servo's; None without data of them."""
        if (servo := self.servo) is None:
            return None
        limits = [self.own.get(self.model.actuator(index).name, JointLimit()) for index in range(self.model.nu)]
        torque = np.array([limit.torque or servo.torque for limit in limits])
        speed = np.array([max(limit.velocity or 0.0, servo.speed) for limit in limits])
        return Motors(servo, torque, speed, strength(self.model))

    @property
    def strength(self) -> Array:
        """The torque limits of its joints, shape (J,), N m; inf without one."""
        motors = self.motors
        return strength(self.model) if motors is None else motors.most

    @property
    def root_height(self) -> float:
        """Height of the root in the model, standing, m."""
        return float(self.model.body(int(self.model.jnt_bodyid[0])).pos[2])

    @property
    def rest_qpos(self) -> Array:
        """The rest pose with the root as in the model, shape (nq,)."""
        qpos = self.model.qpos0.copy()
        self.layout.place(self.rest, qpos)
        return qpos

    @property
    def drawn(self) -> mujoco.MjModel:
        """The model for pictures and films: with the visual shapes of its URDF, if any."""
        return with_visuals(self.spec)[1]

    def place(self, targets: Array, pose: Pose, qpos: Array) -> None:
        """Writes targets (J,), rad, and the root that fits them and the pose into qpos (nq,)."""
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
    """Loads a robot file and fits the robot to a skeleton, for poses dt seconds apart.

    `solver` is that of the retargeting, in place of the file's. FileFormatError if the robot file or its model cannot
    be used, or the skeleton lacks what the robot needs. UnknownNameError if the file has a part, a body or a joint that
    does not exist.
    """
    return RobotLoader(path)(skeleton, solver, dt)


class RobotLoader:
    """Fits one robot to one skeleton after another; a humanoid's model is read and compiled once."""

    def __init__(self, path: Path) -> None:
        """Reads a robot file into `file`; FileFormatError as for `load_robot`."""
        self._path = Path(path)
        self.file = read_robot_file(self._path)
        self._body: _FittedModel | None = None

    def __call__(self, skeleton: Skeleton, solver: Solver | None = None, dt: float = DT) -> Robot:
        """The robot for one skeleton, as of `load_robot`; robots of one loader share their model."""
        path, file = self._path, self.file
        if file.kind == "mannequin":
            if skeleton.is_rig:
                raise FileFormatError(
                    f"{path}: these motions were taught on the joints {listed(skeleton.bones)}, which a mannequin "
                    "has not. Name the rig that has them with --rig, or a robot with --robot."
                )
            spec = build_mannequin(skeleton)
            set_joints(path, spec, file.limits.joints)
            body = _FittedModel.of(path, file, spec, spec.compile())
            return _humanoid(file, body, skeleton, MannequinRetargeter(skeleton), 1.0, None)
        body = self._body = self._body or _FittedModel.of(path, file, *load_model(path, file))
        height, leg = file.root_height, skeleton.leg_length
        scale = height / leg if height and leg > 0.0 else 1.0
        if isinstance(skeleton, RobotBody):
            retarget = JointRetargeter(skeleton, body.layout.joints, body.rest, skeleton.robot_joints)
            return Robot(file.name, *body, body.rest, retarget, 1.0, file.servo, BakedRoot(), own=file.limits.joints)
        if skeleton.is_rig:
            retarget = JointRetargeter(skeleton, body.layout.joints, body.rest)
            return Robot(file.name, *body, body.rest, retarget, scale, file.servo, own=file.limits.joints)
        stance = HumanStance(skeleton, dt)
        retarget, trunk = _retargeter(path, file, body, skeleton, solver or file.solver, dt, stance)
        return _humanoid(file, body, skeleton, retarget, *_footing(file, body.model, stance, scale, trunk))


class _FittedModel(NamedTuple):
    """The part of a robot that no skeleton changes; attributes as of `Robot`."""

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: JointLayout
    limits: JointLimits
    rest: Array

    @classmethod
    def of(cls, path: Path, file: RobotFile, spec: mujoco.MjSpec, model: mujoco.MjModel) -> _FittedModel:
        layout = JointLayout.of(model)
        limits = _limits(file, model, layout)
        return cls(spec, model, layout, limits, _rest(path, file, layout, limits))


def _humanoid(
    file: RobotFile, body: _FittedModel, skeleton: Skeleton, retarget: Retargeter, scale: float, footing: Footing | None
) -> Robot:
    """A robot for human poses, which also tucks itself in as it falls, walks and gets up."""

    def bent(bends: Bends) -> Array:
        # On a copy: a retargeter remembers its last answer.
        return np.clip(deepcopy(retarget)(symmetric_pose(skeleton, bends)), body.limits.lower, body.limits.upper)

    def postures(rows: tuple[Row, ...]) -> tuple[tuple[float, Array], ...]:
        return tuple((row[0], bent(Bends(*row[1:]))) for row in rows)

    rise = Rise(postures(file.rise.front), postures(file.rise.back)) if file.rise.front else None
    settings = file.servo, footing, file.walk, rise, file.limits.joints
    return Robot(file.name, *body, bent(TUCKED), retarget, scale, *settings)


def _footing(
    file: RobotFile, model: mujoco.MjModel, stance: HumanStance, scale: float, trunk: RobotTrunk
) -> tuple[float, Footing]:
    """The size of a robot over the human's, to its pelvis, and what puts its feet on the ground."""
    feet = [model.body(file.parts[foot]).id for foot in FEET if foot in file.parts]
    turned, waist = np.array(file.root_rotation), None
    if without_legs(file.parts):
        return scale, FixedBase(stance, model, turned)
    if "pelvis" in file.parts:
        pelvis = UprightPelvis(model, model.body(file.parts["pelvis"]).id, turned)
        if pelvis.below_a_waist:
            waist = pelvis
            scale *= 1.0 + pelvis.above_root / file.root_height if file.root_height else 1.0
    return scale, Footing(stance, model, feet, turned, scale, waist, trunk)


def _retargeter(
    path: Path, file: RobotFile, body: _FittedModel, skeleton: Skeleton, solver: Solver, dt: float, stance: HumanStance
) -> tuple[Retargeter, RobotTrunk]:
    joints, limits = body.layout.joints, body.limits
    if solver == "ik" and not file.parts:
        raise FileFormatError(f"{path}: solver 'ik' needs a table [parts]: `motiondeck robot calibrate` writes one")
    # Also refuses wrong parts for the angle solver.
    limbs = RobotLimbs(path, body.model, file.parts, np.array(file.root_rotation), joints) if file.parts else None
    if solver == "ik" and limbs is not None:
        from sim.retargeting.inverse_kinematics import InverseKinematics

        kind = UprightTrunk if without_legs(file.parts) else RobotTrunk
        trunk = kind(skeleton, limbs.waist(limits))
        return InverseKinematics(skeleton, limbs, limits, body.rest, dt, stance, trunk), trunk
    try:
        trunk = RobotTrunk(skeleton, limbs.waist(limits, stiff=True) if limbs else STIFF)
        ranges = limits.lower, limits.upper
        retarget = ServoHumanoidRetargeter(skeleton, joints, *ranges, file.angles, body.rest, stance.flat, dt, trunk)
        return retarget, trunk
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: {error}") from None


def load_model(path: Path, file: RobotFile) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The model of a robot file at a path, on a stage; FileFormatError if it is missing or cannot be used."""
    model_path = path.parent / Path(str(file.model)).expanduser()
    if not model_path.exists():
        raise FileFormatError(f"{path}: its model {model_path} is missing; put it there, or correct `model`")
    packages = {name: path.parent / Path(folder).expanduser() for name, folder in file.packages.items()}
    feet = [file.parts[foot] for foot in FEET if foot in file.parts]
    spec = read_model(model_path, packages, feet, file.masses)
    root = next(body for body in spec.worldbody.bodies if body.joints)
    height = file.root_height or max(float(root.pos[2]), 0.05)
    root.pos = [0.0, 0.0, height]
    root.quat = list(file.root_rotation)
    try:
        set_stage(spec, height)
        add_lamp(root, height)
        add_gantry(spec, root)
        set_joints(path, spec, file.limits.joints)
        return spec, spec.compile()
    except ValueError as error:
        raise FileFormatError(f"{model_path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error


def _rest(path: Path, file: RobotFile, layout: JointLayout, limits: JointLimits) -> Array:
    rest = np.clip(0.0, limits.lower, limits.upper)
    for name, angle in file.rest.items():
        UnknownNameError.check("joint", name, layout.joints, f"{path}: rest: ")
        rest[layout.joints.index(name)] = angle
    outside = (rest < limits.lower) | (rest > limits.upper)
    if outside.any():
        joint = int(np.argmax(outside))
        raise FileFormatError(
            f"{path}: rest.{layout.joints[joint]} is {rest[joint]}, "
            f"outside {limits.lower[joint]:.2f} to {limits.upper[joint]:.2f} rad"
        )
    return rest


def _limits(file: RobotFile, model: mujoco.MjModel, layout: JointLayout) -> JointLimits:
    """The limits of a model whose joints are as of `set_joints`."""
    lower, upper = joint_ranges(model, layout)
    table = {key: np.full(len(lower), getattr(file.limits, key)) for key in ("velocity", "acceleration", "jerk")}
    table |= {"lower": lower, "upper": upper}
    if file.servo is not None:
        table["velocity"] = np.minimum(table["velocity"], file.servo.speed)
    for (name, own), (key, values) in product(file.limits.joints.items(), table.items()):
        if (value := getattr(own, key)) is not None:
            values[layout.joints.index(name)] = value
    return JointLimits(**table)


def joint_ranges(model: mujoco.MjModel, layout: JointLayout) -> tuple[Array, Array]:
    """The range of each joint in the model, or half a turn; a ball joint may turn equally far in every direction."""
    joint = model.actuator_trnid[:, 0]
    limited, reach = model.jnt_limited[joint].astype(bool), model.jnt_range[joint]
    lower, upper = np.where(limited, reach.T, [[-np.pi], [np.pi]])
    balls = layout.ball.ravel()
    lower[balls] = -upper[balls]
    return lower, upper


class Bends(NamedTuple):
    """Bends from a straight body with hanging arms, rad: thighs and upper arms forwards, toes towards the shanks."""

    hip: float
    knee: float
    ankle: float
    shoulder: float
    elbow: float


# Hips bent as on a chair, forearms before the face: of the poses tried on servo20 the one with the lowest speeds and
# forces of trunk, head and arms in falls to all sides. With more bent legs the trunk hits the floor harder, with arms
# at the sides the head does.
TUCKED = Bends(hip=1.6, knee=1.2, ankle=0.0, shoulder=0.9, elbow=2.2)


def symmetric_pose(skeleton: Skeleton, bends: Bends) -> Pose:
    """The pose, the same on both sides, with an upright trunk at the height of a standing root, heading along x."""
    shank, forearm = bends.hip - bends.knee, bends.shoulder + bends.elbow
    # Angles forwards from straight down.
    raised: dict[Part, float] = {"upper arm": bends.shoulder, "forearm": forearm, "hand": forearm}
    raised |= {"thigh": bends.hip, "shank": shank, "foot": shank + 0.5 * math.pi + bends.ankle}
    rotation = np.tile(IDENTITY, (1 + len(skeleton), 1))
    for bone, (part, parent) in enumerate(zip(anatomy(skeleton).part, skeleton.parent, strict=True)):
        if part in raised:
            direction = np.array([math.sin(raised[part]), 0.0, -math.cos(raised[part])])
            rotation[1 + bone] = between(skeleton.rest_direction[bone], direction)
        elif parent != ROOT:
            rotation[1 + bone] = rotation[1 + parent]
    return Pose(np.array([0.0, 0.0, skeleton.leg_length]), np.zeros(()), rotation)


class TargetLimiter(Protocol):
    """Turns the targets of J joints, one call a tick, into targets within their limits."""

    @property
    def changed(self) -> Sequence[int]:
        """The number of targets changed since the start, by joint."""
        ...

    def start(self, position: Array) -> None:
        """Begins anew with the joints at rest at `position`, shape (J,), rad."""

    def __call__(self, targets: Array) -> Array:
        """Targets within the limits, shape (J,), rad, for any targets (J,); overwritten by the next call."""
        ...


Limiter = Callable[[JointLimits, float], TargetLimiter]  # makes a target limiter from joint limits and the tick, s
