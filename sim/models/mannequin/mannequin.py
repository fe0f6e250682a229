"""The mannequin: a MuJoCo humanoid built from any skeleton, which plays its motions exactly.

Each bone is a body at the end of its parent on a ball joint. In the rest pose every body's axes are the world's, so the
ball joint's quaternion is the bone's rotation seen from its parent.
"""

import mujoco
import numpy as np

from controller.motion.anatomy import Anatomy, Part, anatomy
from controller.motion.rotations import from_matrix
from controller.motion.skeleton import ROOT, Skeleton, thesis_skeleton
from sim.models.gravity import GRAVITY
from sim.models.mannequin.solids import Solid, bone_solids, limb_inertia, masses, pelvis_solids
from sim.models.overlaps import near_bodies
from sim.models.scenery import add_gantry, add_lamp, set_stage

ROOT_BODY = "(root)"  # no bone is called that

# Largest turn of a bone from the rest pose (arms out), rad: wider than people's, as recordings are noisy.
REACH: dict[Part, float] = {
    "trunk": 1.4, "neck": 1.4, "head": 1.5, "hip": 0.8, "thigh": 2.8, "shank": 2.8, "foot": 1.8,
    "clavicle": 1.7, "upper arm": 2.8, "forearm": 3.0, "hand": 2.4, "other": 3.0,
}  # fmt: skip

# All servos have the same critically damped closed loop: kp = I w^2 and kv = 2 kp / w, with the joint's largest inertia
# I about any axis in the rest pose.
SERVO_BANDWIDTH = 60.0
# Natural frequency of a servo without load, by its rotor, rad/s: keeps a chain of stiff joints, and a light foot on the
# floor, stable at this timestep.
ROTOR_RATE = 200.0
# Acceleration of a light bone's joint, m/s^2 (a heel strike in a run), and its largest lag then, rad: bounds kp below.
FLUNG = (100.0, 0.05)
STANCE = 2.0  # least kp of a standing leg, in weights times heights of the hips

SELF, OTHERS = 1, 2  # contact bits of solids between bodies, and of those that only the floor of a free root touches
SOFT = (0.04, 1.0)  # soft contacts: time constant, s, and damping ratio

COLOURS = {
    "body": (0.90, 0.89, 0.86),
    "dark": (0.20, 0.23, 0.28),
    "left": (0.91, 0.63, 0.42),
    "right": (0.38, 0.59, 0.75),
    "middle": (0.90, 0.89, 0.86),
}
STATURE = 1.75  # m
# Lengths of the 19 bones over the stature (Drillis and Contini 1966, as in Winter 2009, fig. 4.1): hip, thigh, shank
# and foot of either side; back, neck and head; shoulder, upper arm, forearm and hand of either side.
_LEG = (0.0955, 0.245, 0.246, 0.11)
_TRUNK = (0.144, 0.144, 0.13)
_ARM = (0.1295, 0.186, 0.146, 0.108)


def build_mannequin(skeleton: Skeleton) -> mujoco.MjSpec:
    """The humanoid of a skeleton with scenery: a free root on a gantry, one body and one ball joint a bone.

    Bodies and joints have the bones' names; each joint has three position actuators ("lkne.x", "lkne.y", "lkne.z") on
    the components of its rotation vector. Bodies collide, except neighbours and overlaps in the rest pose; nothing
    collides with the floor.
    """
    parts = anatomy(skeleton)
    mass = masses(skeleton, parts)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.modelname = f"mannequin of {skeleton.name}"
    for tone, (r, g, b) in COLOURS.items():
        spec.add_material(name=tone, rgba=[r, g, b, 1.0], specular=0.25, shininess=0.35)

    height = max(skeleton.leg_length, 0.3)
    set_stage(spec, height)
    root = spec.worldbody.add_body(name=ROOT_BODY, pos=[0.0, 0.0, height])
    root.add_freejoint(name=ROOT_BODY)
    _add_solids(root, pelvis_solids(skeleton, parts), mass[0], "middle")
    bodies = {ROOT: root}
    for bone, name in enumerate(skeleton.bones):
        parent = int(skeleton.parent[bone])
        start = np.zeros(3) if parent == ROOT else skeleton.rest_direction[parent] * skeleton.length[parent]
        body = bodies[parent].add_body(name=name, pos=start)
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL, limited=True, range=[0.0, REACH[parts.part[bone]]])
        body.add_site(name=name, pos=skeleton.rest_direction[bone] * skeleton.length[bone], size=[0.005] * 3, group=4)
        _add_solids(body, bone_solids(skeleton, parts, bone), mass[bone + 1], parts.side[bone])
        spread = limb_inertia(skeleton, parts, bone, mass[bone + 1])
        if spread is not None:
            body.explicitinertial, body.mass = True, mass[bone + 1]
            body.ipos, body.iquat, body.inertia = spread
        bodies[bone] = body
    _add_servos(spec, skeleton, parts, height)
    for a, b in sorted(near_bodies(model := spec.compile(), model.qpos0)):
        spec.add_exclude(bodyname1=model.body(a).name, bodyname2=model.body(b).name)
    add_lamp(root, height)
    add_gantry(spec, root)
    return spec


