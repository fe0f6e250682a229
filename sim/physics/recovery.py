"""Recovery: protection in a fall, and getting up.

    plays -> falls, tucked and soft -> lies straight -> gets up -> joins the motion -> plays

A robot on its back turns over first. If the poses of its file do not get it on its feet, it tries again, and after
TRIES stays down. In a fall it bends its legs, raises its forearms before its face, and goes soft: servos get the share
SOFT of their kp and all of their kv, which takes up the energy of the fall.
"""

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from itertools import chain

import mujoco
import numpy as np

from controller.motion.rotations import Array, conjugate, multiply, rotate
from sim.models.gravity import GRAVITY
from sim.robots.robot import Robot

SOFT = 0.5
# Largest height of a fallen root, in heights of the played one, or least lean beyond the played one, rad.
FALLEN_HEIGHT = 0.6
FALLEN_TILT = 1.0
# Speed of a root at rest, heights a second, for this time, s; least duration of a fall, and longest rocking, s.
SLOW, STILL, FALLS, ROCKS = 0.2, 0.4, 0.6, 5.0
STRAIGHT, STANDS = 5.0, 5.0  # durations of lying straight and of standing up from the last posture, in sqrt(height / g)
# Least height of a standing root, in its heights, and largest lean, rad.
HIGH, LEAN = 0.85, 0.3
TRIES = 6
GIVEN_UP, JOINS = 1.0, 0.6  # time after which a tucked robot has given up, and from the rest pose into the motion, s


def has_fallen(qpos: Array, played: Array, standing: Array) -> bool:
    """Whether a root (>= 7,) is too low or leans too far beside the commanded one; `standing`: its upright rotation."""
    up = rotate(conjugate(standing), np.array([0.0, 0.0, 1.0]))
    upright = rotate(np.stack([qpos[3:7], played[3:7]]), up)[:, 2]
    lean, played_lean = np.arccos(np.clip(upright, -1.0, 1.0))
    return bool(qpos[2] < FALLEN_HEIGHT * played[2] or lean > played_lean + FALLEN_TILT)


Phase = Enum("Phase", "PLAYS FALLS RISES JOINS LIES")  # of a recovery


class Recovery:
    """Controls the joints while a robot falls and gets up, in a `phase`; `rises` counts how often it has got up."""

    def __init__(self, robot: Robot, model: mujoco.MjModel, dt: float) -> None:
        """Args: the robot; the simulated model, whose servos it softens; the tick, s."""
        self._robot, self._model, self._dt = robot, model, dt
        self._step = robot.limits.velocity * dt
        self._gain, self._bias = model.actuator_gainprm[:, 0].copy(), model.actuator_biasprm[:, 1].copy()
        self._height = robot.root_height
        self._beat = math.sqrt(self._height / GRAVITY)
        self._upright = conjugate(model.qpos0[3:7])
        self._targets = robot.rest.copy()
        self.rises = 0
        self.start()

    def start(self) -> None:
        """Resets to playing with full servos."""
        self._soften(1.0)
        self._begin(Phase.PLAYS)
        self._tries = 0

    @property
    def seconds(self) -> float:
        """Time in this phase, s."""
        return self._ticks * self._dt

    @property
    def stands(self) -> bool:
        """Whether it has just got up, so that the legs' controller restarts."""
        return self.phase is Phase.JOINS and self._ticks == 0

    @property
    def gave_up(self) -> bool:
        """Whether it no longer plays the motion."""
        return self.phase in (Phase.RISES, Phase.LIES) or (self.phase is Phase.FALLS and self.seconds > GIVEN_UP)

    def adjust(self, data: mujoco.MjData, before: Array, goal: Array, *, falling: bool, held: bool = False) -> None:
        """Replaces the joints of a goal (nq,), given the last goal, the state, and whether a fall is certain."""
        # A held robot pauses on its way up, but still protects itself in a fall.
        if not (held and self.phase in (Phase.RISES, Phase.JOINS)) or self.stands:
            self._ticks += 1
        if falling and self.phase in (Phase.PLAYS, Phase.JOINS):
            self._robot.layout.read(before, near=self._targets, out=self._targets)
            self._soften(SOFT)
            self._begin(Phase.FALLS)
        match self.phase:
            case Phase.FALLS:
                self._targets += np.clip(self._robot.tucked - self._targets, -self._step, self._step)
                self._robot.layout.place(self._targets, goal)
                if self._robot.rise is not None and not held and self.seconds > FALLS and self._is_still(data):
                    self._soften(1.0)
                    self._begin(Phase.RISES)
                    self._course = self._moves([(STRAIGHT * self._beat, self._robot.rest)])
            case Phase.RISES if not held:
                following = next(self._course, None)
                if following is not None:
                    self._targets[:] = following
                self._robot.layout.place(self._targets, goal)
                if following is None and self._is_still(data):
                    self._go_on(data)
            case Phase.JOINS:
                share = min(self.seconds / JOINS, 1.0)
                played = np.empty_like(self._targets)
                self._robot.layout.read(goal, near=self._targets, out=played)
                self._robot.layout.place(self._targets + share * (played - self._targets), goal)
                if share == 1.0:
                    self._begin(Phase.PLAYS)
            case Phase.RISES | Phase.LIES:
                self._robot.layout.place(self._targets, goal)

    def _go_on(self, data: mujoco.MjData) -> None:
        """After a course: joins the motion on its feet, or begins the next course."""
        rise = self._robot.rise
        assert rise is not None
        turn = multiply(data.qpos[3:7], self._upright)
        up, ahead = rotate(turn, np.array([0.0, 0.0, 1.0])), rotate(turn, np.array([1.0, 0.0, 0.0]))
        if data.qpos[2] > HIGH * self._height and np.arccos(np.clip(up[2], -1.0, 1.0)) < LEAN:
            self._tries, self.rises = 0, self.rises + 1
            self._begin(Phase.JOINS)
        elif self._tries == TRIES:
            self._begin(Phase.LIES)
        else:
            self._tries += 1
            self._begin(Phase.RISES)
            rows = rise.front if ahead[2] < 0.0 else rise.back
            self._course = self._moves([*rows, (STANDS * self._beat, self._robot.rest)])

    def _soften(self, share: float) -> None:
        """Leaves the servos a share of their kp, and all of their kv."""
        self._model.actuator_gainprm[:, 0] = share * self._gain
        self._model.actuator_biasprm[:, 1] = share * self._bias

    def _begin(self, phase: Phase) -> None:
        self.phase, self._ticks, self._still, self._looks = phase, 0, 0, 0

    def _moves(self, postures: Sequence[tuple[float, Array]]) -> Iterator[Array]:
        """The joints (J,), tick by tick, from the present ones to one posture after another, each with its seconds."""
        starts = chain([self._targets.copy()], (joints for _, joints in postures))
        for start, (seconds, end) in zip(starts, postures, strict=False):
            ticks = max(round(seconds / self._dt), 1)
            for tick in range(1, ticks + 1):
                share = tick / ticks
                yield start + share * share * (3.0 - 2.0 * share) * (end - start)

    def _is_still(self, data: mujoco.MjData) -> bool:
        """Whether the root is at rest, or rocks for too long."""
        slow = float(np.linalg.norm(data.qvel[:3])) < SLOW * self._height
        self._still = self._still + 1 if slow else 0
        self._looks += 1
        return self._still * self._dt > STILL or self._looks * self._dt > ROCKS
