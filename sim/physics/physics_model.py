"""The simulated model of a robot: on a gantry, fixed in place, or free on a solid floor."""

from collections.abc import Callable

import mujoco
import numpy as np

from controller.motion.rotations import Array, from_matrix
from motiondeck_base.errors import MotiondeckError
from sim.models.feet import Foot, find_feet
from sim.models.kinematic_tree import below
from sim.models.overlaps import near_bodies
from sim.models.scenery import FLOOR, GANTRY
from sim.robots.robot import Robot

ROOTS = ("gantry", "fixed", "free")  # carried along, held in place, let go

FLOOR_BIT = 1 << 20  # a separate bit: contacts between the model's own bodies stay as the model has them
FRICTION = (1.0, 0.005, 0.0001)  # sliding (rubber on wood), torsional and rolling friction, the last two in m
# Thickness, m, and hidden group of the sole under a foot of rounded solids.
_SOLE = 0.004
_HIDDEN = 4
_ITERATIONS = 60  # of the solver: contacts need more than a robot that hangs in the air


def feet_of(robot: Robot) -> tuple[Foot, ...]:
    """The feet of a robot, found where it stands in its rest pose."""
    return find_feet(robot.model, robot.rest_qpos)


def check_root(root: str, *, balance: bool = False, walk: bool = False) -> None:
    """Refuses, by MotiondeckError, a root outside ROOTS, balance or walking without a free root, and both at once."""
    if root not in ROOTS:
        raise MotiondeckError(f"root '{root}': choose gantry (carried along), fixed (held in place) or free")
    if balance and root != "free":
        raise MotiondeckError(f"a robot whose root is {root} need not balance: give --root free with --balance")
    if walk and (root != "free" or balance):
        what = "balances by itself: leave --balance" if balance else f"needs a free root, not {root}: give --root free"
        raise MotiondeckError(f"a robot that walks {what}")


Alteration = Callable[[mujoco.MjSpec], None]  # changes a model that is ready to be compiled


def physics_model(robot: Robot, root: str = "gantry", alter: Alteration | None = None) -> mujoco.MjModel:
    """The model to simulate a robot on; the robot's own is not changed.

    With a free root the floor is solid for all bodies that the robot's model lets collide, or for all where it lets
    none. A foot of rounded solids gets a flat sole in place of them and of the toes. Neighbours, and bodies that
    overlap in the rest pose, do not collide. `root` is one of ROOTS, or a MotiondeckError is raised; `alter` changes
    the world in ways that the robot's files do not know.
    """
    check_root(root)
    spec = robot.spec.copy()
    spec.equality(GANTRY).active = root != "free"
    for pair in near_bodies(robot.model, robot.rest_qpos):
        a, b = (robot.model.body(body).name for body in pair)
        if a and b:
            spec.add_exclude(bodyname1=a, bodyname2=b)
    if root == "free":
        _make_solid(spec, robot)
    if alter is not None:
        alter(spec)
    return spec.compile()


def lead_of(model: mujoco.MjModel) -> Array:
    """Lead of each servo's control before its target, kv / kp, shape (J,), s."""
    # Position servos: force = gain * ctrl + bias . (1, length, velocity), with gain = kp and bias[2] = -kv.
    gain = model.actuator_gainprm[:, 0]
    return -model.actuator_biasprm[:, 2] / np.where(gain > 0.0, gain, 1.0)


def _make_solid(spec: mujoco.MjSpec, robot: Robot) -> None:
    spec.option.iterations = _ITERATIONS
    model = robot.model
    # Read from the compiled model: in the spec a geom may have it from its class.
    touching = {geom for geom in range(model.ngeom) if model.geom_contype[geom] or model.geom_conaffinity[geom]}
    feet = feet_of(robot)
    # With their toes: a foot would wobble on what is round, and tip over toes that are bent.
    shod = {body for foot in feet if foot.round for body in below(model, int(model.body(foot.body).id))}
    for geom in spec.geoms:
        if geom.name == FLOOR:
            geom.contype, geom.conaffinity, geom.friction = FLOOR_BIT, 0, FRICTION
        elif (not touching or geom.id in touching) and int(model.geom_bodyid[geom.id]) not in shod:
            geom.conaffinity = int(model.geom_conaffinity[geom.id]) | FLOOR_BIT
            geom.friction = FRICTION
    for foot in feet:
        if foot.round:
            long, wide = (float(np.linalg.norm(foot.corners[end] - foot.corners[0])) for end in (1, 3))
            sole = spec.body(foot.body).add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, mass=0.0, group=_HIDDEN)
            sole.size, sole.pos = [0.5 * long, 0.5 * wide, _SOLE], foot.sole + _SOLE * foot.axes[:, 2]
            sole.quat, sole.friction = from_matrix(foot.axes), FRICTION
            sole.contype, sole.conaffinity = 0, FLOOR_BIT