def fit_mannequin(model: mujoco.MjModel, skeleton: Skeleton) -> None:
    """Gives a mannequin's model the lengths of another skeleton with the same bones and parents; masses stay."""
    parts = anatomy(skeleton)
    for bone, name in enumerate((ROOT_BODY, *skeleton.bones), ROOT):
        body = model.body(name)
        if bone != ROOT and (parent := int(skeleton.parent[bone])) != ROOT:
            body.pos[:] = skeleton.offsets[parent]
        solids = bone_solids(skeleton, parts, bone) if bone != ROOT else pelvis_solids(skeleton, parts)
        for geom, solid in enumerate(solids, int(body.geomadr[0])):
            model.geom_pos[geom], model.geom_quat[geom] = solid.centre, from_matrix(solid.axes)
            model.geom_size[geom] = _size(solid)


def _size(solid: Solid) -> list[float]:
    """The size of a geom, m."""
    a, b, c = solid.size.tolist()
    return [a, b, c] if solid.shape == "ellipsoid" else [a, max(c, 1e-4), 0.0]


def _add_solids(body: mujoco.MjsBody, solids: list[Solid], mass: float, side: str) -> None:
    volume = sum(solid.volume for solid in solids)
    # One capsule along a limb collides as well as all its solids, in a tenth of the time.
    long = [solid.shape == "capsule" and bool(solid.size[2] > 2.0 * solid.size[0]) for solid in solids]
    touching = long if any(long) else [solid.tone != "dark" for solid in solids]
    for solid, touches in zip(solids, touching, strict=True):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID if solid.shape == "ellipsoid" else mujoco.mjtGeom.mjGEOM_CAPSULE,
            pos=solid.centre,
            quat=from_matrix(solid.axes),
            size=_size(solid),
            mass=mass * solid.volume / volume,
            material=side if solid.tone == "limb" else solid.tone,
            contype=SELF if touches else OTHERS,
            conaffinity=SELF if touches else 0,
            condim=1,  # bodies slide on each other; a floor brings its own friction
            solref=SOFT,
        )


def _add_servos(spec: mujoco.MjSpec, skeleton: Skeleton, parts: Anatomy, height: float) -> None:
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    standing = STANCE * float(model.body_mass.sum()) * GRAVITY * height
    for bone, name in enumerate(skeleton.bones):
        first, body = model.joint(name).dofadr[0], model.body(name).id
        felt = model.dof_M0[first : first + 3].max()
        # Mass below the joint times the distance of its centre.
        moment = model.body_subtreemass[body] * np.linalg.norm(data.subtree_com[body] - data.xpos[body])
        needs = [felt * SERVO_BANDWIDTH**2, moment * FLUNG[0] / FLUNG[1]]
        if parts.part[bone] in ("shank", "foot") and parts.first(parts.part[bone], parts.side[bone]) == bone:
            needs.append(standing)
        kp = max(needs)
        spec.joint(name).armature = kp / ROTOR_RATE**2
        for axis in range(3):
            servo = spec.add_actuator(name=f"{name}.{'xyz'[axis]}", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
            servo.gear[:] = 0.0
            servo.gear[axis] = 1.0
            servo.set_to_position(kp=kp, kv=2.0 * kp / SERVO_BANDWIDTH)


def reference_body() -> Skeleton:
    """The skeleton, with the bones of Jaeger's patterns."""
    return thesis_skeleton(STATURE * np.array([*_LEG, *_LEG, *_TRUNK, *_ARM, *_ARM]), "average body")
