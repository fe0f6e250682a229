"""Physics playback: an output that simulates the robot with its servos and masses."""

from collections.abc import Callable, Mapping
from copy import copy
from math import isfinite, sqrt

import mujoco
import numpy as np

from controller.deck.interfaces import Side
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError
from sim.models.gravity import GRAVITY
from sim.models.surface import LowestPoint
from sim.physics.balance import Balance
from sim.physics.feedback import Feedback, PlanFollower
from sim.physics.physics_model import Alteration, check_root, feet_of, lead_of, physics_model
from sim.physics.recovery import Phase, Recovery, has_fallen
from sim.physics.simulated_servos import Servos
from sim.physics.walking.preview import AHEAD
from sim.physics.walking.state_estimate import Sensors
from sim.physics.walking.walker import Walker
from sim.robots.robot import Robot

# MuJoCo resets itself when its state becomes invalid, and counts a warning.
_BROKEN = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)  # and BADQVEL

STANDS_AGAIN = 1.0  # time upright, s, after which a fallen robot counts as standing
# Duration of a push, s, and its direction by the side it comes from, rad to the left of the heading.
PUSH_LASTS = 0.1
PUSHES_TOWARDS: dict[Side, float] = {"back": 0.0, "right": 0.5 * np.pi, "front": np.pi, "left": -0.5 * np.pi}


