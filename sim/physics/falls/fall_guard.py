"""Fall guard: a robot that is going to fall bends its legs, raises its forearms before its face, and goes soft.

A servo that pushes with  kp (target - position) + kv (rate of target - velocity)  gets the share SOFT of its kp and
all of its kv: it gives way, and still takes up the energy of the fall.
"""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.robots.robot import Robot

SOFT = 0.5


class FallGuard:
    """Takes over the joints of a robot that falls.

    Attributes:
        active: whether it has taken over.
        targets: what it told the joints last, shape (J,), rad.
    """

    active: bool = False

    def __init__(self, robot: Robot, model: mujoco.MjModel, dt: float) -> None:
        """Args: whose joints; the model that is simulated, whose servos it makes soft; from tick to tick, s."""
        self._robot, self._model = robot, model
        self._step = robot.limits.velocity * dt
        self._gain, self._bias = model.actuator_gainprm[:, 0].copy(), model.actuator_biasprm[:, 1].copy()
        self.targets = robot.rest.copy()

    def take_over(self, goal: Array) -> None:
        """Goes soft, and begins with the joints of a goal (nq,)."""
        self.active = True
        self._robot.layout.read(goal, near=self.targets, out=self.targets)
        self._soften(SOFT)

    def let_go(self) -> None:
        """Makes the servos as strong as before."""
        self.active = False
        self._soften(1.0)

    def adjust(self, goal: Array) -> None:
        """Puts the joints of a goal (nq,) where they are next on the way to the tucked pose."""
        self.targets += np.clip(self._robot.tucked - self.targets, -self._step, self._step)
        self._robot.layout.place(self.targets, goal)

    def _soften(self, share: float) -> None:
        self._model.actuator_gainprm[:, 0] = share * self._gain
        self._model.actuator_biasprm[:, 1] = share * self._bias
