"""Model files: any robot's MJCF or URDF, made ready for playing.

The result has a free root, one position servo for each played joint, named as the joint, and no floor, sky or lamps.

The servo of a joint without one in its model is stiff enough to carry the limb in any posture. A straight arm has
almost no inertia about its axis; bent, the same hinge carries the forearm. So the stiffness follows from the limb's
largest moment of inertia:

    kp = max(I w^2, M g / SAG),    kv = 2 sqrt(kp I)

with I about the joint's anchor plus that of the rotor, w the bandwidth, and M the limb's mass times the distance of its
centre. A standing leg turns the rest of the body about the foot: its stiffness is at least STANCE times the weight
times the length of the leg, with damping and rotor to match.
"""

import re
from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path

import mujoco
import numpy as np

from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.ball_joints import hinges_for_balls, unplayed_balls, unused
from sim.models.formats.mesh_files import compiled, find_meshes, read_solids
from sim.models.formats.model_text import has_collision_shapes, model_kind, readable_urdf
from sim.models.formats.urdf_visuals import note_source
from sim.models.free_root import free_root
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import below, followers, path_to, posed
from sim.models.robot_file import JointLimit
from sim.models.surface import Surface

LAST_SHOWN_GROUP = 2

LEAST_MASS, LEAST_INERTIA = 1e-4, 1e-7  # of a body, kg and kg m^2

# Number of sizes of a solid.
_SIZES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: 1,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 2,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 2,
    mujoco.mjtGeom.mjGEOM_BOX: 3,
}
# MuJoCo's message about a missing mesh, texture or part of a model.
_UNOPENED = re.compile(r"[Ee]rror opening file '([^']+)'")
_AT_A_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_AT_A_DISTANCE = (int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtTrn.mjTRN_SLIDERCRANK))
BANDWIDTH = 30.0  # rad/s
SAG = 0.02  # largest sag of a limb held out level, rad
SWINGS = 200.0  # natural frequency of a servo without its limb, by the rotor's inertia, rad/s
# The same for a standing leg: with a lighter rotor the foot bounces on the floor. Chosen on a walking G1.
STANCE, STANCE_BANDWIDTH, STANCE_SWINGS = 4.0, 60.0, 100.0


def read_model(
    path: Path,
    packages: Mapping[str, Path] | None = None,
    feet: Sequence[str] = (),
    masses: Mapping[str, float] | None = None,
) -> mujoco.MjSpec:
    """The robot in an MJCF or URDF file, without scenery, its root free and its joints driven by position servos.

    Played are the hinges with actuators, also by tendons, or all in a file without actuators, except joints that an
    equality constraint couples to others. Impossible masses and inertias are balanced, and
    `spec.compiler.balanceinertia` is set.

    `packages` are folders of the packages that a URDF names; others are searched beside and above the file. `feet` are
    known bodies that it stands on: missing servos then carry its weight. `masses` of bodies, kg, replace the file's;
    UnknownNameError for another body. FileFormatError if MuJoCo refuses the file, it
    has no body or no solid, or its base turns on a joint.
    """
    is_urdf = model_kind(path) == "robot"
    try:
        spec = _read_urdf(path, packages or {}) if is_urdf else mujoco.MjSpec.from_file(str(path.resolve()))
        find_meshes(spec, path.resolve().parent / spec.meshdir)
        _clear_stage(spec)
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False  # a URDF's spec would drop the floor of the stage, too
        # The model may be saved elsewhere; its meshes stay where they are.
        folder = path.resolve().parent
        spec.meshdir, spec.texturedir = str(folder / spec.meshdir), str(folder / spec.texturedir)
        read_solids(spec, Path(spec.meshdir))
        hinges_for_balls(spec)
        _scale_masses(spec)
        _mend_inertias(spec)
        for joint in spec.joints:
            if not np.isfinite(joint.range).all():  # as some files have it for continuous joints
                joint.range, joint.limited = (0.0, 0.0), mujoco.mjtLimited.mjLIMITED_FALSE
        free_root(path, spec)
        _name_all(spec)
        _set_masses(path, spec, masses or {})
        model = compiled(spec)
        if not len(Surface.of(model).body):
            raise FileFormatError(
                f"{path}: no body of it has a solid that tells how far it reaches; give its feet and limbs geoms "
                "(in a URDF <collision> shapes: MuJoCo leaves <visual> ones out)"
            )
        _servos(path, spec, model, feet)
        if model.ngeom and np.all(model.geom_group > LAST_SHOWN_GROUP):
            # Only collision solids are left: show these.
            for geom in spec.geoms:
                geom.group = 0
        spec.compile()
    except ValueError as error:
        missing = _UNOPENED.search(str(error))
        if missing and not Path(missing[1]).exists():
            raise FileFormatError(
                f"{path}: {missing[1]}, which it needs, is missing; copy it there with the other files of the model"
            ) from error
        raise FileFormatError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
    return spec