class PhysicsPlayback:
    """Drives the robot's servos towards the targets, with its root on a gantry, fixed, or free on a solid floor.

    The torque of a servo is  kp (target - position) + kv (rate of target - velocity): without the feed-forward of the
    rate a motion would lag by kv / kp. On a ball joint "target - position" is the rotation between both. Servos with
    data keep to their torque-speed line and current limit.
    """

    name = "physics"
    step = staticmethod(mujoco.mj_step)  # advances the simulation by one timestep; override it to observe each

    def __init__(
        self,
        robot: Robot,
        dt: float,
        root: str = "gantry",
        balance: bool = False,
        walk: bool = False,
        compiled: mujoco.MjModel | None = None,
        *,
        sensors: Sensors | None = None,
        alter: Alteration | None = None,
        guard: bool = True,
        feedback: Feedback | None = None,
    ) -> None:
        """Starts in the rest pose; a write takes dt seconds, rounded to whole timesteps.

        Args:
            balance: whether a free robot keeps its feet in place and its centre of mass above them.
            walk: whether a free robot follows the motion on its own feet.
            compiled: the `physics_model` of this robot with this root, if there is one; it is not changed.
            sensors: of a walking robot; None for the exact state.
            alter: changes to the world that robot and controller do not know.
            feedback: of the motion that is played first, for a free robot that neither balances nor walks.
            guard: whether a robot that balances or walks protects itself in a fall, and gets up if it can.

        MotiondeckError for a root that `physics_model` lacks, for balance or walking without a free root or two feet,
        or for both.
        """
        check_root(root, balance=balance, walk=walk)
        self._robot, self._root = robot, root
        self.model = model = physics_model(robot, root, alter) if compiled is None else copy(compiled)
        self.data = mujoco.MjData(model)
        self.qpos = self.data.qpos  # shape (nq,), which the next write overwrites
        self._warnings = self.data.warning.number[_BROKEN]
        self._steps = max(1, round(dt / model.opt.timestep))
        self._dt = self._steps * model.opt.timestep
        self._balance = Balance(robot, model, self._dt) if balance else None
        own = model if alter is None else physics_model(robot, root)
        gravity = model.opt.gravity
        self._recovery = Recovery(robot, model, self._dt) if guard and (balance or walk) else None
        self._walker = Walker(robot, own, feet_of(robot), self._dt, gravity, sensors) if walk else None
        self._follower = PlanFollower(robot, feedback, lambda: self.clock()) if feedback is not None else None
        self._legs = self._balance or self._walker or self._follower
        self.behind_s = AHEAD if walk else 0.0  # delay of the body
        motors = robot.motors
        self._servos = Servos(motors, model, self.data, self._dt) if motors is not None else None
        late = round(robot.servo.latency / self._dt) * self._dt if robot.servo is not None else 0.0
        self.lag = np.full(len(robot.rest), late) if late else None  # latency of each joint's servo, shape (J,), s
        self._lead = lead_of(model)
        # `wanted` is the goal of the last write, shape (nq,), with the place of a free root along the ground.
        self._goal, self._goal_before, self.wanted = (model.qpos0.copy() for _ in range(3))
        self.placed = np.empty(7)  # the commanded root of the last write, position (m) and quaternion
        self._straight = model.qpos0.copy()
        robot.layout.place(np.zeros(model.nu), self._straight)
        self._turned, self._error, self._ahead = np.empty(model.nv), np.empty(model.nv), np.empty(model.nu)
        self._measured, self._played = robot.rest.copy(), robot.rest.copy()
        self._started = False
        self._writes = self._faults = 0
        self.clock: Callable[[], float] = lambda: self._writes * self._dt  # time of falls, s
        self.holds: Callable[[], bool] = lambda: False  # whether a fallen robot stays down; else it gets up if it can
        self.fell_s: float | None = None  # time of a free robot's first fall
        self.fallen = False  # whether a free robot is down, until it has stood for STANDS_AGAIN
        self._stands_for = 0  # writes since a fallen robot was seen to stand
        self.near_falls: list[float] = []  # times at which a fall became certain, s
        self._lost = False
        self._gone = 0.0, 0.0  # how far motion and robot had gone before it last got up, m
        self._heading = 0.0  # of the motion, rad
        self._pushed = 0  # ticks for which the push under way still lasts
        self._square_sum, self._worst = 0.0, 0.0
        robot.layout.place(robot.rest, self.data.qpos)
        self.placed[:] = self.data.qpos[:7]
        mujoco.mj_forward(model, self.data)
        # By default MuJoCo writes each warning to a file in the working directory; a loop must not.
        mujoco.set_mju_user_warning(lambda _: None)

    def attach(self, clock: Callable[[], float], holds: Callable[[], bool]) -> None:
        """Connects the clock of its events, s, and whether a fallen robot is to stay as it lies."""
        self.clock, self.holds = clock, holds

    def write(self, targets: Array, pose: Pose) -> None:
        """Advances the simulation by dt towards targets (J,), rad, and the root of the pose.

        The first write places the robot. A state that is not finite is placed anew and counted.
        """
        robot, data = self._robot, self.data
        self._heading = float(pose.heading)
        self._goal, self._goal_before = self._goal_before, self._goal
        robot.place(targets, pose, self._goal)
        starting = not self._started
        if starting:
            self._put_in_place()
        if self._root == "gantry":
            data.mocap_pos[0] = self._goal[:3]
            data.mocap_quat[0] = self._goal[3:7]
        self.placed[:] = self._goal[:7]
        self.wanted[:] = self._goal
        if self._legs is not None:
            if self._recovery is not None and self._recovery.stands:
                self._gone = self.travel or (0.0, 0.0)
                here = data.qpos.copy()
                self._legs.start(data)
                data.qpos[:] = here
            self._legs.adjust(data, self._goal, self._heading)
            if self._follower is not None and self._follower.plays:
                starting = True  # its controls have their lead already
                self.placed[:] = self._goal[:7]
            if starting:
                self._goal_before[:] = self._goal  # what it adds at once is not a movement
            self._recover(self._legs)
        servos = self._servos
        if servos is not None:
            self._goal[:] = servos.delayed(self._goal)
        mujoco.mj_differentiatePos(self.model, self._turned, self._dt, self._goal_before, self._goal)
        layout, ahead = robot.layout, self._ahead
        np.multiply(self._lead, self._turned[layout.dof], ahead)
        ahead[layout.hinge] += self._goal[layout.hinge_qpos]
        for _ in range(self._steps):
            data.ctrl[:] = self._ahead
            if len(balls := layout.ball):
                # MuJoCo subtracts the joint's rotation vector from the control; the difference is to be the error.
                mujoco.mj_differentiatePos(self.model, self._turned, 1.0, self._straight, data.qpos)
                mujoco.mj_differentiatePos(self.model, self._error, 1.0, data.qpos, self._goal)
                data.ctrl[balls] += (self._turned + self._error)[layout.dof[balls]]
            if servos is None:
                self.step(self.model, data)
            else:
                servos.step(self.step)
        if self._pushed > 0:
            self._pushed -= 1
            if self._pushed == 0:
                self.push(np.zeros(3))
        qpos = self.qpos
        if not isfinite(qpos.dot(qpos)) or self._warnings.tobytes().strip(b"\0"):
            self._faults += 1
            robot.place(targets, pose, self._goal)
            self._put_in_place()
            if self._legs is not None:
                self._legs.adjust(data, self._goal, self._heading)  # a walker has forgotten what it was to do
        robot.layout.read(qpos, near=targets, out=self._measured)
        root = self.placed
        if self._walker is not None:
            # The body is delayed, and so is its goal.
            root = self._walker.preview.goal[:7]
            targets = self._played
            robot.layout.read(self._walker.preview.goal, near=self._measured, out=targets)
            self.wanted[:] = self._walker.preview.goal
        error = targets - self._measured
        self._writes += 1
        self._square_sum += float(error @ error)
        self._worst = max(self._worst, float(np.abs(error).max(initial=0.0)))
        if self._root == "free":
            self.wanted[:2] = data.qpos[:2]
            gave_up = self._recovery is not None and self._recovery.gave_up
            if gave_up or has_fallen(data.qpos, root, self.model.qpos0[3:7]):
                self.fallen, self._stands_for = True, 0
                self.fell_s = self.clock() if self.fell_s is None else self.fell_s
            elif self.fallen:
                self._stands_for += 1
                self.fallen = self._stands_for * self._dt < STANDS_AGAIN

    def _recover(self, legs: Balance | Walker | PlanFollower) -> None:
        recovery = self._recovery
        if recovery is None:
            if legs.falling and not self._lost and not self.fallen:
                self.near_falls.append(self.clock())
            self._lost = legs.falling
            return
        before = recovery.phase
        recovery.adjust(self.data, self._goal_before, self._goal, falling=legs.falling, held=self.holds())
        if recovery.phase is not before:
            self._lead = lead_of(self.model)
            if recovery.phase is Phase.FALLS:
                self.near_falls.append(self.clock())

    @property
    def incidents(self) -> list[str]:
        """Messages about near falls so far."""
        guarded = ": it tucks itself in and goes soft" if self._recovery is not None else ""
        return ["the robot is about to fall" + guarded] * len(self.near_falls)

    def measured(self) -> Array:
        """The joint positions (J,), rad, in the simulation."""
        return self._measured

    @property
    def travel(self) -> tuple[float, float] | None:
        """Distances of the motion and of a walking robot along the ground, m; None without walking."""
        if self._walker is None or not self._started:
            return None
        asked, walked = self._gone
        return asked + self._walker.preview.travel.metres, walked + self._walker.travel.metres

    def contact_forces(self, out: Array) -> None:
        """Writes point (m) and force (N) of the floor's contact with each body part into out (N, 6), in the world.

        Parts beyond N are left out; rows without a part are NaN.
        """
        model, data = self.model, self.data
        out[:] = np.nan
        parts: dict[int, int] = {}
        force = np.empty(6)
        for index in range(data.ncon):
            contact = data.contact[index]
            first, second = (int(model.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
            if 0 not in (first, second):
                continue
            row = parts.setdefault(first or second, len(parts))
            if row >= len(out):
                continue
            mujoco.mj_contactForce(model, data, index, force)
            # The frame's x axis, and the force, go from the first geom to the second.
            pushed = (-1.0 if second == 0 else 1.0) * force[:3] @ contact.frame.reshape(3, 3)
            if np.isnan(out[row, 0]):
                out[row] = 0.0
            weight = max(float(np.linalg.norm(pushed)), 1e-9)
            total = out[row, 3:] + pushed
            # The point is the mean of the contacts, weighted by force.
            sums = float(np.linalg.norm(out[row, 3:]))
            out[row, :3] = (sums * out[row, :3] + weight * contact.pos) / (sums + weight)
            out[row, 3:] = total

    def push(self, force: Array) -> None:
        """Pushes the root with a force (3,), N, in the world, until the next call."""
        self.data.xfrc_applied[int(self.model.jnt_bodyid[0]), :3] = force

    def push_from(self, side: Side, impulse: float, towards: float | None = None) -> float:
        """Pushes the root for PUSH_LASTS seconds, level, from a side of the heading; MotiondeckError if it is fixed.

        `towards` is a direction in the world, rad from x to y, in place of a side. Returns the impulse, N s, which is
        that of `usual_push` for 0.
        """
        if self._root == "fixed":
            raise MotiondeckError("a fixed root cannot be pushed: play with --root gantry or free")
        footing = self._robot.footing
        heading = footing.heading(self._heading) if footing is not None else self._heading
        away = heading + PUSHES_TOWARDS[side] if towards is None else towards
        impulse = impulse or usual_push(self._robot.model)
        self.push(push_force(impulse, away))
        self._pushed = round(PUSH_LASTS / self._dt)
        return impulse

    def report(self) -> Mapping[str, object]:
        """Tracking errors of the servos, falls and steps."""
        samples = max(self._writes, 1) * len(self._measured)
        said: dict[str, object] = {
            "kind": "physics",
            "robot": self._robot.name,
            "root": self._root,
            "joints": len(self._measured),
            "writes": self._writes,
            "timestep_s": self.model.opt.timestep,
            "tracking_rmse_rad": float(np.sqrt(self._square_sum / samples)),
            "tracking_worst_rad": self._worst,
            "faults": self._faults,
        }
        if self._root == "free":
            said |= {"balance": self._balance is not None, "fell_s": self.fell_s}
            said["feedback"] = self._follower is not None
        if self._legs is not None:
            said["near_falls_s"] = self.near_falls
            said["got_up"] = self._recovery.rises if self._recovery is not None else 0
        if self._walker is not None and self.travel is not None:
            said["travel"] = dict(zip(("asked_m", "walked_m"), self.travel, strict=True))
            said |= {"capture_point_off": self._walker.worst, "own_steps": self._walker.own_steps}
        if self._servos is not None:
            said["servos"] = self._servos.report()
        return said

    def close(self) -> None:
        """Does nothing."""

    def _put_in_place(self) -> None:
        """Starts at the goal, at rest; a free robot with its lowest point on the floor."""
        mujoco.mj_resetData(self.model, self.data)
        self.qpos[:] = self._goal
        mujoco.mj_kinematics(self.model, self.data)
        if self._root == "free":
            self.qpos[2] -= LowestPoint(self.model)(self.data)
        if self._root == "fixed":
            self.data.mocap_pos[0] = self._goal[:3]
            self.data.mocap_quat[0] = self._goal[3:7]
        if self._legs is not None:
            self._legs.start(self.data)
        if self._recovery is not None:
            self._recovery.start()
            self._lead = lead_of(self.model)
        self._goal_before[:] = self.data.qpos
        if self._servos is not None:
            self._servos.start()
        self._started = True
        mujoco.mj_forward(self.model, self.data)


def usual_push(model: mujoco.MjModel) -> float:
    """0.05 m sqrt(g h), N s, which demands a step, with the root's height h: 0.24 for servo20, 16 for the mannequin."""
    height = float(model.body(int(model.jnt_bodyid[0])).pos[2])
    return 0.05 * float(model.body_mass.sum()) * sqrt(GRAVITY * height)


def push_force(impulse: float, towards: float) -> Array:
    """The force (3,), N, of a push with an impulse, N s, in a direction on the ground, rad."""
    return impulse / PUSH_LASTS * np.array([np.cos(towards), np.sin(towards), 0.0])
