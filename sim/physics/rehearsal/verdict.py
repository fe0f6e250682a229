"""Verdict: how a robot repeats what it rehearsed, with its usual servos, each time with other errors."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass, replace

import msgspec
import mujoco
import numpy as np

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array, conjugate, multiply, to_rotation_vector
from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import DT
from sim.physics.rehearsal.plant import Variation
from sim.physics.rehearsal.wanted_motion import WantedMotion
from sim.physics.walk_trial import placed_pose
from sim.robots.robot import DT as TICK
from sim.robots.robot import Robot


@dataclass(frozen=True)
class Repeat:
    """How it went.

    Attributes:
        kept_s: until the root was too low or leaned too far for the motion, or its whole length, s.
        seconds: that length.
        joints_deg: how far joints were from the motion, root mean square, degrees.
        height: how far the root was too high or low, root mean square, as a share of its height at rest.
        tilt_deg: how far the root was turned from the motion, but for its heading, root mean square, degrees.
        went: how far it got along the ground in the direction in which the motion goes, m.
        asked: how far the motion goes, m.
    """

    kept_s: float
    seconds: float
    joints_deg: float
    height: float
    tilt_deg: float
    went: float
    asked: float

    @property
    def kept(self) -> bool:
        """Whether it did the motion to its end."""
        return self.kept_s >= self.seconds


def repeated(robot: Robot, targets: Array, wanted: WantedMotion, variation: Variation) -> Repeat:
    """Repeats a motion.

    Args:
        robot: who.
        targets: what its joints are told, shape (T, J), rad, DT apart.
        wanted: the motion that it should look like, length T.
        variation: what differs from the robot's files.
    """
    body, model = _varied(robot, variation)
    stage = PhysicsPlayback(body, TICK, "free", compiled=model)
    start = variation.start(robot, wanted.qpos[0])
    first = np.empty(len(robot.joints))
    robot.layout.read(start, near=targets[0], out=first)
    stage.write(first, placed_pose(start[:7], 0.0))
    envelope = SafetyEnvelope(robot.limits, TICK)
    envelope.start(np.clip(first, robot.limits.lower, robot.limits.upper))
    ticks = round(DT / TICK)
    went, at = [], np.arange(1, ticks * (len(targets) - 1)) / ticks
    for when in at:
        k, share = int(when), when - int(when)
        told = targets[k] + share * (targets[k + 1] - targets[k])
        stage.write(envelope(told), placed_pose(wanted.qpos[k, :7], 0.0))
        went.append(stage.qpos.copy())
        if stage.fell_s is not None:
            break
    kept = len(went) - (stage.fell_s is not None)
    return _judged(robot, np.array(went), wanted, at, kept)


def _judged(robot: Robot, went: Array, wanted: WantedMotion, at: Array, kept: int) -> Repeat:
    """How where it went, shape (K, nq), compares with the motion, of which it was told the first K samples of `at`.

    It kept to the motion in the first `kept` of them.
    """
    there = wanted.qpos[at[: len(went)].astype(np.int64)]
    way = wanted.qpos[-1, :2] - wanted.qpos[0, :2]
    asked = float(np.hypot(*way))
    height = float(robot.model.body(int(robot.model.jnt_bodyid[0])).pos[2])
    hinges = robot.layout.hinge_qpos
    joints = np.square(went[:, hinges] - there[:, hinges]).sum()
    for ball in robot.layout.ball_qpos:
        joints += np.square(to_rotation_vector(multiply(conjugate(there[:, ball]), went[:, ball]))).sum()
    turn = to_rotation_vector(multiply(went[:, 3:7], conjugate(there[:, 3:7])))[:, :2]
    return Repeat(
        kept_s=kept * TICK,
        seconds=len(at) * TICK,
        joints_deg=float(np.degrees(np.sqrt(joints / (len(went) * len(robot.joints))))),
        height=float(np.sqrt(np.square(went[:, 2] - there[:, 2]).mean())) / height,
        tilt_deg=float(np.degrees(np.sqrt(np.square(turn).sum(axis=1).mean()))),
        went=float((went[-1, :2] - went[0, :2]) @ way) / max(asked, 1e-9),
        asked=asked,
    )


def _varied(robot: Robot, variation: Variation) -> tuple[Robot, mujoco.MjModel]:
    """A robot with other servos, and the model to simulate it on."""
    model = physics_model(robot, "free")
    model.geom_friction[:, 0] *= variation.friction
    model.actuator_forcerange *= variation.strength
    if robot.servo is not None:
        servo = msgspec.structs.replace(robot.servo, torque=variation.strength * robot.servo.torque)
        robot = replace(robot, servo=servo)
    return robot, model
