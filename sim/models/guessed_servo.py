"""The position servo of a joint whose model file has none: stiff enough to carry the limb in any posture.

A model file has the limbs straight, and a straight arm has almost no inertia about its own axis. Bent, the same hinge
has to carry the forearm. So the stiffness follows from the limb turned about the axis that is hardest to turn about:

    kp = max(I w^2, M g / SAG),    kv = 2 sqrt(kp I)

with I the limb's greatest moment of inertia about the joint's anchor, w the bandwidth, and M the limb's mass times the
distance of its centre.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import mujoco
import numpy as np

from sim.models.kinematic_tree import below

BANDWIDTH = 30.0  # rad/s
GRAVITY = 9.81
SAG = 0.02
"""How far a limb held out level may sag, rad."""
SWINGS = 200.0
"""A joint as light as its axis alone makes it swings on its servo at most so fast, rad/s: its rotor has inertia too."""


@dataclass(frozen=True)
class GuessedServo:
    """What a servo is given where nothing is known.

    Attributes:
        kp: stiffness, N m/rad.
        kv: damping, N m s/rad.
        rotor: the least moment of inertia about the joint's own axis that goes with them, kg m^2.
    """

    kp: float
    kv: float
    rotor: float


def guess_servo(model: mujoco.MjModel, joint: int) -> GuessedServo:
    """A servo for a hinge, from the masses that hang from it as the model file places them."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    body, anchor = int(model.jnt_bodyid[joint]), data.xanchor[joint]
    inertia = np.zeros((3, 3))
    for part in below(model, body):
        axes, arm = data.ximat[part].reshape(3, 3), data.xipos[part] - anchor
        inertia += axes @ np.diag(model.body_inertia[part]) @ axes.T
        inertia += model.body_mass[part] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    hardest = float(np.linalg.eigvalsh(inertia)[-1])
    moment = float(model.body_subtreemass[body] * np.linalg.norm(data.subtree_com[body] - anchor))
    kp = max(hardest * BANDWIDTH**2, moment * GRAVITY / SAG)
    return GuessedServo(kp, 2.0 * sqrt(kp * hardest), kp / SWINGS**2)