def _read_urdf(path: Path, packages: Mapping[str, Path]) -> mujoco.MjSpec:
    """A URDF; without <collision> shapes its <visual> ones collide."""
    text = readable_urdf(path, packages)
    spec = mujoco.MjSpec.from_string(text)
    note_source(spec, path, packages)
    find_meshes(spec, path.resolve().parent / spec.meshdir)
    touches = has_collision_shapes(text)
    for geom in [*spec.geoms]:
        sizes = _SIZES.get(geom.type, 0)
        if sizes and min(geom.size[:sizes]) <= 0.0:
            spec.delete(geom)  # a marker without size
        elif not touches:
            geom.contype = geom.conaffinity = 1
            geom.group = 0
    return spec


def _clear_stage(spec: mujoco.MjSpec) -> None:
    for thing in [*spec.worldbody.geoms, *spec.worldbody.lights]:
        spec.delete(thing)
    for texture in [*spec.textures]:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            spec.delete(texture)
    # These may refer to what is removed, and are not used; a compiler makes empty keys up to a file's `nkey`.
    spec.nkey = 0
    for thing in [*spec.keys, *spec.sensors, *spec.pairs, *spec.tuples]:
        spec.delete(thing)


def _name_all(spec: mujoco.MjSpec) -> None:
    """Names unnamed bodies and joints by their place in the file, as robot files need names."""
    for kind, things in (("body", spec.bodies[1:]), ("joint", spec.joints)):
        taken = {thing.name for thing in things}
        for number, thing in enumerate(things, 1):
            thing.name = thing.name or unused(f"{kind}_{number}", taken)


def _scale_masses(spec: mujoco.MjSpec) -> None:
    """Scales the masses to a file's total, which MuJoCo deprecates."""
    wanted, spec.compiler.settotalmass = spec.compiler.settotalmass, -1.0
    if not wanted > 0.0:
        return
    factor = wanted / float(compiled(spec).body_subtreemass[0])
    for body in spec.bodies:
        _make_heavier(body, factor)


def _set_masses(path: Path, spec: mujoco.MjSpec, masses: Mapping[str, float]) -> None:
    model = compiled(spec) if masses else None
    bodies = [body.name for body in spec.bodies[1:]]
    for name, mass in masses.items():
        if model is None or name not in bodies:
            raise UnknownNameError(f"{path}: its robot file: masses: {UnknownNameError.among('body', name, bodies)}")
        if not (own := float(model.body(name).mass[0])) > 0.0:
            raise FileFormatError(f"{path}: body '{name}' has no mass, which its robot file could change: give it one")
        _make_heavier(spec.body(name), mass / own)


def _make_heavier(body: mujoco.MjsBody, factor: float) -> None:
    for geom in body.geoms:
        geom.density, geom.mass = factor * geom.density, factor * geom.mass
    body.mass = factor * body.mass
    body.inertia, body.fullinertia = factor * np.array(body.inertia), factor * np.array(body.fullinertia)


