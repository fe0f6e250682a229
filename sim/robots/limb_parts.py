"""Division of a robot's limbs: knee and ankle of a leg, elbow and wrist of an arm.

A knee (elbow) is the first hinge that lies across its limb, parallel to its mirrored twin, with much of the limb on
both sides. Hinges along the limb (yaw of a thigh, roll of a forearm) belong to the segment that they turn. The next
hinge across the limb is the ankle (wrist); toes and fingers are ignored.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.limb_geometry import ACROSS, end_hinge, farthest, folds, sine
from sim.robots.standing_body import PARALLEL, RobotLimb, StandingBody

LEG = ("thigh", "shank", "foot")
ARM = ("upper_arm", "forearm", "hand")

# Share of the best hinge's shorter side from which the first hinge is the knee.
BEND_SHARE = 0.6
# Largest distance of further joints ahead of the ankle, in shanks, and from the wrist, in forearms.
TOES_SHARE, FINGERS_SHARE = 0.15, 0.3


def limb_bodies(
    body: StandingBody, names: tuple[str, str, str], limbs: dict[str, RobotLimb], ahead: Array
) -> dict[str, str]:
    """Part, such as "l_shank", to the name of its body, for the three parts of each limb, or two without an end hinge.

    `names` is LEG or ARM, `limbs` "l" and "r" to limbs that can bend, and `ahead` (3,) the robot's heading.
    """
    parts, data, moved = {}, body.data, body.model.jnt_bodyid
    for side, limb in limbs.items():
        bend = bend_index(body, limb, limbs.get("l" if side == "r" else "r", limb))
        knee = limb.joints[bend]
        upper = next(joint for joint in reversed(limb.joints[:bend]) if moved[joint] != moved[knee])
        found = [upper, knee]
        end = end_joint(body, limb, bend)
        if end is not None:
            at = data.xanchor[end]
            span = float(np.linalg.norm(at - data.xanchor[knee]))
            for joint in limb.joints[limb.joints.index(end) + 1 :]:
                way = data.xanchor[joint] - at
                if way @ ahead < TOES_SHARE * span if names is LEG else np.linalg.norm(way) < FINGERS_SHARE * span:
                    end = joint
            found.append(end)
        parts |= {f"{side}_{name}": body.name(moved[joint]) for name, joint in zip(names, found, strict=False)}
    return parts


def bend_index(body: StandingBody, limb: RobotLimb, twin: RobotLimb) -> int:
    """The index of the knee (elbow) among a limb's joints; a limb without a twin is its own."""
    at = [body.data.xanchor[j] for j in limb.joints]
    between = at[0] - body.data.xanchor[twin.joints[0]]
    mirror = between / max(float(np.linalg.norm(between)), 1e-9)
    score: dict[int, float] = {}
    for k in range(1, len(at)):
        if body.model.jnt_bodyid[limb.joints[k]] == body.model.jnt_bodyid[limb.joints[0]]:
            continue  # it would leave no body for the upper segment
        up, down = farthest(at[:k], at[k]) - at[k], farthest([*at[k + 1 :], limb.tip], at[k]) - at[k]
        axis = body.data.xaxis[limb.joints[k]]
        share = min(float(np.linalg.norm(up)), float(np.linalg.norm(down)))
        across = min(sine(axis, up), sine(axis, down)) >= ACROSS
        other = body.data.xaxis[twin.joints[k]] if len(twin.joints) == len(limb.joints) else axis
        other = other - 2.0 * (other @ mirror) * mirror
        # Other hinges are knees only if there is no better one.
        score[k] = share * (1.0 if across and abs(axis @ other) >= PARALLEL else 0.1)
    most = max(score.values())
    return next(k for k, value in score.items() if value >= BEND_SHARE * most)


def end_joint(body: StandingBody, limb: RobotLimb, knee: int) -> int | None:
    """The first joint of the ankle (wrist), for the index of the knee; None without one."""
    at = body.data.xanchor[limb.joints[knee]]
    upper = float(np.linalg.norm(farthest([body.data.xanchor[j] for j in limb.joints[:knee]], at) - at))
    return end_hinge(body.data, limb.joints[knee + 1 :], at, upper)


def front_direction(body: StandingBody, limb: RobotLimb, knee: int) -> Array:
    """The front of a leg without an ankle, shape (3,), m: away from the fold of its knee."""
    joint = limb.joints[knee]
    axis, at = body.data.xaxis[joint], body.data.xanchor[joint]
    up, down = at - farthest([body.data.xanchor[j] for j in limb.joints[:knee]], at), limb.tip - at
    return -folds(body.model, joint, axis, up, down) * np.cross(axis, down)


def can_bend(model: mujoco.MjModel, joints: Sequence[int]) -> bool:
    """Whether hinges move at least two bodies."""
    return len({int(model.jnt_bodyid[joint]) for joint in joints}) > 1
