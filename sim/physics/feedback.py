"""Feedback of a motion that was found for a robot's own feet: controls, and changes linear in how far it is off.

    u = controls + K_b e,      e = z - (z as it was found)

e is taken at the beginning of a block b of HOLD controls. z is what a robot measures or estimates: the height of its
root, up and its velocity as seen from it, its spin, joints and their rates; neither place nor heading.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import mujoco
import numpy as np

from controller.motion.formats.npz_arrays import NpzArrays
from controller.motion.rotations import Array, conjugate, rotate
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import write_file
from sim.robots.robot import Robot
from sim.robots.training_files import npz_bytes

STEP = 0.005  # s for which a servo's control is held
HOLD = 20  # controls of a block
MOST = 0.4  # of a change, rad
OTHER = 0.3  # root mean square of joints off the plan, rad, from which another motion is played
SUFFIX = ".feedback"  # of its file, which has arrays as an .npz, beside that of the motion


@dataclass(frozen=True)
class Feedback:
    """Of K controls in B blocks, for a robot of J joints whose state has n numbers."""

    joints: tuple[str, ...]
    controls: Array  # of the servos, shape (K, J), rad
    states: Array  # as it was found at the beginning of each block, shape (B, n): qpos and qvel
    gains: Array  # shape (B, J, D)

    def save(self, path: Path) -> None:
        """Writes it; FileFormatError if it cannot be written."""
        long = {"controls": self.controls.astype(np.float32), "states": self.states.astype(np.float32)}
        write_file(path, npz_bytes(joint_names=np.array(self.joints), gains=self.gains.astype(np.float16), **long))

    @classmethod
    def beside(cls, motion: Path, robot: Robot) -> Self | None:
        """That beside a motion's file, if there is one for this robot's joints; FileFormatError if it is broken."""
        if not (path := motion.with_suffix(SUFFIX)).is_file():
            return None
        arrays, (nq, nv) = NpzArrays(path), (robot.model.nq, robot.model.nv)
        found = [array for name in ("controls", "states", "gains") if (array := arrays.first(name)) is not None]
        if arrays.words("joint_names") != robot.joints:
            return None
        blocks = -(-len(found[0]) // HOLD)
        shapes = [(len(found[0]), len(robot.joints)), (blocks, nq + nv), (blocks, len(robot.joints), nq + nv - 3)]
        if [array.shape for array in found] != shapes or not blocks or not all(np.isfinite(one).all() for one in found):
            raise FileFormatError(f"{path}: no feedback for {robot.name}. Learn the motion again with --physical.")
        return cls(robot.joints, *found)


def seen(states: Array, nq: int) -> Array:
    """z of states (..., n), shape (..., D)."""
    back = conjugate(states[..., 3:7])
    up, velocity = rotate(back, np.array([0.0, 0.0, 1.0])), rotate(back, states[..., nq : nq + 3])
    return np.concatenate([states[..., 2:3], up, states[..., 7:nq], velocity, states[..., nq + 3 :]], axis=-1)


class PlanFollower:
    """Has a free robot do a motion as it was found, from its first state on, for as long as that is played."""

    falling = False

    def __init__(self, robot: Robot, feedback: Feedback, clock: Callable[[], float]) -> None:
        """Args: the robot; the feedback; the time of the deck, s, which stands still until the motion begins."""
        self._robot, self._feedback, self._clock = robot, feedback, clock
        self._planned, self._change = seen(feedback.states, robot.model.nq), np.zeros(len(robot.joints))
        self.plays = True  # until another motion is played

    def start(self, data: mujoco.MjData) -> None:
        """Puts the robot where the motion begins, at its speed."""
        self._began, self._block = self._clock(), -1
        data.qpos[:], data.qvel[:] = np.split(self._feedback.states[0], [len(data.qpos)])

    def adjust(self, data: mujoco.MjData, goal: Array, heading: float) -> None:
        """Replaces a goal (nq,) by the control and the planned root, for the robot's state."""
        feedback, nq = self._feedback, len(goal)
        if (passed := self._clock() - self._began) <= 0.0 and self.plays:
            self.start(data)
        block = (step := round(passed / STEP)) // HOLD
        at = min(block, len(feedback.states) - 1)
        if block != self._block:
            self._block, off = block, goal[7:] - feedback.states[at, 7:nq]
            self.plays = self.plays and (passed <= 0.0 or float(off @ off) < OTHER**2 * len(off))
            change = feedback.gains[at] @ (seen(np.concatenate([data.qpos, data.qvel]), nq) - self._planned[at])
            self._change = np.clip(change, -MOST, MOST)
        if self.plays:
            control, limits = feedback.controls[min(step, len(feedback.controls) - 1)], self._robot.limits
            self._robot.layout.place(np.clip(control + self._change, limits.lower, limits.upper), goal)
            goal[2:7] = feedback.states[at, 2:7]