def _mend_inertias(spec: mujoco.MjSpec) -> None:
    """Balances masses and inertias that are zero or break the triangle inequality."""
    for body in spec.bodies[1:]:
        xx, yy, zz, xy, xz, yz = body.fullinertia.tolist()
        matrix = np.diag(body.inertia) if np.isnan(xx) else np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        a, b, c = np.linalg.eigvalsh(matrix).tolist()
        given = bool(body.explicitinertial)
        weighs = given or not body.joints or any(geom.density and geom.mass != 0.0 for geom in body.geoms)
        if not weighs or (given and (body.mass < LEAST_MASS or a < LEAST_INERTIA or a + b < c * (1.0 - 1e-6))):
            spec.compiler.balanceinertia = True
            spec.compiler.boundmass = max(spec.compiler.boundmass, LEAST_MASS)
            spec.compiler.boundinertia = max(spec.compiler.boundinertia, LEAST_INERTIA)
        if given and a < LEAST_INERTIA and not np.isnan(xx):
            # MuJoCo refuses such a matrix before it would mend it.
            moments, axes = np.linalg.eigh(matrix)
            least = np.maximum(moments, LEAST_INERTIA)
            body.fullinertia = ((axes * least) @ axes.T)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()


def _servos(path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel, feet: Sequence[str]) -> None:
    """Replaces all actuators by one position servo a played joint."""
    driven = _driven(model)
    coupled = followers(model)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    played = [int(joint) for joint in (driven or hinges) if joint not in coupled]
    if not played:
        raise FileFormatError(f"{path}: it has no hinge joint that could be moved{unplayed_balls(model)}")
    old, stance = [*spec.actuators], stances(model, feet)
    for joint in played:
        name = model.joint(joint).name
        servo = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        force, gains = _own_servo(model, joint, driven.get(joint))
        if gains is None:
            *gains, rotor = guess_servo(model, joint, stance.get(joint, 0.0))
            turning = spec.joint(name)
            lacking = rotor - float(model.dof_M0[model.jnt_dofadr[joint]])
            turning.armature = turning.armature + max(lacking, 0.0)
        servo.set_to_position(kp=gains[0], kv=gains[1])
        # A new actuator has the file's defaults, such as a control range of -1 to 1.
        servo.ctrllimited, servo.actlimited, servo.forcelimited = False, False, bool(np.isfinite(force))
        servo.gear[:] = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if servo.forcelimited:
            servo.forcerange = [-force, force]
    new = spec.actuators[len(old) :]
    slack = _slack_tendons(model)
    for thing in [*old, *(tendon for tendon in spec.tendons if tendon.name in slack)]:
        spec.delete(thing)
    for servo, joint in zip(new, played, strict=True):
        servo.name = model.joint(joint).name


def _driven(model: mujoco.MjModel) -> dict[int, int | None]:
    """The driven hinges, each with its actuator, or None if driven by tendons or cranks."""
    hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    driven: dict[int, int | None] = {}
    moment = np.zeros((model.nu, model.nv))  # of actuators on tendons and cranks
    at_a_distance = np.isin(model.actuator_trntype, _AT_A_DISTANCE)
    if at_a_distance.any():
        data = mujoco.MjData(model)
        for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_transmission):
            step(model, data)
        rows = data.moment_rownnz, data.moment_rowadr
        mujoco.mju_sparse2dense(moment, data.actuator_moment, *rows, data.moment_colind)
        moment[~at_a_distance] = 0.0
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] in _AT_A_JOINT:
            joint = int(model.actuator_trnid[actuator, 0])
            if hinge[joint]:
                driven.setdefault(joint, actuator)
        else:
            for joint in model.dof_jntid[moment[actuator] != 0.0].tolist():
                if hinge[joint]:
                    driven.setdefault(joint, None)
    return driven


def _slack_tendons(model: mujoco.MjModel) -> set[str]:
    """The tendons that do nothing without their actuators, such as muscles, by name: each costs time."""
    pulled = model.actuator_trnid[model.actuator_trntype == _AT_A_DISTANCE[0], 0]
    tied = model.eq_type == mujoco.mjtEq.mjEQ_TENDON
    busy = np.isin(np.arange(model.ntendon), [*model.eq_obj1id[tied], *model.eq_obj2id[tied]])
    for what in ("stiffness", "damping", "limited", "frictionloss", "armature"):
        values = getattr(model, f"tendon_{what}")
        busy |= values.reshape(len(busy), values.size // max(len(busy), 1)).any(axis=1)
    return {model.tendon(int(one)).name for one in np.unique(pulled) if not busy[one]}


def _own_servo(model: mujoco.MjModel, joint: int, actuator: int | None) -> tuple[float, tuple[float, float] | None]:
    """The torque limit of a joint, and stiffness and damping of a position servo."""
    force = float("inf")
    if model.jnt_actfrclimited[joint]:
        force = float(np.abs(model.jnt_actfrcrange[joint]).max())
    if actuator is not None:
        gear = abs(float(model.actuator_gear[actuator, 0]))
        if model.actuator_forcelimited[actuator]:
            force = gear * float(np.abs(model.actuator_forcerange[actuator]).max())
        bias = model.actuator_biasprm[actuator]
        gain = float(model.actuator_gainprm[actuator, 0])
        if bias[1] < 0.0 < gain:
            return force, (gain * gear**2, -float(bias[2]) * gear**2)
        if model.actuator_ctrllimited[actuator]:
            force = min(force, gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()))
    return force, None


