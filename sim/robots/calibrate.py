"""Calibration: a first robot file for any MJCF or URDF, found from the model alone.

The tree is matched to the parts of a body; inverse kinematics of a standing human with hanging arms gives the rest pose
and the root's height. Whether the joints turn the limbs like those of the angle solver, up to sign and zero, is
measured by turning each joint a little, and checked in other poses.

In the rest pose elbows and knees can bend like a human's. Least squares may end in a local minimum: a straight arm with
its elbow at the end of the range may be twisted so that it can never bend. So if limbs cannot bend from the first
solution, others are started anywhere in the joints' ranges, and each limb takes its best one.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import toml_key, toml_value
from motiondeck_base.words import counted
from sim.models.formats.mesh_files import MISSING
from sim.models.formats.model_text import model_kind, urdf_speeds, visual_packages
from sim.models.formats.urdf_visuals import missing_visuals
from sim.models.joint_layout import JointLayout
from sim.models.kinematic_tree import followers
from sim.models.model_file import read_model
from sim.models.robot_file import Angle
from sim.models.surface import LowestPoint
from sim.retargeting.human_limbs import LIMBS, UP
from sim.retargeting.inverse_kinematics import LimbSolver
from sim.retargeting.limb_finder import FEET, SIDES, without_legs
from sim.retargeting.retarget import SERVO_HUMANOID_JOINTS, LimbAngles
from sim.retargeting.robot_limbs import RobotLimbs, limb_directions
from sim.robots.body_matching import match
from sim.robots.limb_directions import SEGMENTS, LimbDirections
from sim.robots.proportions import HUMAN, Doubt, SegmentPair, limb_doubts, segments_of, undriven_limbs, unit_doubts
from sim.robots.robot import joint_ranges

NO_LEGS = "it has no legs: their motion, the human's way, and the lean beyond its waist are left out"
LEAST_HEIGHT = 0.001  # of the root of a robot without legs, m
VELOCITY, ACCELERATION, JERK = 10.0, 300.0, 15000.0  # defaults for what a model does not say: rad/s, rad/s^2, rad/s^3

# Largest error of an angle's slope by its joint, and slope by others; largest error of the angle in other poses, rad.
SLOPE_ERROR, ANGLE_ERROR = 0.1, 0.06
PROBE, SPREAD, POSES = 0.02, 0.3, 24

_HINGE = (int(mujoco.mjtJoint.mjJNT_HINGE),)
_UNPLAYED = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_BALL))
_CLOSING = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
# Of the rest pose: number of tries; error that needs no other try, and improvement that replaces a limb, rad.
TRIES, GOOD, BETTER = 24, 0.1, 0.1
_ROWS = [
    [LIMBS.index(f"{side}_{part}") for part in parts] for side in SIDES for parts in SEGMENTS.values()
]  # of each limb


@dataclass(frozen=True)
class Calibration:
    """The result of a calibration."""

    name: str  # of the model file
    model: Path
    parts: dict[str, str]  # body part to body
    root_rotation: Array  # of the root body that faces x, shape (4,)
    root_height: float  # of the standing root, m
    joints: tuple[str, ...]  # its J joints
    rest: Array  # their positions, standing with hanging arms, shape (J,), rad
    unlimited: tuple[str, ...]  # joints without a range in the model
    speeds: dict[str, float]  # speed limits in the model, rad/s, by joint
    unplayed: tuple[str, ...]  # slides, and ball joints without actuators
    undriven: tuple[str, ...]  # hinges without actuators, if others have them
    open_chains: int  # number of constraints that close a chain of bodies; they hold in physics only
    angles: dict[str, Angle]  # the angle solver's joints, if they fit
    missed: dict[str, float]  # angles of its limbs to those of a standing human, rad, by limb
    packages: dict[str, Path]  # folders of the given packages
    mended: bool  # whether impossible masses or inertias were balanced
    segments: tuple[SegmentPair, ...]  # lengths of its limbs, beside a human's
    doubts: tuple[Doubt, ...]  # implausible findings
    rivals: dict[str, list[tuple[str, ...]]]  # by "leg" and "arm": other hinges that may be knees and elbows

    @property
    def sound(self) -> bool:
        """Whether no limb is missing or implausible."""
        return not any(doubt.fatal for doubt in self.doubts)

    def to_toml(self, folder: Path) -> str:
        """The robot file for a folder; a model below it is named relative to it."""
        model = self.model
        if model.is_relative_to(folder.resolve()):
            model = model.relative_to(folder.resolve())
        turned = ", ".join(f"{component:.6g}" for component in self.root_rotation.round(9) + 0.0)
        lines = [
            f"# {self.name}: written by `motiondeck robot calibrate`. Correct it where `robot check` says so.",
            f"name = {toml_value(self.name)}",
            'kind = "humanoid"',
            f"model = {toml_value(str(model))}",
            *(f"packages.{toml_key(name)} = {toml_value(str(at.resolve()))}" for name, at in self.packages.items()),
            "",
            "# Retargeting: ik (inverse kinematics), or angles if there is a table [angles].",
            'solver = "ik"',
            "",
            "# Height of the standing root above the floor, m: scales the path of the human's root.",
            f"root_height = {self.root_height:g}",
            "# Quaternion (w, x, y, z) of the root body that stands upright and faces x.",
            f"root_rotation = [{turned}]",
            "",
            "# Limits of all joints: rad/s, rad/s^2, rad/s^3. Correct those that the model does not have.",
            "# Limits of one joint: [limits.joints.NAME] velocity = ..., lower = ..., upper = ..., torque = ... (N m)",
            "[limits]",
            f"velocity = {VELOCITY}",
            f"acceleration = {ACCELERATION}",
            f"jerk = {JERK}",
        ]
        if self.unlimited:
            lines += ["", "# lower, upper: without a range in the model, half a turn either way is a guess."]
        for joint in self.joints:
            own = [f"velocity = {self.speeds[joint]!r}"] if joint in self.speeds else []
            own += ["lower = -3.1416", "upper = 3.1416"] if joint in self.unlimited else []
            if own:
                lines += [f"[limits.joints.{toml_key(joint)}]", *own]
        lines += ["", "# Parts of the body, each with the body of the model that moves with it."]
        lines += ["[parts]", *(f"{part} = {toml_value(body)}" for part, body in sorted(self.parts.items()))]
        lines += ["", "# The rest pose, rad; joints not named rest at zero.", "[rest]"]
        rest = zip(self.joints, self.rest.tolist(), strict=True)
        lines += [f"{toml_key(joint)} = {q!r}" for joint, q in rest if abs(q) > 1e-3]
        if self.angles:
            lines += ["", "# The angle solver's angles: joint = zero + sign * angle.", "[angles]"]
        lines += [f"{name} = {toml_value(angle)}" for name, angle in self.angles.items()]
        return "\n".join(lines) + "\n"


def _missing_visuals(path: Path, spec: mujoco.MjSpec, packages: Mapping[str, Path]) -> list[Doubt]:
    """A warning about meshes that only draw the robot and are missing."""
    boxed = [line for text in spec.texts if text.name == MISSING for line in text.data.splitlines()]
    missing = boxed or (missing_visuals(path, packages) if model_kind(path) == "robot" else [])
    if not missing:
        return []
    named = visual_packages(path)
    where = f", or say where the package is with --package {named[0]}=FOLDER" if named else ""
    are = f"{counted(len(missing), 'mesh')} of its looks {'is' if len(missing) == 1 else 'are'} missing"
    drawn = "boxes are in their place" if boxed else "it is drawn by its collision shapes"
    return [Doubt("", f"{are} ({missing[0]}): {drawn}. Copy them there{where}", False)]


def calibrate(path: Path, packages: Mapping[str, Path] | None = None, bends: Collection[str] = ()) -> Calibration:
    """Calibrates the robot in an MJCF or URDF file; FileFormatError if it cannot be used or its legs are not found.

    `packages` are folders of the packages that a URDF names, unless beside or above it; `bends` are hinges that are
    knees or elbows, in place of those that their axes tell.
    """
    spec = read_model(path, packages)
    model = spec.compile()
    layout = JointLayout.of(model)
    found = match(path, model, bends)
    limbs = RobotLimbs(path, model, found.parts, found.root_rotation, layout.joints)
    joint = [model.joint(name).id for name in layout.joints]
    limited = model.jnt_limited[joint].astype(bool)
    (lower, upper), count = joint_ranges(model, layout), len(joint)
    speeds = {name: speed for name, speed in urdf_speeds(path).items() if name in layout.joints}
    velocity = np.array([speeds.get(name, VELOCITY) for name in layout.joints])
    limits = JointLimits(lower, upper, velocity, np.full(count, ACCELERATION), np.full(count, JERK))

    stand = standing_human()
    rest = np.clip(np.round(rest_pose(limbs, limits, stand), 3), lower, upper)
    limbs.place(rest)
    height, upper_body = -LowestPoint(model)(limbs.data), without_legs(found.parts)
    if upper_body:  # its file may have no stand
        height = max(height, float(model.qpos0[2]), LEAST_HEIGHT)
    if not height > 0.0:
        root = found.parts["pelvis"]
        raise FileFormatError(
            f"{path}: body '{root}' would be {height:.3f} m above the floor when the robot stands; the root of a robot "
            "belongs to its pelvis. Move its origin there, or give the pelvis a free joint."
        )
    there = limb_directions(limbs)
    missed = {
        name: float(np.arccos(np.clip(there[k] @ stand[k], -1.0, 1.0)))
        for k, name in enumerate(LIMBS)
        if there[k].any()
    }
    tall = float((limbs.surface.positions(limbs.data)[:, 2] + limbs.surface.radius).max() + height)
    if upper_body:
        tall = max(limbs.reach.values()) / (HUMAN["upper_arm"] + HUMAN["forearm"])
    segments = segments_of(model, found.parts, limbs, tall)
    unsure = _missing_visuals(path, spec, packages or {}) + unit_doubts(model, tall)
    unsure += [Doubt("", words, False) for words in (*found.doubts, *[NO_LEGS] * upper_body)]
    coupled = {model.joint(follower).name for follower in followers(model)}
    hinges, unplayed = (
        [model.joint(j).name for j in np.flatnonzero(np.isin(model.jnt_type, kinds)).tolist()]
        for kinds in (_HINGE, _UNPLAYED)
    )
    undriven = tuple(name for name in hinges if name not in layout.joints and name not in coupled)
    unsure += undriven_limbs(model, found.parts, segments, undriven)
    unsure += limb_doubts(found.parts, segments, LimbDirections(model, found.parts, found.root_rotation))
    return Calibration(
        name=path.stem,
        model=path.resolve(),
        parts=found.parts,
        root_rotation=found.root_rotation,
        root_height=round(height, 4),
        joints=layout.joints,
        rest=rest,
        unlimited=tuple(name for name, has in zip(layout.joints, limited, strict=True) if not has),
        speeds=speeds,
        unplayed=tuple(name for name in unplayed if name not in coupled),
        undriven=undriven,
        open_chains=int(np.isin(model.eq_type[model.eq_active0 != 0], _CLOSING).sum()),
        angles={} if upper_body else fitting_angles(limbs, layout.joints, rest, lower, upper),
        missed=missed,
        packages=dict(packages or {}),
        mended=bool(spec.compiler.balanceinertia),
        segments=tuple(segments),
        doubts=tuple(unsure),
        rivals=found.rivals,
    )


def standing_human() -> Array:
    """The limbs of a standing human with hanging arms, shape (18, 3)."""
    out, bent, knee = 0.12, 0.25, 0.08
    directions: dict[str, tuple[float, ...]] = {f"{part}_ahead": (1, 0, 0) for part in ("head", "chest", "pelvis")}
    directions |= {f"{part}_left": (0, 1, 0) for part in ("head", "chest", "pelvis")}
    for side, left in zip(SIDES, (-1.0, 1.0), strict=True):
        directions |= {
            f"{side}_upper_arm": (0.0, left * np.sin(out), -np.cos(out)),
            f"{side}_forearm": (np.sin(bent), left * np.sin(out) * np.cos(bent), -np.cos(out) * np.cos(bent)),
            f"{side}_thigh": (np.sin(knee), 0.0, -np.cos(knee)),
            f"{side}_shank": (-np.sin(knee), 0.0, -np.cos(knee)),
            f"{side}_foot": (np.cos(FOOT_SLOPE), 0.0, -np.sin(FOOT_SLOPE)),
        }
    return np.array([directions[name.replace("arm_hand", "forearm")] for name in LIMBS])


def fitting_angles(
    limbs: RobotLimbs, joints: tuple[str, ...], rest: Array, lower: Array, upper: Array
) -> dict[str, Angle]:
    """The angle solver's joints of a robot; empty if its legs, or the arms it has, do not fit."""
    free = np.full(len(SERVO_HUMANOID_JOINTS), 4.0 * np.pi)

    def angles_at(q: Array) -> Array:
        limbs.place(q)
        return np.array(LimbAngles(-free, free, 1.0)(limb_directions(limbs), (0.0, 0.0, 1.0)))

    here = angles_at(rest)
    slope = np.empty((len(here), len(rest)))
    for joint, step in enumerate(PROBE * np.eye(len(rest))):
        slope[:, joint] = (angles_at(rest + step) - angles_at(rest - step)) / (2.0 * PROBE)
    # Joints that roll a sole also turn the foot's direction a little.
    found = _ankle_rolls(limbs, joints, rest)
    rolls = [joint for joint, _ in found.values()]
    slope[:, rolls] = 0.0
    for row, name in enumerate(SERVO_HUMANOID_JOINTS):
        if name in found or "ankle_roll" in name:
            continue
        joint = int(np.argmax(np.abs(slope[row])))
        others = np.delete(slope[row], joint)
        if abs(abs(slope[row, joint]) - 1.0) < SLOPE_ERROR and np.abs(others).max() < SLOPE_ERROR:
            found[name] = (joint, int(np.sign(slope[row, joint])))

    random = np.random.default_rng(0)
    for _ in range(POSES):
        q = np.clip(rest + random.uniform(-SPREAD, SPREAD, len(rest)), lower, upper)
        q[rolls] = rest[rolls]
        change = angles_at(q) - here
        for name in [*found]:
            joint, sign = found[name]
            off = change[SERVO_HUMANOID_JOINTS.index(name)] - sign * (q[joint] - rest[joint])
            if "ankle_roll" not in name and abs(off) > ANGLE_ERROR:
                del found[name]
    has = {"r_shoulder": "r_arm", "r_elbow": "r_arm", "l_shoulder": "l_arm", "l_elbow": "l_arm"}
    needed = [
        name
        for name in SERVO_HUMANOID_JOINTS
        if not name.startswith("head")
        and has.get(name.removesuffix("_pitch").removesuffix("_roll"), "r_leg") in limbs.vectors.names
    ]
    if any(name not in found for name in needed):
        return {}
    return {
        name: Angle(joints[joint], 1 if sign > 0 else -1, round(float(rest[joint] - sign * here[row]), 4) + 0.0)
        for row, name in enumerate(SERVO_HUMANOID_JOINTS)
        if name in found
        for joint, sign in [found[name]]
    }


