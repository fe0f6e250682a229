"""Loads: joint torques, contacts and balance that a motion demands, by inverse dynamics instead of simulation.

At a tempo s all velocities are s times and all accelerations s^2 times those at tempo 1, so one pass gives the joint
torques of every tempo:

    tau(s) = gravity + s damping + s^2 inertia + sign(velocity) friction

With a free root the floor carries the body: forces within their friction cones on the lowest corners of the soles,
chosen to come closest to the force and moment that would hold the root.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import nnls

from controller.motion.rotations import Array, Flags
from sim.models.feet import Foot
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import below
from sim.models.surface import LowestPoint, Surface
from sim.physics.balance import convex_hull, margin
from sim.physics.played_motions import DT, PlayedMotion
from sim.robots.robot import Robot
from sim.robots.self_collision import SelfCollision
from sim.robots.training_files import velocities

# Height of a sole's corner above the lowest one, in heights of the root, below which the floor pushes it, as a robot
# settles onto its soles, and below which it counts for balance (fitted on every other motion of thesis15).
CONTACT, STANDS = 0.06, 0.03
_FRICTION = 0.7
_CONE = np.array([[_FRICTION, 0.0, 1.0], [-_FRICTION, 0.0, 1.0], [0.0, _FRICTION, 1.0], [0.0, -_FRICTION, 1.0]])
TOUCHES = 0.008  # the same below which a moving corner slides
_EVENLY = 1e-3  # weight of even forces beside that of the root's support


@dataclass(frozen=True)
class Loads:
    """Loads of T samples of a motion on J joints at tempo 1."""

    velocity: Array  # of the joints, shape (T, J), rad/s
    gravity: Array  # joint torques, shape (T, J), N m
    damping: Array  # joint torques, shape (T, J), N m
    inertia: Array  # joint torques, shape (T, J), N m
    friction: Array  # joint torques, shape (T, J), N m
    collision: Array  # depth of overlaps, shape (T,), m
    colliding: str  # the bodies that overlap most
    lowest: Array  # height of the lowest point, shape (T,), m
    slide: Array  # speed of touching soles along the ground, shape (T,), m/s
    support: tuple[Array, ...]  # support polygons, length T
    lies: Flags  # whether other bodies than the feet touch the ground, shape (T,)
    com: Array  # the centre of mass, shape (T, 3), m
    com_velocity: Array  # its velocity along the ground, shape (T, 2), m/s

    def torque(self, tempo: float = 1.0) -> Array:
        """The joint torques at a tempo, shape (T, J), N m."""
        drag = np.sign(self.velocity) * self.friction
        return self.gravity + tempo * self.damping + tempo**2 * self.inertia + drag

    def balance(self, tempo: float = 1.0) -> Array:
        """Margin of the capture point inside the support at a tempo, shape (T,), m; -inf for a robot without feet."""
        omega = np.sqrt(GRAVITY / np.maximum(self.com[:, 2], 1e-3))
        capture = self.com[:, :2] + tempo * self.com_velocity / omega[:, None]
        return np.array([margin(hull, point) for hull, point in zip(self.support, capture, strict=True)])


def loads_of(
    robot: Robot, played: PlayedMotion, *, free: bool, collisions: SelfCollision, feet: tuple[Foot, ...]
) -> Loads:
    """The loads of a played motion on a robot with these feet, carried by the floor if `free`, else by a gantry."""
    model, data = robot.model, mujoco.MjData(robot.model)
    qpos, qvel, qacc = _motion(robot, played)
    count = len(qpos)
    dof, lowest_point, surface = robot.layout.dof, LowestPoint(model), Surface.touching(model)
    soles = [body for foot in feet for body in below(model, model.body(foot.body).id)]
    rest = surface.part(np.setdiff1d(surface.body, soles))
    near = TOUCHES * robot.root_height
    gravity, inertia = np.empty((2, count, len(dof)))
    depth, lowest, slide = np.zeros(count), np.empty(count), np.zeros(count)
    places, touches = np.empty((count, 4 * len(feet), 2)), np.empty((count, 4 * len(feet)), dtype=bool)
    lies = np.zeros(count, dtype=bool)
    com, support, worst = np.empty((count, 3)), [], ("", 0.0)
    flags = model.opt.disableflags
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT.value
    try:
        for k in range(count):
            data.qpos[:] = qpos[k]
            torque = np.empty((2, model.nv))
            for which, (v, a) in enumerate(((0.0 * qvel[k], 0.0 * qacc[k]), (qvel[k], qacc[k]))):
                data.qvel[:], data.qacc[:] = v, a
                mujoco.mj_inverse(model, data)
                torque[which] = data.qfrc_inverse
            corners, jacobians = _corners(model, data, feet)
            on = _on_the_ground(corners, robot, CONTACT)
            damping = model.dof_damping * qvel[k]
            if free and on.any():
                torque = np.stack([_carried_by_the_floor(one, jacobians[on]) for one in torque])
            gravity[k], inertia[k] = torque[0, dof], (torque[1] - torque[0] - damping)[dof]
            com[k] = data.subtree_com[int(model.jnt_bodyid[0])]
            lowest[k] = lowest_point(data)
            heights = rest.positions(data)[:, 2] - rest.radius
            lies[k] = bool(np.any(heights < lowest[k] + near))
            support.append(convex_hull(corners[_on_the_ground(corners, robot, STANDS), :2]))
            places[k], touches[k] = corners[:, :2], _on_the_ground(corners, robot, TOUCHES)
            depth[k], pair = collisions(qpos[k])
            if depth[k] > worst[1]:
                worst = pair, depth[k]
    finally:
        model.opt.disableflags = flags
    moved = np.hypot(*np.moveaxis(np.diff(places, axis=0), 2, 0)) / DT
    slide[1:] = np.where(touches[1:] & touches[:-1], moved, 0.0).max(axis=1, initial=0.0)
    return Loads(
        velocity=qvel[:, dof],
        gravity=gravity,
        damping=(model.dof_damping * qvel)[:, dof],
        inertia=inertia,
        friction=np.broadcast_to(model.dof_frictionloss[dof], (count, len(dof))),
        collision=depth,
        colliding=worst[0],
        lowest=lowest,
        slide=slide,
        support=tuple(support),
        lies=lies,
        com=com,
        com_velocity=_rate(com[:, :2]),
    )


def _motion(robot: Robot, played: PlayedMotion) -> tuple[Array, Array, Array]:
    """Positions (T, nq), velocities and accelerations (T, nv) of a motion, clipped to the joints' ranges."""
    model = robot.model
    qpos = np.tile(model.qpos0, (len(played.targets), 1))  # joints that are not played stay there
    if robot.footing is not None:
        robot.footing.reset(DT)
    for k, pose in enumerate(played.poses):
        robot.place(np.clip(played.targets[k], robot.limits.lower, robot.limits.upper), pose, qpos[k])
    qvel = velocities(model, qpos, 1.0 / DT)
    return qpos, qvel, _rate(qvel)


