"""Strength: refuses to walk with a robot without ankles, or with servos too weak or too soft for one leg.

The plan moves the centre of pressure p from behind the middle of the sole to the front of it, while the centre of mass
c is between the feet. The servos of that leg then need the torques

    tau = W J_c,z - J_p^T f,      f = W ((c - p) / c_z, 1)

Servos are springs of the stiffnesses K: a horizontal force on the centre of mass moves it by J K^-1 J^T of the force, J
from the joints of the leg to c over a fixed foot. The displaced weight acts like a force of W / h of the displacement,
with the height h of c above the ankle. So the leg gives way where

    the largest eigenvalue of J K^-1 J^T is above h / W                                                         (15)
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from motiondeck_base.errors import MotiondeckError
from sim.models.feet import Foot
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import path_to, posed
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import Robot

ANKLE = 0.3  # largest height of an ankle above the sole, in heights of the root; a knee is at half of it


def check_legs(robot: Robot, model: mujoco.MjModel, body: WholeBody, feet: tuple[Foot, ...], roll: float) -> None:
    """Refuses, by MotiondeckError, a robot that cannot stand on one leg; in the solution `body` it stands on both feet.

    `roll` is the largest distance of the centre of pressure from the middle of the sole, m.
    """
    rest = posed(model, robot.rest_qpos)
    for number, foot in enumerate(feet):
        own, sole = body.bodies[number], body.sole(rest, number)
        if rest.xpos[model.body_weldid[own], 2] - sole[2] > ANKLE * (rest.xpos[model.jnt_bodyid[0], 2] - sole[2]):
            raise MotiondeckError(
                f"robot '{robot.name}' has no ankle above '{foot.body}', so it cannot walk: leave --walk;"
                " --root gantry carries it"
            )
    plan, root = body.plan, int(model.jnt_bodyid[0])
    weight, centre = float(model.body_subtreemass[root]) * GRAVITY, plan.subtree_com[root]
    joints, dof, most = model.actuator_trnid[:, 0], robot.layout.dof, robot.strength
    for number, foot in enumerate(feet):
        own = body.bodies[number]
        frame = plan.xmat[own].reshape(3, 3)
        sole = plan.xpos[own] + frame @ foot.sole
        leg = np.isin(model.dof_bodyid[dof], path_to(model, own)) & body.legs[dof]
        _check_stiffness(robot, model, body, number, leg)
        for ahead in (-roll, roll):
            arm = frame @ foot.axes[:, 0] * ahead
            lean = (centre - sole - arm) / (centre[2] - sole[2])
            needs = np.abs(weight * body.jacobian[14] - body.pushed(number, weight * lean, arm))[dof]
            short = np.where(leg, needs / most, 0.0)
            worst = int(np.argmax(short))
            if short[worst] > 1.0:
                raise MotiondeckError(
                    f"robot '{robot.name}' cannot stand on one leg, so it cannot walk: joint"
                    f" {model.joint(joints[worst]).name} needs {needs[worst]:.3g} N m and has {most[worst]:.3g}."
                    " Give it a stronger servo (`effort` in a URDF, `forcerange` in an MJCF, [servo] in the robot"
                    " file), or leave --walk; --root gantry carries it"
                )


def _check_stiffness(robot: Robot, model: mujoco.MjModel, body: WholeBody, foot: int, leg: NDArray[np.bool_]) -> None:
    root, joints, dof = int(model.jnt_bodyid[0]), model.actuator_trnid[leg, 0], robot.layout.dof[leg]
    stiffness = np.maximum(model.actuator_gainprm[leg, 0], 1e-9)
    sole, centre = body.jacobian[6 * foot : 6 * foot + 6], body.jacobian[12:14]
    moves = centre[:, dof] - centre[:, :6] @ np.linalg.solve(sole[:, :6], sole[:, dof])
    gives, ways = np.linalg.eigh(moves / stiffness @ moves.T)
    height = body.plan.subtree_com[root, 2] - body.plan.xanchor[joints[-1], 2]
    holds = height / (float(model.body_subtreemass[root]) * GRAVITY * gives[-1])
    if holds < 1.0:
        softest = int(np.argmax(np.square(ways[:, -1] @ moves) / stiffness))
        raise MotiondeckError(
            f"robot '{robot.name}' gives way under its weight on one leg, so it cannot walk: its servos are"
            f" {holds:.2g} times as stiff as they have to be; that of joint {model.joint(joints[softest]).name}, the"
            f" softest, holds {stiffness[softest]:.3g} N m/rad. Raise their gain (`kp` of a position actuator in an"
            " MJCF), or leave --walk; --root gantry carries it"
        )
