"""Ball joints of a robot's model: three hinges replace each driven one, because only hinges are played."""

from itertools import combinations

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.formats.mesh_files import compiled

NAMES = ("pitch", "roll", "yaw")  # suffixes of the hinges' names, after that of the ball joint or its body

_KEPT = ("stiffness", "damping", "armature", "frictionloss", "group")
_ALONG = 0.3  # largest sine between a limb and the line from side to side to count as along it
_AT_A_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_BALL = int(mujoco.mjtJoint.mjJNT_BALL)


def unplayed_balls(model: mujoco.MjModel) -> str:
    """The end of an error message about ball joints that are not played, or ""."""
    balls = np.flatnonzero(model.jnt_type == _BALL).tolist()
    if not balls:
        return ""
    first, more = model.joint(balls[0]).name, f" and {len(balls) - 1} more" if len(balls) > 1 else ""
    return f". Its ball joints ('{first}'{more}) have no actuator, as others have, and are not played: give them some"


def hinges_for_balls(spec: mujoco.MjSpec) -> None:
    """Replaces each driven ball joint, or all in a model without actuators, by three hinges with the ball's range."""
    # The first axis goes from side to side, the last along the limb, the second across both: they are singular only if
    # the limb points straight to the side.
    balls = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_BALL]
    for ball in balls:
        ball.range = (0.0, float(np.abs(ball.range).max()))  # a URDF's goes both ways, which MuJoCo refuses
    driven = {actuator.target for actuator in spec.actuators if actuator.trntype in _AT_A_JOINT}
    if spec.actuators:
        balls = [ball for ball in balls if ball.name in driven]
    if not balls:
        return
    axes = _axes(compiled(spec), [ball.id for ball in balls])
    gone = {ball.name for ball in balls}
    for actuator in [*spec.actuators]:
        if actuator.target in gone and actuator.trntype in _AT_A_JOINT:
            spec.delete(actuator)
    taken = {joint.name for joint in spec.joints}
    for ball, three in zip(balls, axes, strict=True):
        body = ball.parent
        base = ball.name or body.name
        was = {key: getattr(ball, key) for key in _KEPT}
        place, most, limited = np.array(ball.pos), float(ball.range[1]), ball.limited
        spec.delete(ball)
        for word, axis in zip(NAMES, three, strict=True):
            name = unused(f"{base}_{word}", taken) if base else ""
            hinge = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, pos=place, axis=axis)
            hinge.range, hinge.limited = (-most, most), limited
            for key, value in was.items():
                setattr(hinge, key, value)
            if gone & driven:
                motor = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
                motor.set_to_motor()
                motor.ctrllimited = motor.forcelimited = False


def unused(name: str, taken: set[str]) -> str:
    """Adds a name to those taken, followed by as many "_" as make it a new one."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _axes(model: mujoco.MjModel, balls: list[int]) -> list[Array]:
    """The hinges' axes of ball joints, in the frames of their bodies, shape (3, 3) each, a row a hinge."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = [int(model.jnt_bodyid[ball]) for ball in balls]
    # Between the farthest ball joints of one body, such as the hips; else y.
    parent = {ball: int(model.body_parentid[model.jnt_bodyid[ball]]) for ball in balls}
    ways = [data.xanchor[b] - data.xanchor[a] for a, b in combinations(balls, 2) if parent[a] == parent[b]]
    farthest = max(ways, key=lambda way: float(np.linalg.norm(way)), default=np.zeros(3))
    length = float(np.linalg.norm(farthest))
    side, found = farthest / length if length > 0.0 else np.array([0.0, 1.0, 0.0]), []
    for ball, own in zip(balls, body, strict=True):
        # Towards the next joints, or the middle of the body.
        at, following = data.xanchor[ball], np.flatnonzero(model.body_parentid == own)
        ends = data.xanchor[np.isin(model.jnt_bodyid, following)]
        ways = [end - at for end in (ends.mean(axis=0) if len(ends) else at, data.xipos[own])]
        limb = next((way for way in ways if np.linalg.norm(way) > 1e-6), np.array([0.0, 0.0, 1.0]))
        limb = limb / np.linalg.norm(limb)
        across = np.cross(limb, side)
        if np.linalg.norm(across) < _ALONG:
            across = np.cross(side, np.eye(3)[int(np.argmin(np.abs(side)))])
        across /= np.linalg.norm(across)
        found.append(np.array([side, across, limb]) @ data.xmat[own].reshape(3, 3))
    return found
