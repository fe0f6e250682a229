"""Physics playback: an output that plays joint targets on a MuJoCo robot with its servos and masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import Side
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError
from sim.models.surface import LowestPoint
from sim.physics.balance import Balance
from sim.physics.contact_forces import contact_forces
from sim.physics.physics_model import Alteration, check_root, feet_of, lead_of, physics_model
from sim.physics.pushes import PUSH_LASTS, PUSHES_TOWARDS, push_force, usual_push
from sim.physics.recovery import Phase, Recovery, has_fallen
from sim.physics.simulated_servos import Servos
from sim.physics.walking.preview import AHEAD
from sim.physics.walking.senses import Sensors
from sim.physics.walking.walker import Walker
from sim.robots.robot import Robot

# MuJoCo resets itself when its state becomes invalid, and counts a warning.
_BROKEN = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)

STANDS_AGAIN = 1.0
"""s that a fallen robot must be upright before it counts as standing."""


class PhysicsPlayback:
    """Drives the robot's servos towards the targets, with its root on a gantry, fixed, or free on a solid floor.

    A servo pushes with  kp (target - position) + kv (rate of target - velocity): the rate is fed forward, or a motion
    would trail by kv / kp. On a ball joint "target - position" is the rotation from the one to the other. Where the
    robot's servos are known they push no harder than their torque-speed line and their current allow.

    Attributes:
        name: "physics".
        data: MuJoCo's state.
        model: the model of that state, apart from the robot's own.
        placed: the commanded root of the last write, position (m) and quaternion, shape (7,).
        wanted: where it was to be after the last write, shape (nq,); a free root where it is along the ground.
        clock: the time at which falls are noted, s; by default since the first write.
        holds: whether a robot that has fallen is to stay as it lies; by default it gets up where it can.
        near_falls: when a robot that walks or balances was about to fall, s.
        fell_s: when a free robot fell first, s; None if it never has.
        fallen: whether a free robot has fallen and not stood again for a second.
        behind_s: how far the body is behind what is written, s.
    """

    name = "physics"
    step = staticmethod(mujoco.mj_step)
    """Advances the simulation by one of its own steps; who wants to see each of them overrides it."""

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
    ) -> None:
        """Rests the robot.

        Args:
            robot: the one to drive.
            dt: how much time passes with each write, s; rounded to whole steps of the simulation.
            root: "gantry" carries the root along, "fixed" holds it in place, "free" lets it go.
            balance: whether a free robot keeps its feet where they are and its centre of mass above them.
            walk: whether a free robot goes where the motion goes, on its own feet.
            compiled: the `physics_model` of this robot with this root, to compile none; it is not changed.
            sensors: what a robot that walks knows itself by; None if it knows its state exactly.
            alter: what is different in the world from what the robot knows of itself and of the floor.
            guard: whether one that balances or walks protects itself when it falls, and gets up where it can.

        Raises:
            MotiondeckError: if root is another word, or balance or walking is asked of a robot that is not free or
                lacks two feet, or both are asked.
        """
        check_root(root, balance=balance, walk=walk)
        self._robot, self._root = robot, root
        self.model = model = physics_model(robot, root, alter) if compiled is None else copy(compiled)
        self.data = mujoco.MjData(model)
        self._warnings = [self.data.warning[kind] for kind in _BROKEN]
        self._steps = max(1, round(dt / model.opt.timestep))
        self._dt = self._steps * model.opt.timestep
        self._balance = Balance(robot, model, self._dt) if balance else None
        own = model if alter is None else physics_model(robot, root)
        gravity = model.opt.gravity
        self._recovery = Recovery(robot, model, self._dt) if guard and (balance or walk) else None
        self._walker = Walker(robot, own, feet_of(robot), self._dt, gravity, sensors) if walk else None
        self._legs = self._balance or self._walker
        self.behind_s = AHEAD if walk else 0.0
        self._servos = Servos(robot.servo, model, self._dt) if robot.servo is not None else None
        self._lead = lead_of(model)
        self._goal, self._goal_before, self.wanted = (model.qpos0.copy() for _ in range(3))
        self.placed = np.empty(7)
        self._straight = model.qpos0.copy()
        robot.layout.place(np.zeros(model.nu), self._straight)
        self._turned, self._error, self._ahead = np.empty(model.nv), np.empty(model.nv), np.empty(model.nu)
        self._measured, self._played = robot.rest.copy(), robot.rest.copy()
        self._started = False
        self._writes = self._faults = 0
        self.clock: Callable[[], float] = lambda: self._writes * self._dt
        self.holds: Callable[[], bool] = lambda: False
        self.fell_s: float | None = None
        self.fallen = False
        self._stands_for = 0  # writes since a fallen robot was seen to stand
        self.near_falls: list[float] = []
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

    @property
    def qpos(self) -> Array:
        """Where the robot is, shape (nq,): MuJoCo's own array, so copy what you keep."""
        return self.data.qpos

    def attach(self, clock: Callable[[], float], holds: Callable[[], bool]) -> None:
        """Connects the clock of its events, s, and whether a fallen robot is to stay as it lies."""
        self.clock, self.holds = clock, holds

    def write(self, targets: Array, pose: Pose) -> None:
        """Advances the simulation by dt towards targets (J,), rad, and the root of the pose.

        The first write puts the robot in place. A state that is no longer finite is put in place anew and counted.
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
                self._stand_again(self._legs)
            self._legs.adjust(data, self._goal, self._heading)
            if starting:
                self._goal_before[:] = self._goal  # what it adds at once is not a movement
            self._recover()
        if self._servos is not None:
            self._goal[:] = self._servos.delayed(self._goal)
        self._aim()
        for _ in range(self._steps):
            data.ctrl[:] = self._ahead
            if len(robot.layout.ball):
                self._aim_balls(data.ctrl, robot.layout.ball)
            if self._servos is not None:
                self._servos.limit(data)
            self.step(self.model, data)
            if self._servos is not None:
                self._servos.note(data)
        if self._pushed > 0:
            self._pushed -= 1
            if self._pushed == 0:
                self.push(np.zeros(3))
        broken = not np.logical_and.reduce(np.isfinite(data.qpos))
        for warning in self._warnings:
            broken |= warning.number > 0
        if broken:
            self._faults += 1
            robot.place(targets, pose, self._goal)
            self._put_in_place()
            if self._legs is not None:
                self._legs.adjust(data, self._goal, self._heading)  # a walker has forgotten what it was to do
        robot.layout.read(data.qpos, near=targets, out=self._measured)
        root = self.placed
        if self._walker is not None:
            # The body is behind: it is judged by what it was to do now.
            root = self._walker.preview.goal[:7]
            targets = self._played
            robot.layout.read(self._walker.preview.goal, near=self._measured, out=targets)
            self.wanted[:] = self._walker.preview.goal
        self._count(targets)
        if self._root == "free":
            self.wanted[:2] = data.qpos[:2]
            self._look_for_fall(root)

    def _recover(self) -> None:
        """Notes that a robot is going to fall, and lets it protect itself and get up."""
        if self._legs is None:
            return
        recovery = self._recovery
        if recovery is None:
            if self._legs.falling and not self._lost and not self.fallen:
                self.near_falls.append(self.clock())
            self._lost = self._legs.falling
            return
        before = recovery.phase
        recovery.adjust(self._legs, self.data, self._goal_before, self._goal, held=self.holds())
        if recovery.phase is not before:
            self._lead = lead_of(self.model)
            if recovery.phase is Phase.FALLS:
                self.near_falls.append(self.clock())

    def _stand_again(self, legs: Balance | Walker) -> None:
        """Lets what keeps a robot on its feet begin anew where it stands."""
        self._gone = self.travel or (0.0, 0.0)
        here = self.data.qpos.copy()
        legs.start(self.data)
        self.data.qpos[:] = here

    def _look_for_fall(self, played: Array) -> None:
        """Notes whether the robot lies where its root is to be as `played`, shape (>= 7,)."""
        gave_up = self._recovery is not None and self._recovery.gave_up
        if gave_up or has_fallen(self.data.qpos, played, self.model.qpos0[3:7]):
            self.fallen, self._stands_for = True, 0
            self.fell_s = self.clock() if self.fell_s is None else self.fell_s
        elif self.fallen:
            self._stands_for += 1
            self.fallen = self._stands_for * self._dt < STANDS_AGAIN

    @property
    def incidents(self) -> list[str]:
        """What has happened to it so far, in words."""
        guarded = ": it tucks itself in and goes soft" if self._recovery is not None else ""
        return ["the robot is about to fall" + guarded] * len(self.near_falls)

    def measured(self) -> Array:
        """The joint positions (J,), rad, in the simulation."""
        return self._measured

    @property
    def travel(self) -> tuple[float, float] | None:
        """How far the motion went and how far a robot that walks did, along the ground, m; None for others."""
        if self._walker is None or not self._started:
            return None
        asked, walked = self._gone
        return asked + self._walker.preview.travel.metres, walked + self._walker.travel.metres

    def contact_forces(self, out: Array) -> None:
        """Writes where the floor holds the body and how hard, as `contact_forces`, into (N, 6)."""
        contact_forces(self.model, self.data, out)

    def push(self, force: Array) -> None:
        """Pushes the root with a force (3,), N, in the world, until the next call."""
        root = int(self.model.jnt_bodyid[0])
        self.data.xfrc_applied[root, :3] = force

    def push_from(self, side: Side, impulse: float, towards: float | None = None) -> float:
        """Pushes the root for PUSH_LASTS seconds, level, from a side of the body as the motion heads.

        Args:
            side: where the push meets it.
            impulse: N s; 0 for `usual_push`.
            towards: where it drives the body, rad from the world's x to its y axis, in place of a side.

        Returns:
            The impulse, N s.

        Raises:
            MotiondeckError: if the root is fixed.
        """
        if self._root == "fixed":
            raise MotiondeckError("a fixed root cannot be pushed: play with --root gantry or free")
        away = self._heading + PUSHES_TOWARDS[side] if towards is None else towards
        impulse = impulse or usual_push(self._robot.model)
        self.push(push_force(impulse, away))
        self._pushed = round(PUSH_LASTS / self._dt)
        return impulse

    def report(self) -> Mapping[str, object]:
        """Tracking errors of the servos: root mean square over joints and time, and the largest of any joint."""
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
        if self._legs is not None:
            said["near_falls_s"] = self.near_falls
            said["got_up"] = self._recovery.rises if self._recovery is not None else 0
        if self._walker is not None and self.travel is not None:
            said["travel"] = dict(zip(("asked_m", "walked_m"), self.travel, strict=True))
            said |= {"capture_point_off": self._walker.worst}
            said["own_steps"] = self._walker.own_steps
        if self._servos is not None:
            said["servos"] = self._servos.report()
        return said

    def close(self) -> None:
        """Does nothing."""

    def _aim(self) -> None:
        """Sets the controls that stay the same in all steps of a write."""
        layout, ahead = self._robot.layout, self._ahead
        mujoco.mj_differentiatePos(self.model, self._turned, self._dt, self._goal_before, self._goal)
        ahead[:] = self._lead * self._turned[layout.dof]
        ahead[layout.hinge] += self._goal[layout.hinge_qpos]

    def _aim_balls(self, ctrl: Array, balls: NDArray[np.int64]) -> None:
        """Sets the controls of ball joints in a step."""
        # MuJoCo subtracts the joint's rotation vector from the control; the difference is to be the error.
        mujoco.mj_differentiatePos(self.model, self._turned, 1.0, self._straight, self.data.qpos)
        mujoco.mj_differentiatePos(self.model, self._error, 1.0, self.data.qpos, self._goal)
        ctrl[balls] += (self._turned + self._error)[self._robot.layout.dof[balls]]

    def _put_in_place(self) -> None:
        """Starts at the goal, at rest; a free robot with its lowest point on the floor."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self._goal
        mujoco.mj_kinematics(self.model, self.data)
        if self._root == "free":
            self.data.qpos[2] -= LowestPoint(self.model)(self.data)
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

    def _count(self, targets: Array) -> None:
        error = targets - self._measured
        self._writes += 1
        self._square_sum += float(error @ error)
        self._worst = max(self._worst, float(np.maximum.reduce(error)), -float(np.minimum.reduce(error)))