def _ankle_rolls(limbs: RobotLimbs, joints: tuple[str, ...], rest: Array) -> dict[str, tuple[int, int]]:
    """The joints that roll the soles, found by their axes."""
    limbs.place(rest)
    turn = limbs.jacobian(limbs.positions())
    found = {}
    for side in SIDES:
        if f"{side}_foot_up" in limbs.vectors.names:
            sole, leg = (limbs.vectors.names.index(f"{side}_{name}") for name in ("foot_up", "leg"))
            lift = -turn[sole, 1] / limbs.vectors.length[sole]  # of the sole's left edge
            lift[np.abs(turn[leg]).max(axis=0) > 1e-9] = 0.0  # it moves the foot and not the leg
            joint = int(np.argmax(np.abs(lift)))
            if abs(lift[joint]) > 1.0 - SLOPE_ERROR:
                found[f"{side}_ankle_roll"] = (joint, int(np.sign(lift[joint])))
    return found


def rest_pose(limbs: RobotLimbs, limits: JointLimits, stand: Array) -> Array:
    """The joints (N,), rad, that match the limbs (18, 3) of a standing human."""
    poses = stand, _bent(stand)
    rest = np.clip(np.zeros(len(limits.lower)), limits.lower, limits.upper)
    found, missed = _tried(limbs, limits, rest, poses)
    names, moved = limbs.vectors.names, limbs.moved
    own = []  # the joints that move one limb and no other
    for side, (first, _) in product(SIDES, SEGMENTS.values()):
        arm, mine = first == "upper_arm", [name.startswith(f"{side}_{first}") for name in names]
        others = [n != FEET and not (n.startswith(f"{side}_") and ("arm" in n) == arm) for n in names]
        own.append(moved[mine].any(axis=0) & ~moved[others].any(axis=0))
    random, best = np.random.default_rng(0), found
    for _ in range(TRIES):
        if missed.max() < GOOD:
            break
        start = random.uniform(np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi))
        tried, off = _tried(limbs, limits, np.where(np.any(own, axis=0), start, rest), poses)
        for limb, joints in enumerate(own):
            if off[limb] < missed[limb] - BETTER:
                best, missed[limb] = np.where(joints, tried, best), off[limb]
    return found if best is found else _tried(limbs, limits, best, poses)[0]


def _tried(limbs: RobotLimbs, limits: JointLimits, start: Array, poses: tuple[Array, Array]) -> tuple[Array, Array]:
    """The solution (N,) of the first pose from a start; errors of the limbs (4,), rad, in it and in the second pose."""
    answers, off = [start], np.zeros(4)
    for pose in poses:
        answers.append(LimbSolver(limbs, limits, answers[-1], 1.0)(pose, UP))
    for q, pose in zip(answers[1:], poses, strict=True):
        limbs.place(q)
        there = limb_directions(limbs)
        for limb, rows in enumerate(_ROWS):
            angles = np.arccos(np.clip(np.einsum("si,si->s", there[rows], pose[rows]), -1.0, 1.0))
            off[limb] = max(off[limb], float((angles * there[rows].any(axis=1)).max()))
    return answers[1], off


def _bent(stand: Array) -> Array:
    bent = stand.copy()
    for side in SIDES:
        for part, way in (("thigh", (0.6, -0.8)), ("shank", (-0.6, -0.8)), ("forearm", (1.0, 0.0))):
            bent[LIMBS.index(f"{side}_{part}")] = way[0], 0.0, way[1]
    return bent
