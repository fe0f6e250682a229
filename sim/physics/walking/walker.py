"""Walker: a free robot goes where the played motion goes, on its own feet.

Each tick: the footfalls of the motion become steps of the robot (`Gait`), these a course of the centre of pressure, and
this a planned capture point xi_p (`capture_point`). The next step compensates the error of the robot's own xi, and the
centre of mass is moved against the rest:

    c = c_p - ankle (xi - xi_p) - b                                                                              (6)

with the planned c_p and the lasting error b (16). `WholeBody` finds the posture, and the servos of the legs get a
feed-forward share of the torques that carry the weight W along the line from the centre of pressure p to the centre of
mass:

    tau = W J_c,z - J_p^T f,      f = W ((c_p - p - s) omega^2 / g, 1)                                           (7)

with the effect s of swinging legs (`leg_swing`). Other quick turns of the body are played softer (`momentum`).

All is planned on a plane where feet never slip, and the robot is seen from its standing feet: its place is not needed.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from controller.motion.rotations import (
    Array,
    between,
    conjugate,
    from_matrix,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    to_rotation_vector,
    yaw,
)
from motiondeck_base.errors import MotiondeckError
from sim.models.feet import Foot
from sim.models.gravity import GRAVITY
from sim.models.kinematic_tree import posed
from sim.physics.walking.capture_point import LastingError, follow, pendulum_rate, planned_capture_point, run_away
from sim.physics.walking.gait import WIDE, Gait
from sim.physics.walking.momentum import Momentum, leg_swing, legs_carry
from sim.physics.walking.preview import AHEAD, Preview, Travel
from sim.physics.walking.rolling import ROUNDED, from_flat
from sim.physics.walking.state_estimate import Estimate, ExactState, Sensors
from sim.physics.walking.steps import azimuth, highest, swing_path, wrapped
from sim.physics.walking.strength import check_legs
from sim.physics.walking.whole_body import UP, WholeBody, widest_stance
from sim.robots.robot import Robot

HEIGHT = 15.0  # weight of the root's height, 1/m
# Largest rise of the root, heights a second, beside the motion's own: under load the knee's servo would lag.
CLIMBS = 0.35
REACH = 0.8  # largest shift of the centre of mass by the ankles ahead and back, in half lengths of the sole
# Time constant of the error for ideal servos, s, which would shake with its noise; for others LATE times the latency,
# as a late error returns in the next ticks.
SMOOTHED, LATE = 0.03, 2.0
# The played trunk leans to a side by about this sine at most, and is turned from the heading by this much, rad. A robot
# without a waist turns its legs with the human's chest, which leans by 0.42 in the waltz; the human's pelvis by 0.15.
LEANS, TWISTS = 0.05, 0.1
LOST = 0.5  # error of the capture point from which a fall is certain, in heights of the root
TILT_FROM = 1.0 / 6.0  # first share of a swing in which the foot begins to compensate the tilt of the trunk
RIGHTS = 0.15  # decay of that compensation after landing, s: at once, the foot would leave the floor


class Walker:
    """Adjusts the played motion so that a free robot walks."""

    preview: Preview  # the motion to come
    travel: Travel  # distance of the robot
    falling: bool = False  # whether the error of the capture point is beyond LOST
    worst: float = 0.0  # its largest error, as a share of LOST

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        feet: Sequence[Foot],
        dt: float,
        gravity: Array | None = None,
        sensors: Sensors | None = None,
    ) -> None:
        """Args: a robot; its model with a free root on a solid floor; its feet; the tick, s; gravity; sensors.

        Gravity (3,), m/s^2, is in the frame of the floor, by default as in the model; without sensors the state is
        exact. MotiondeckError if the robot does not have two feet, or its legs cannot hold it, one at a time.
        """
        if len(feet) != 2:
            raise MotiondeckError(f"robot '{robot.name}' has {len(feet)} feet; only one that stands on two can walk")
        self._robot, self._model, self._dt, self._set = robot, model, dt, robot.walk
        self._root = int(model.jnt_bodyid[0])
        self._weight = float(model.body_subtreemass[self._root]) * GRAVITY
        self._body = WholeBody(robot, model, feet, dt, HEIGHT)
        self._motion = posed(model, robot.rest_qpos)
        self._toes = [foot.axes[:, 0] for foot in feet]
        self._flat = [from_matrix(foot.axes.T) for foot in feet]
        self._half = 0.5 * float(np.ptp((feet[0].corners @ feet[0].axes)[:, 0]))
        left = self._stance(self._motion)[0][:, 1]
        self._sides = np.sign(left - left.mean())
        stiffness = np.full(model.nv, np.inf)
        stiffness[robot.layout.dof] = np.maximum(model.actuator_gainprm[:, 0], 1e-9)
        self._fades = float(np.exp(-dt / RIGHTS))
        self._late = robot.servo.latency if robot.servo is not None else 0.0
        down = model.opt.gravity if gravity is None else gravity
        self._estimate = ExactState(model, down)
        if sensors is not None:
            self._estimate = Estimate(model, down, sensors, self._stands_on, dt)
            self._late += sensors.delay
        smoothed = max(SMOOTHED if robot.servo is None else 0.0, LATE * self._late)
        self._takes = min(1.0, dt / max(smoothed, dt))
        self._yields = self._set.feed_forward * self._body.legs / stiffness
        self._motion.qpos[2] -= self._stance(self._motion)[0][:, 2].mean()
        goal, height = self._motion.qpos.copy(), float(self._motion.qpos[2])
        goal[2] -= self._set.bend * height
        widths = self._set.width * height, WIDE * self._set.width * height
        self._widest = widest_stance(self._body, goal, self._flat, self._sides, *widths) / height
        self.start(self._motion)
        check_legs(robot, model, self._body, tuple(feet), self._half * self._set.roll)

    @property
    def own_steps(self) -> int:
        """Number of steps that are not the motion's."""
        return self._gait.recoveries

    def start(self, data: mujoco.MjData) -> None:
        """Puts the robot on both feet at its place and height in data."""
        model, plan, height = self._model, self._body.plan, float(data.qpos[2])
        self._estimate.start()
        self._height, self._now = height, 0.0
        self.preview, self.travel = Preview(height, self._dt), Travel(self._dt)
        plan.qpos[:] = data.qpos
        mujoco.mj_kinematics(model, plan)
        soles, yaws = self._stance(plan)
        facing = azimuth(rotate(multiply(plan.qpos[3:7], conjugate(model.qpos0[3:7])), np.array([1.0, 0.0, 0.0])))
        self._centre = soles[:, :2].mean(axis=0)
        self._pressure, self._astray = self._centre.copy(), 0.0
        self._off, self._lasting = np.zeros(2), LastingError(height, self._dt)
        self._righted = np.zeros((2, 3))
        self._gait = Gait(self._set, height, 2.0 * self._half, self._sides, self._widest * height)
        self._gait.start(self._centre, facing, yaws)
        goal = data.qpos.copy()
        goal[2] -= self._set.bend * height
        self._body.settle(goal, *self._feet(np.zeros(3)), self._centre)
        data.qpos[:] = plan.qpos
        self._high = float(plan.qpos[2])
        self._lower = height - self._high
        mujoco.mj_comPos(model, plan)
        self._omega = pendulum_rate(float(plan.subtree_com[self._root, 2]))
        carried = legs_carry(model, self._body, goal, *self._feet(np.zeros(3)), self._centre)
        self._carried = carried / self._weight
        self._momentum = Momentum(model, self._dt, AHEAD, self._omega, self._half)

    def adjust(self, data: mujoco.MjData, goal: Array, heading: float) -> None:
        """Replaces a goal (nq,) of the played motion by the walking posture, for the robot's state and heading, rad."""
        gait, omega = self._gait, self._omega
        self._now += self._dt
        self._momentum.add(goal)
        self._motion.qpos[:] = goal
        mujoco.mj_kinematics(self._model, self._motion)
        self.preview.add(goal, heading, *self._stance(self._motion), self._pitches(self._motion))
        seen = self._estimate.see(data, gait.standing)
        soles, yaws = self._stance(seen)
        soles -= self._from_flat(yaws, self._pitches(seen))
        ended = gait.advance(self._now, self.preview.footfalls.swings, AHEAD)
        if ended is not None:
            self.preview.footfalls.forget(ended)
            # The plan continues from the foot's real landing place, seen from the other foot.
            foot, other = ended.foot, 1 - ended.foot
            turn = float(wrapped(gait.yaws[other] - yaws[other]))
            gait.places[foot] = gait.places[other] + _turning(turn) @ (soles[foot] - soles[other])[:2]
            gait.yaws[foot] += float(wrapped(yaws[foot] + turn - gait.yaws[foot]))
        capture, tilt = self._measure(seen, soles, yaws)
        times, knots = gait.course(self._now)
        planned = planned_capture_point(times, knots, self._now, omega)
        shift, along, arm = leg_swing(self._now, omega, self._carried, gait)
        wanted = planned[:2] + _turning(self._astray) @ self._momentum.shift + shift
        effect = float(planned[2]) + along
        wanted = wanted + effect * gait.catch(self._now, capture - wanted, effect)
        gait.recover(self._now, capture - wanted, capture)
        off = float(np.hypot(*(capture - wanted))) / (LOST * self._height)
        self.falling, self.worst = off > 1.0, max(self.worst, off)
        self._centre = follow(self._centre, wanted, self._dt, omega)
        wanted_posture = self.preview.goal.copy()
        self._momentum.soften(wanted_posture)
        high, before = self.preview.height - self._lower, self._high
        self._high = wanted_posture[2] = high
        rise = CLIMBS * self._height * self._dt + max(high - before, 0.0)
        self._astray = gait.turn(self._now, self.preview.heading)
        trunk = steady_trunk(wanted_posture[3:7], self._model.qpos0[3:7], self.preview.heading)
        wanted_posture[3:7] = multiply(yaw(self._astray), trunk)
        self._body.step(wanted_posture, *self._feet(tilt), self._centre + self._ankles(capture - wanted), rise)
        goal[:] = self._body.plan.qpos
        self._pressure = np.array([np.interp(self._now, times, knots[:, axis]) for axis in range(2)])
        self._carry(goal, self._pressure, arm)
        self.travel.add(data.qpos[:2])

    def _measure(self, data: mujoco.MjData, soles: Array, yaws: Array) -> tuple[Array, Array]:
        """The capture point in the plan's plane, (2,), m, and the trunk's tilt against the plan, (3,), rad."""
        gait, standing = self._gait, self._gait.standing
        turns = gait.yaws - yaws
        # Around half a turn, one foot may be just before and the other just after it.
        turn = float(turns[0] + standing @ wrapped(turns - turns[0]))
        turning, omega = _turning(turn), self._omega
        gait.slipped = turn
        centre = standing @ gait.places + turning @ (data.subtree_com[self._root] - standing @ soles)[:2]
        capture = centre + turning @ data.subtree_linvel[self._root, :2] / omega
        # From the measurement until the next target arrives.
        capture = run_away(capture, self._pressure, self._late, omega)
        trunk = multiply(yaw(turn), data.qpos[3:7])
        tilt = to_rotation_vector(multiply(trunk, conjugate(self._body.plan.qpos[3:7])))
        return capture, tilt * (1.0, 1.0, 0.0)

    def _ankles(self, off: Array) -> Array:
        """The shift of the centre of mass, (2,), m, against an error of the capture point: (6)."""
        heading = self.preview.heading + self._astray
        turning = _turning(heading)
        self._off += self._takes * (off - self._off)
        ahead, aside = -self._set.ankle * (turning.T @ self._off)
        far = float(np.hypot(ahead / REACH, aside / self._set.lean)) / self._half
        # What lasts is not limited: it brings the weight back over the middle of the sole.
        lasting = self._lasting.learn(turning.T @ off, self._gait.standing)
        return turning @ (np.array([ahead, aside]) / max(far, 1.0) - lasting)

    def _feet(self, tilt: Array) -> tuple[list[Array], list[Array]]:
        """Goals of the soles and rotations of the feet; the swinging foot is raised against the trunk's tilt."""
        # It is not turned: a sole that lands flat under a tilted trunk keeps it tilted, step after step.
        gait, step = self._gait, self._gait.step
        places, yaws = [np.array([*place, 0.0]) for place in gait.places], gait.yaws.copy()
        if step is not None:
            start, angle, share = gait.swing(self._now)
            along, high = swing_path(share)
            yaws[step.foot] = angle + along * float(wrapped(np.array(step.yaw - angle)))
            lift = self._height * highest(self._set.lift, step.end - step.start)
            place = np.array([*(start + along * (step.place - start)), lift * high])
            arm, back = place - places[1 - step.foot], -self._set.upright * min(1.0, share / TILT_FROM) * tilt
            places[step.foot] = place
            self._righted[step.foot] = rotate(from_rotation_vector(back), arm) - arm
        self._rolled = self._from_flat(yaws, gait.rolling.pitches)
        pitched = from_rotation_vector(np.outer(gait.rolling.pitches, (0.0, 1.0, 0.0)))
        turns = [multiply(multiply(yaw(yaws[foot]), pitched[foot]), self._flat[foot]) for foot in range(2)]
        places = [place + moved for place, moved in zip(places, self._righted + self._rolled, strict=True)]
        # What has landed comes back to the plan little by little.
        self._righted = self._fades * self._righted
        return places, turns

    def _carry(self, goal: Array, pressure: Array, arm: Array) -> None:
        """Adds the yielding of the legs' servos under the weight and the swing of the legs to a goal: (7)."""
        gait, standing = self._gait, self._gait.standing
        lean = self._omega**2 / GRAVITY * (self._centre - pressure - arm)
        force = self._weight * np.array([*lean, 1.0])
        torque = self._weight * self._body.jacobian[14]
        if gait.step is None:
            apart = gait.places[1] - gait.places[0]
            share = min(max(float((pressure - gait.places[0]) @ apart / (apart @ apart)), 0.0), 1.0)
            standing = np.array([1.0 - share, share])
        for foot in np.flatnonzero(standing):
            arm = np.array([*(pressure - gait.places[foot]), 0.0]) if gait.step is not None else np.zeros(3)
            arm = arm - self._rolled[foot]
            torque = torque - standing[foot] * self._body.pushed(int(foot), force, arm)
        mujoco.mj_integratePos(self._model, goal, self._yields * torque, 1.0)

    def _stance(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Middles of the soles, shape (2, 3), m, and their yaws, shape (2,), rad."""
        soles, yaws = np.empty((2, 3)), np.empty(2)
        for foot, body in enumerate(self._body.bodies):
            soles[foot] = self._body.sole(data, foot)
            yaws[foot] = azimuth(data.xmat[body].reshape(3, 3) @ self._toes[foot])
        return soles, yaws

    def _pitches(self, data: mujoco.MjData) -> Array:
        """Pitches of the soles, toes down, shape (2,), rad."""
        feet = zip(self._body.bodies, self._toes, strict=True)
        toes = [data.xmat[body].reshape(3, 3)[2] @ ahead for body, ahead in feet]
        return -np.arcsin(np.clip(toes, -1.0, 1.0))

    def _from_flat(self, yaws: Array, pitches: Array) -> Array:
        """Displacements of the middles of pitched soles from flat ones, shape (2, 3), m."""
        shifts = [from_flat(float(pitch), self._half) for pitch in pitches]
        return np.array([(x * np.cos(yaw), x * np.sin(yaw), up) for (x, up), yaw in zip(shifts, yaws, strict=True)])

    def _stands_on(self, data: mujoco.MjData, foot: int) -> tuple[Array, int]:
        """The middle of the sole or of its standing edge, shape (3,), m, and the body of the foot."""
        sole, body = self._body.sole(data, foot), self._body.bodies[foot]
        edge = self._half * min(max(float(self._pitches(data)[foot]) / ROUNDED, -1.0), 1.0)
        return sole + data.xmat[body].reshape(3, 3) @ (edge * self._toes[foot]), body


def steady_trunk(trunk: Array, upright: Array, heading: float) -> Array:
    """The rotation of a trunk (4,) no farther from upright (4,) than LEANS to a side and TWISTS from a heading, rad."""
    turned = multiply(trunk, conjugate(upright))
    off = float(wrapped(2.0 * np.arctan2(turned[3:], turned[:1]) - heading)[0])
    up, left = rotate(turned, UP), np.array([-np.sin(heading), np.cos(heading), 0.0])
    aside = float(up @ left)
    allowed = normalise(up + (min(max(aside, -LEANS), LEANS) - aside) * left)
    back = min(max(off, -TWISTS), TWISTS) - off
    return multiply(multiply(yaw(back), between(up, allowed)), trunk)


def _turning(angle: float) -> Array:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])