def guess_servo(model: mujoco.MjModel, joint: int, stance: float) -> tuple[float, float, float]:
    """kp, N m/rad, kv, N m s/rad, and least inertia about its axis, kg m^2, of a hinge, from the masses below it.

    `stance` is weight times length of its leg, N m, or 0 for another limb.
    """
    data = posed(model)
    mujoco.mj_comPos(model, data)
    body, anchor = int(model.jnt_bodyid[joint]), data.xanchor[joint]
    inertia = np.zeros((3, 3))
    for part in below(model, body):
        axes, arm = data.ximat[part].reshape(3, 3), data.xipos[part] - anchor
        inertia += axes @ np.diag(model.body_inertia[part]) @ axes.T
        inertia += model.body_mass[part] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    hardest = float(np.linalg.eigvalsh(inertia)[-1]) + float(model.dof_armature[model.jnt_dofadr[joint]])
    moment = float(model.body_subtreemass[body] * np.linalg.norm(data.subtree_com[body] - anchor))
    kp = max(hardest * BANDWIDTH**2, moment * GRAVITY / SAG, STANCE * stance)
    if stance:
        return kp, 2.0 * kp / STANCE_BANDWIDTH, kp / STANCE_SWINGS**2
    return kp, 2.0 * sqrt(kp * hardest), kp / SWINGS**2


def stances(model: mujoco.MjModel, feet: Sequence[str]) -> dict[int, float]:
    """Weight times length of the leg, N m, for each joint between the root and one of the feet."""
    data = posed(model)
    weight, found = GRAVITY * float(model.body_mass.sum()), dict[int, float]()
    for name in feet:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) > 0:
            root, *leg = path_to(model, model.body(name).id)
            length = float(np.linalg.norm(data.xpos[leg[-1]] - data.xpos[root])) if leg else 0.0
            found |= {int(joint): weight * length for joint in np.flatnonzero(np.isin(model.jnt_bodyid, leg))}
    return found


def set_joints(path: Path, spec: mujoco.MjSpec, own: Mapping[str, JointLimit]) -> None:
    """Sets ranges of hinges and torque limits of joints in a model; joints that follow these get no range.

    `path` is for errors: UnknownNameError for a joint that is not played, FileFormatError for an empty range.
    """
    if not own:
        return
    model = spec.compile()
    joints = [model.actuator(index).name for index in range(model.nu)]
    for name, limit in own.items():
        UnknownNameError.check("joint", name, joints, f"{path}: limits.joints: ")
        joint = int(model.actuator_trnid[joints.index(name), 0])
        turning, is_hinge = spec.joint(model.joint(joint).name), model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        lower, upper = model.jnt_range[joint].tolist() if model.jnt_limited[joint] else (-np.pi, np.pi)
        lower = limit.lower if limit.lower is not None else lower if is_hinge else -upper
        upper = limit.upper if limit.upper is not None else upper
        if not lower < upper:
            raise FileFormatError(f"{path}: limits.joints.{name}: lower must be less than upper")
        if is_hinge and (limit.lower, limit.upper) != (None, None):
            turning.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            turning.range = np.degrees((lower, upper)) if spec.compiler.degree else (lower, upper)
            for follower, (leader, _) in followers(model).items():
                if leader == joint:
                    spec.joint(model.joint(follower).name).limited = mujoco.mjtLimited.mjLIMITED_FALSE
        if limit.torque is not None:
            servo = spec.actuator(name)
            servo.forcelimited, servo.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, (-limit.torque, limit.torque)
            turning.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
