"""Fidelity of a retargeted clip, measured from joint positions and the robot's kinematics, without the retargeter."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.anatomy import Side, anatomy
from controller.motion.clip import Clip, poses_of
from controller.motion.rotations import Array, normalise, rotate, yaw
from sim.models.kinematic_tree import below
from sim.models.surface import LowestPoint, Surface
from sim.retargeting.human_limbs import LIMBS, LimbView
from sim.retargeting.inverse_kinematics import InverseKinematics
from sim.retargeting.retarget import ServoHumanoidRetargeter
from sim.retargeting.robot_trunk import facing
from sim.robots.robot import Limiter, Robot

SIDES: tuple[tuple[str, Side], ...] = (("r", "right"), ("l", "left"))
# Height of what touches the floor, leg lengths, and speed of a standing foot's ball, leg lengths a second.
STANDS, STILL = 0.01, 0.15
# A joint jumps by this in one frame, rad, although no limb of the human turns by a tenth of it.
JUMP = 0.5
APART = 0.02  # m between shoulders that show where the chest faces
ROUNDING = 1e-9


@dataclass(frozen=True)
class Carried:
    """A clip on a robot: T frames of J joints."""

    wanted: Array  # retargeted joints, clipped to their ranges, shape (T, J), rad
    played: Array  # the same after the target limiter, shape (T, J), rad
    qpos: Array  # the robot that plays them, shape (T, nq)
    limbs: Array  # directions of the human's limbs in the world, as of `human_lines`, shape (T, 18, 3)
    altered: float = 0.0  # share of the joint targets that the limiter changed


def carry(clip: Clip, robot: Robot, limiter: Limiter) -> Carried:
    """Plays a clip on a robot frame by frame: retargeter, target limiter, footing."""
    limits = robot.limits
    limited = limiter(limits, 1.0 / clip.rate)
    wanted, played = np.empty((2, len(clip), len(robot.joints)))
    qpos = np.zeros((len(clip), robot.model.nq))
    if robot.footing is not None:
        robot.footing.stance.flat.learn(clip)
    for frame, pose in enumerate(poses_of(clip)):
        np.clip(robot.retarget(pose), limits.lower, limits.upper, out=wanted[frame])
        if frame == 0:
            limited.start(wanted[0])
        played[frame] = limited(wanted[frame])
        robot.place(played[frame], pose, qpos[frame])
    altered = sum(limited.changed) / max(len(clip) * len(robot.joints), 1)
    return Carried(wanted, played, qpos, lines_for(robot, clip), altered)


def lines_for(robot: Robot, clip: Clip) -> Array:
    """The lines of `human_lines` for a robot; one without legs, which does not turn, sees them as the human faces."""
    lines = human_lines(clip)
    if not robot.has_legs:
        for frame in lines:
            frame[:] = rotate(yaw(-facing(frame)), frame)
    return lines


def human_lines(clip: Clip) -> Array:
    """Directions of LIMBS in the world, shape (T, 18, 3): limbs and the chest's axes from the joints' positions alone.

    The chest is the frame of the line from the middle of the hips to that of the shoulders and of the line through the
    shoulders. Feet, head and pelvis are those of `LimbView`.
    """
    view, parts, joints = LimbView(clip.skeleton), anatomy(clip.skeleton), clip.joints()
    found = np.array([view(pose) for pose in poses_of(clip)])
    starts = {}
    for side, name in SIDES:
        for part in ("thigh", "shank", "upper arm", "forearm"):
            bone = parts.first(part, name)
            if bone is not None:
                starts[f"{side}_{part}"] = start = joints[:, clip.skeleton.parent[bone] + 1]
                found[:, LIMBS.index(f"{side}_{part.replace(' ', '_')}")] = joints[:, bone + 1] - start
    across = starts["l_upper arm"] - starts["r_upper arm"]
    line = starts["r_upper arm"] + starts["l_upper arm"] - starts["r_thigh"] - starts["l_thigh"]
    chest = LIMBS.index("chest_ahead")
    if np.linalg.norm(across, axis=1).min() > APART:
        found[:, chest] = np.cross(across, line)
        found[:, chest + 1] = np.cross(line, found[:, chest])
    return normalise(found)


def joint_measures(clip: Clip, robot: Robot, carried: Carried) -> dict[str, float]:
    """Counts of errors, and speeds.

    `bad`: 1 with NaN or infinity; `beyond`: targets outside a range; `too_fast`: steps above a speed limit; `jumps`;
    `speed`: the highest share of a joint's limit; `altered` as in `Carried`.
    """
    limits, played = robot.limits, carried.played
    finite = bool(np.isfinite(played).all() and np.isfinite(carried.qpos).all())
    step = np.abs(np.diff(played, axis=0)) * clip.rate / limits.velocity
    wanted = np.abs(np.diff(carried.wanted, axis=0)).max(axis=1)
    turned = np.linalg.norm(np.diff(carried.limbs, axis=0), axis=-1).max(axis=1)
    if robot.footing is None and len(played) > 1:
        # A mannequin also plays what the limbs do not show, such as a hand or a bone that rolls.
        cosine = np.abs(np.einsum("tij,tij->ti", clip.rotation[1:], clip.rotation[:-1])).min(axis=1)
        turned = np.maximum(turned, 2.0 * np.arccos(np.minimum(cosine, 1.0)))
    return {
        "bad": 0.0 if finite else 1.0,
        "beyond": float(((played < limits.lower - ROUNDING) | (played > limits.upper + ROUNDING)).sum()),
        "too_fast": float((step > 1.0 + 1e-6).sum()),
        "jumps": float(((wanted > JUMP) & (turned < 0.1 * JUMP)).sum()),
        "speed": float(step.max(initial=0.0)),
        "altered": carried.altered,
    }


def shortfall(robot: Robot) -> dict[str, float]:
    """Errors of the retargeter since its last reset.

    For inverse kinematics `short_rms` and `short_worst` over goals and frames, m; for the angle solver `past_range`,
    the number of goals outside their joint's range; else nothing.
    """
    if isinstance(robot.retarget, ServoHumanoidRetargeter):
        return {"past_range": float(robot.retarget.beyond)}
    if not isinstance(robot.retarget, InverseKinematics):
        return {}
    missed = robot.retarget.solver.shortfall().values()
    return {
        "short_rms": float(np.sqrt(np.mean([goal["rms_m"] ** 2 for goal in missed]))),
        "short_worst": max(goal["worst_m"] for goal in missed),
    }


def floor_measures(clip: Clip, robot: Robot, qpos: Array, parts: Mapping[str, str]) -> dict[str, float]:
    """Contact of a robot's soles with the floor, for qpos (T, nq); its feet are among the parts of its robot file.

    `slide`: mean speed of a sole's lowest point while the human's foot stands, m/s; `sunk`: largest depth of a point in
    the floor, m; `floating`: share of frames without contact.
    """
    model = robot.model
    data, surface, lowest_point = mujoco.MjData(model), Surface.touching(model), LowestPoint(model)
    feet = {side: model.body(parts[f"{side}_foot"]).id for side, _ in SIDES if f"{side}_foot" in parts}
    soles = {side: np.flatnonzero(np.isin(surface.body, below(model, foot))) for side, foot in feet.items()}
    stands = {}  # whether the human's feet stand, by the speed of their ball, shape (T,) each
    for side, name in SIDES:
        foot, speed = anatomy(clip.skeleton).first("foot", name), np.zeros(len(clip))
        if foot is None:
            speed += np.inf
        elif len(clip) > 1:
            speed = np.linalg.norm(np.gradient(clip.joints()[:, foot + 1], axis=0), axis=1) * clip.rate
        stands[side] = speed < STILL * clip.skeleton.leg_length
    near = STANDS * robot.path_scale * clip.skeleton.leg_length
    speeds: list[float] = []
    sunk, floating = 0.0, 0
    before: Array | None = None
    for frame, q in enumerate(qpos):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        points = surface.positions(data)
        heights = points[:, 2] - surface.radius
        low = lowest_point(data)
        sunk = max(sunk, -low)
        floating += low > near
        for side, sole in soles.items():
            if before is not None and len(sole) and stands[side][frame]:
                lowest = sole[np.argmin(heights[sole])]
                speeds.append(float(np.linalg.norm(points[lowest, :2] - before[lowest, :2])) * clip.rate)
        before = points
    return {"slide": float(np.mean(speeds)) if speeds else 0.0, "sunk": sunk, "floating": floating / max(len(qpos), 1)}
