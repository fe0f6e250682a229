"""The position servo of a joint without one in its model: stiff enough to carry the limb in any posture.

A straight arm has almost no inertia about its axis; bent, the same hinge carries the forearm. So the stiffness follows
from the limb's largest moment of inertia:

    kp = max(I w^2, M g / SAG),    kv = 2 sqrt(kp I)

with I about the joint's anchor plus that of the rotor, w the bandwidth, and M the limb's mass times the distance of its
centre. A standing leg turns the rest of the body about the foot: its stiffness is at least STANCE times the weight
times the length of the leg, with damping and rotor to match.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import mujoco
import numpy as np

from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import below, path_to

BANDWIDTH = 30.0  # rad/s
SAG = 0.02  # largest sag of a limb held out level, rad
SWINGS = 200.0  # natural frequency of a servo without its limb, by the rotor's inertia, rad/s
# The same for a standing leg: with a lighter rotor the foot bounces on the floor. Chosen on a walking G1.
STANCE, STANCE_BANDWIDTH, STANCE_SWINGS = 4.0, 60.0, 100.0


def guess_servo(model: mujoco.MjModel, joint: int, stance: float) -> tuple[float, float, float]:
    """kp, N m/rad, kv, N m s/rad, and least inertia about its axis, kg m^2, of a hinge, from the masses below it.

    `stance` is weight times length of its leg, N m, or 0 for another limb.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
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
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    weight, found = GRAVITY * float(model.body_mass.sum()), dict[int, float]()
    for name in feet:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) > 0:
            root, *leg = path_to(model, model.body(name).id)
            length = float(np.linalg.norm(data.xpos[leg[-1]] - data.xpos[root])) if leg else 0.0
            found |= {int(joint): weight * length for joint in np.flatnonzero(np.isin(model.jnt_bodyid, leg))}
    return found