def _rate(values: Array) -> Array:
    rate: Array = np.gradient(values, DT, axis=0)  # pyright: ignore[reportAssignmentType]
    return rate


def _corners(model: mujoco.MjModel, data: mujoco.MjData, feet: tuple[Foot, ...]) -> tuple[Array, Array]:
    """The corners of the soles (C, 3) and their Jacobians (C, 3, nv)."""
    points, jacobians = np.empty((4 * len(feet), 3)), np.empty((4 * len(feet), 3, model.nv))
    for k, foot in enumerate(feet):
        body = model.body(foot.body).id
        points[4 * k : 4 * k + 4] = data.xpos[body] + foot.corners @ data.xmat[body].reshape(3, 3).T
        for corner in range(4 * k, 4 * k + 4):
            mujoco.mj_jac(model, data, jacobians[corner], None, points[corner], body)
    return points, jacobians


def _on_the_ground(corners: Array, robot: Robot, share: float) -> Flags:
    """Which corners (C, 3) are within a share of the root's height of the lowest one."""
    return corners[:, 2] < corners[:, 2].min(initial=np.inf) + share * robot.root_height


def _carried_by_the_floor(torque: Array, jacobians: Array) -> Array:
    """Generalised forces (nv,) with the root's share taken over by forces on the corners (C, 3, nv) that touch."""
    ways = np.einsum("gx,cxv->cgv", _CONE, jacobians).reshape(-1, jacobians.shape[-1])
    matrix = np.concatenate([ways[:, :6].T, _EVENLY * np.eye(len(ways))])
    forces, _ = nnls(matrix, np.concatenate([torque[:6], np.zeros(len(ways))]))
    return torque - forces @ ways
