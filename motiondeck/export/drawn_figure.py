"""The drawing of a robot on the page of an export: bodies, joints and solids as plain values, for `web/scene.js`."""

from base64 import b64encode
from collections.abc import Collection
from typing import Any

import mujoco
import numpy as np

from controller.learning.measures.self_test import run_free
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array, rotate
from motiondeck.page.body.solids import batches
from motiondeck.page.web.stick_figure import figure_svg
from sim.models.joint_layout import JointLayout
from sim.models.scenery import LABEL, body_height
from sim.robots.robot import Robot

MOST_TRIANGLES = 800  # of a mesh: less than on the live page, since the folder is sent to others
MOMENTS = (0.1, 0.25, 0.4)  # of a motion, the last drawn darkest


def drawn_figure(model: mujoco.MjModel, layout: JointLayout) -> dict[str, Any]:
    """The drawing of a model of hinges, whose joints are numbered as in the layout; `web/scene.js` lists its keys."""
    played = {int(place): {"angle": int(angle)} for angle, place in zip(layout.hinge, layout.hinge_qpos, strict=True)}
    joints: list[list[dict[str, Any]]] = [[] for _ in range(model.nbody)]
    number = {int(model.jnt_qposadr[joint]): joint - 1 for joint in range(1, model.njnt)}  # without the free root
    led = {
        int(place): {"of": number[int(leader)], "curve": curve.tolist()}
        for group, followers, leaders in zip(layout.led, layout.followers, layout.leaders, strict=True)
        for place, leader, curve in zip(followers, leaders, group.curve, strict=True)
    }
    for place, joint in number.items():
        at, kind = joint + 1, model.jnt_type[joint + 1]
        fixed = {"axis": _short(model.jnt_axis[at]), "anchor": _short(model.jnt_pos[at])}
        moved = {"rest": float(model.qpos0[place]), "slides": bool(kind == mujoco.mjtJoint.mjJNT_SLIDE)}
        joints[model.jnt_bodyid[at]].append(fixed | moved | played.get(place, led.get(place, {})))
    above = [-1, *model.body_parentid[1:].tolist()]
    bodies = [
        {"parent": parent, "place": _short(place), "turn": _short(turn), "joints": own}
        for parent, place, turn, own in zip(above, model.body_pos, model.body_quat, joints, strict=True)
    ]
    meshes, solids = dict[str, Any](), list[dict[str, Any]]()
    for name, batch in batches(model, MOST_TRIANGLES).items():
        vertices, faces = batch.mesh
        meshes[name] = {"vertices": _packed(vertices.astype("<f4")), "faces": _packed(faces.astype("<u2"))}
        for geom, offset, scale, colour in zip(batch.geom, batch.offset, batch.scale, batch.colour, strict=True):
            turn = model.geom_quat[geom]
            where = {"body": int(model.geom_bodyid[geom]), "place": _short(model.geom_pos[geom] + rotate(turn, offset))}
            look = {"scale": _short(scale), "colour": [*_short(colour / 255.0), batch.opacity]}
            solids.append({"mesh": name, "turn": _short(turn), **where, **look})
    solids.sort(key=lambda solid: -solid["colour"][3])  # what is seen through is drawn last
    root = {"root": int(model.jnt_bodyid[0]), "start": _short(model.qpos0[:7]), "height": body_height(model)}
    labels = [
        {"text": site.name.removeprefix(LABEL), "body": int(site.bodyid[0]), "place": _short(site.pos)}
        for site in map(model.site, range(model.nsite))
        if site.name.startswith(LABEL)
    ]
    return {**root, "bodies": bodies, "meshes": meshes, "solids": solids, "labels": labels}


def pictures(library: MotionLibrary, robot: Robot, motions: Collection[str]) -> dict[str, str]:
    """A picture of each of some motions, as SVG: lines from joint to joint, and to the ends of limbs; none of dials."""
    model, data = robot.model, mujoco.MjData(robot.model)
    root = int(model.jnt_bodyid[0])
    bodies = [body for body in np.flatnonzero(model.body_rootid == root).tolist() if body != root]
    above = {body: int(model.body_parentid[body]) for body in bodies}
    ends = [body for body in bodies if body not in above.values()]
    parents = [bodies.index(above[body]) if above[body] != root else -1 for body in bodies]
    if max(parents) < 0:
        return {}
    parents += [bodies.index(body) for body in ends]
    network, found = library.network.twin(), dict[str, str]()
    for motion in (one for one in library.info.motions if one.name in motions):
        played, poses = run_free(network, motion.name, motion.frames), list[Array]()
        for moment in MOMENTS:
            pose = library.encoding.decode(played[round(moment * (motion.frames - 1))]).at(np.zeros(3))
            robot.place(robot.retarget(pose), pose, data.qpos)
            mujoco.mj_kinematics(model, data)
            tips = 2.0 * data.xipos[ends] - data.xpos[ends]  # a limb's centre is half way
            poses.append(np.concatenate([data.xpos[[root, *bodies]], tips]))
        found[motion.name] = figure_svg(np.array(poses), parents)
    return found


def _packed(values: Array) -> str:
    return b64encode(values.tobytes()).decode()


def _short(values: Array) -> list[float]:
    return [round(float(value), 6) for value in values]
