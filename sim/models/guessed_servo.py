"""The position servo of a joint whose model file has none: stiff enough to carry the limb in any posture.

A model file has the limbs straight, and a straight arm has almost no inertia about its own axis. Bent, the same hinge
has to carry the forearm. So the stiffness follows from the limb turned about the axis that is hardest to turn about:

    kp = max(I w^2, M g / SAG),    kv = 2 sqrt(kp I)

with I the limb's greatest moment of inertia about the joint's anchor plus that of the joint's own rotor, w the
bandwidth, and M the limb's mass times the distance of its centre. A leg that stands turns the rest of the body about
the foot: the stiffness of its joints is at least STANCE times the weight times the length of the leg, with damping and
rotor to match.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import mujoco
import numpy as np

from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import below, path_to

BANDWIDTH = 30.0  # rad/s
SAG = 0.02
"""How far a limb held out level may sag, rad."""
SWINGS = 200.0
"""A joint as light as its axis alone makes it swings on its servo at most so fast, rad/s: its rotor has inertia too."""
STANCE, STANCE_BANDWIDTH, STANCE_SWINGS = 4.0, 60.0, 100.0
"""The same of a leg that stands: with a lighter rotor the foot bounces on the floor. Chosen on a walking G1."""


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


def guess_servo(model: mujoco.MjModel, joint: int, stance: float = 0.0) -> GuessedServo:
    """A servo for a hinge, from the masses that hang from it as the model file places them.

    Args:
        model: whose.
        joint: the hinge.
        stance: weight times length of the leg that it belongs to, N m; 0 if it is not a leg's.
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
        return GuessedServo(kp, 2.0 * kp / STANCE_BANDWIDTH, kp / STANCE_SWINGS**2)
    return GuessedServo(kp, 2.0 * sqrt(kp * hardest), kp / SWINGS**2)


def stances(model: mujoco.MjModel, feet: Sequence[str]) -> dict[int, float]:
    """Weight times length of the leg, N m, of each joint between the root and one of the bodies that it stands on."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    weight, found = GRAVITY * float(model.body_mass.sum()), dict[int, float]()
    for name in feet:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) > 0:
            root, *leg = path_to(model, model.body(name).id)
            length = float(np.linalg.norm(data.xpos[leg[-1]] - data.xpos[root])) if leg else 0.0
            found |= {int(joint): weight * length for joint in np.flatnonzero(np.isin(model.jnt_bodyid, leg))}
    return found
