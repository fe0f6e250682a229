"""The free root of a robot, whose file may have it fixed to the world, on rails, tied, or on the floor."""

from pathlib import Path

import mujoco
import numpy as np

from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from sim.models.formats.mesh_files import compiled
from sim.models.formats.urdf_visuals import MOVED_ORIGIN
from sim.models.kinematic_tree import below, path_to, posed
from sim.models.surface import Surface

ROOT_JOINT = "(root)"
# Largest height of a root on the floor, and of a limb that stands, in robots' heights.
ON_THE_FLOOR, STANDS = 0.05, 0.12

_CLOSING = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
_OF_ROBOTS = (*_CLOSING, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON)  # the others are about cloth


def free_root(path: Path, spec: mujoco.MjSpec) -> None:
    """Frees the root, with its origin in the pelvis, and removes all other bodies and ties to them or to the world.

    FileFormatError if there is no body, or its root turns against the world on a joint.
    """
    bodies = [body for body in spec.worldbody.bodies if not body.mocap]
    if not bodies:
        raise FileFormatError(f"{path}: there is no body in it")
    floating = [body for body in bodies if _free(body) and _moving(body)]
    root = max(floating or bodies, key=lambda body: (_moving(body), 0 if floating else len(body.find_all("body"))))
    joint = next(iter(_free(root)), None)
    if joint is None:
        _clear_rails(spec, root)
        if root.joints:
            raise FileFormatError(
                f"{path}: body '{root.name}' hangs from the world by joint '{root.joints[0].name}'. "
                "Put a body without joints, or with a free joint, above it."
            )
        joint = root.add_freejoint()
    joint.name = joint.name or ROOT_JOINT
    root.name = root.name or ROOT_JOINT
    _move_origin(spec, root)
    for body in [*spec.worldbody.bodies]:
        if body.name != root.name:
            # A ball or a table would precede the free root in qpos; a mocap body would pull at its welds.
            spec.delete(body)
    left = {body.name for body in spec.bodies}
    for looking in [*spec.cameras, *spec.lights]:
        if looking.targetbody and looking.targetbody not in left:
            spec.delete(looking)
    for skin in [*spec.skins]:
        if not left.issuperset(skin.bodyname):
            spec.delete(skin)
    cloths = [cloth for cloth in spec.flexes if not left.issuperset([*cloth.vertbody, *cloth.nodebody])]
    gone = {cloth.name for cloth in cloths}
    for equality in [*spec.equalities]:
        tied_to_world = equality.type in _CLOSING and "world" in _tied(spec, equality)
        if tied_to_world or (equality.type not in _OF_ROBOTS and equality.name1 in gone):
            spec.delete(equality)
    for cloth in cloths:
        spec.delete(cloth)


def _free(body: mujoco.MjsBody) -> list[mujoco.MjsJoint]:
    return [joint for joint in body.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]


def _moving(body: mujoco.MjsBody) -> int:
    """Number of joints of a body and below it, except a free one."""
    return sum(len(part.joints) for part in [body, *body.find_all("body")]) - len(_free(body))


def _tied(spec: mujoco.MjSpec, equality: mujoco.MjsEquality) -> list[str]:
    """The names of the two bodies that a connect or weld constraint ties to each other."""
    names = equality.name1, equality.name2
    if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
        return [spec.site(name).parent.name for name in names]
    return [name or "world" for name in names]


def _clear_rails(spec: mujoco.MjSpec, root: mujoco.MjsBody) -> None:
    """Removes undriven joints by which the root slides and turns against the world."""
    # Some files have three, or six, in place of a free joint, perhaps each on a body without solids.
    rails, body = [*root.joints], root
    while not body.geoms and len(body.bodies) == 1:
        body = body.bodies[0]
        rails += body.joints
    slides = any(joint.type == mujoco.mjtJoint.mjJNT_SLIDE for joint in rails)
    names = {joint.name for joint in rails}
    if slides and not any(actuator.target in names for actuator in spec.actuators):
        for joint in rails:
            spec.delete(joint)


def _move_origin(spec: mujoco.MjSpec, root: mujoco.MjsBody) -> None:
    """Moves the origin of a root body to its pelvis, where the limbs part: some files have it on the floor."""
    model = compiled(spec)
    movers = [path_to(model, int(body)) for body in set(model.jnt_bodyid[model.jnt_type != mujoco.mjtJoint.mjJNT_FREE])]
    if not movers:
        return
    shared = [bodies[0] for bodies in zip(*(path[:-1] for path in movers), strict=False) if len(set(bodies)) == 1]
    own, pelvis = model.body(root.name).id, shared[-1] if shared else 0
    parts = [*root.bodies, *root.geoms, *root.sites, *root.cameras, *root.lights]
    data = posed(model)
    place = data.xpos[pelvis] if pelvis != own else _hips(model, data, own)
    if place is None or not pelvis or any(part.frame is not None for part in parts):
        return
    offset = data.xmat[own].reshape(3, 3).T @ (place - data.xpos[own])
    spec.add_numeric(name=MOVED_ORIGIN, size=3, data=offset)
    for part in parts:
        part.pos = part.pos - offset
    if root.explicitinertial:
        root.ipos = root.ipos - offset
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_CONNECT and equality.name1 == root.name:
            equality.data[:3] -= offset
    root.pos = place


def _hips(model: mujoco.MjModel, data: mujoco.MjData, root: int) -> Array | None:
    """The middle of the first joints of the limbs that stand, shape (3,), if the root is no higher than the floor."""
    skin = Surface.touching(model)
    heights = skin.positions(data)[:, 2] - skin.radius
    if not len(heights) or data.xpos[root, 2] > (floor := float(heights.min())) + ON_THE_FLOOR * float(np.ptp(heights)):
        return None
    hips: list[Array] = []
    for child in np.flatnonzero(model.body_parentid == root).tolist():
        limb = below(model, child)
        joints, mine = np.flatnonzero(np.isin(model.jnt_bodyid, limb)), np.isin(skin.body, limb)
        if len(joints) and mine.any() and heights[mine].min() < floor + STANDS * float(np.ptp(heights)):
            hips.append(data.xanchor[joints[0]])
    return np.mean(hips, axis=0) if hips else None
