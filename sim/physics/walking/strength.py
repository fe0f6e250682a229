"""Strength: whether a robot has ankles, and servos that hold it on one leg, as every step needs.

The plan moves the centre of pressure p from behind the middle of the sole to the front of it, while the centre of mass
c is between the feet. The servos of that leg then need the torques

    tau = W J_c,z - J_p^T f,      f = W ((c - p) / c_z, 1)
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

import mujoco
import numpy as np

from motiondeck_base.errors import MotiondeckError
from sim.models.feet import Foot
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import path_to
from sim.models.servo_motor import strength
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import Robot

# An ankle is less than this share of the root's height above the sole; a knee is at half of it.
ANKLE = 0.3


def check_legs(robot: Robot, model: mujoco.MjModel, body: WholeBody, feet: tuple[Foot, ...], roll: float) -> None:
    """Refuses a robot that cannot stand on one leg.

    Args:
        robot: which.
        model: the robot with a free root.
        body: the solution in which the robot stands on both feet.
        feet: of the robot.
        roll: how far the centre of pressure goes from the middle of the sole, m.

    Raises:
        MotiondeckError: if it has no ankles, or a servo of its legs is too weak.
    """
    _check_ankles(robot, model, feet)
    plan, root = body.plan, int(model.jnt_bodyid[0])
    weight, centre = float(model.body_subtreemass[root]) * GRAVITY, plan.subtree_com[root]
    joints, dof = model.actuator_trnid[:, 0], robot.layout.dof
    most = strength(model)
    if robot.servo is not None:
        most = np.minimum(most, robot.servo.most)
    for number, foot in enumerate(feet):
        own = body.bodies[number]
        frame = plan.xmat[own].reshape(3, 3)
        sole = plan.xpos[own] + frame @ foot.sole
        leg = np.isin(model.dof_bodyid[dof], path_to(model, own)) & body.legs[dof]
        for ahead in (-roll, roll):
            arm = frame @ foot.axes[:, 0] * ahead
            lean = (centre - sole - arm) / (centre[2] - sole[2])
            needs = np.abs(weight * body.jacobian[14] - body.pushed(number, weight * lean, arm))[dof]
            short = np.where(leg, needs / most, 0.0)
            worst = int(np.argmax(short))
            if short[worst] > 1.0:
                raise MotiondeckError(
                    f"robot '{robot.name}' cannot stand on one leg, so it cannot walk: joint"
                    f" {model.joint(joints[worst]).name} needs {needs[worst]:.2g} N m and has {most[worst]:.2g}."
                    " Give it a stronger servo (`effort` in a URDF, `forcerange` in an MJCF, [servo] in the robot"
                    " file), or leave --walk; --root gantry carries it"
                )


def _check_ankles(robot: Robot, model: mujoco.MjModel, feet: tuple[Foot, ...]) -> None:
    rest = mujoco.MjData(model)
    robot.layout.place(robot.rest, rest.qpos)
    mujoco.mj_kinematics(model, rest)
    for foot in feet:
        own = int(model.body(foot.body).id)
        sole = rest.xpos[own] + rest.xmat[own].reshape(3, 3) @ foot.sole
        if rest.xpos[model.body_weldid[own], 2] - sole[2] > ANKLE * (rest.xpos[model.jnt_bodyid[0], 2] - sole[2]):
            raise MotiondeckError(
                f"robot '{robot.name}' has no ankle above '{foot.body}', so it cannot walk: leave --walk;"
                " --root gantry carries it"
            )
