"""A servo rig as an output of the loop: joints by name, states read a tick late, tracking error measured."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.loop.correction import Correction
from controller.loop.lead import Delay
from controller.loop.output_channel import Channel
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.run.guard.guarded_rig import Awaited, GuardedRig, GuardProcess, connect
from motiondeck.run.robots.incident_causes import explained
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.files import listed

if TYPE_CHECKING:
    from hardware.rig.rig_file import RigConfig
    from hardware.rig.supervision.rig import Rig
    from motiondeck.page.web.page_state import RigDescription
    from sim.robots.robot import Robot


class RigOutput:
    """Streams targets to a connected rig, `hz` times a second, and measures its tracking error.

    Fits `deck.interfaces.Output`; targets are in the order of the robot's joints. MotiondeckError if the rig has a
    joint that the robot has not.
    """

    def __init__(self, rig: Rig | GuardedRig, joints: tuple[str, ...], hz: float) -> None:
        check_joints(rig.names, joints)
        self.name = "rig"
        self.rig = rig
        self.guarded = rig if isinstance(rig, GuardedRig) else None
        self._hz = hz
        self._order = np.array([joints.index(name) for name in rig.names])
        # Of each joint, as its rig file says, shape (J,), s; 0 for joints that the rig lacks.
        self.lag = np.zeros(len(joints))
        self.lag[self._order] = lags = np.array([joint.lag for joint in rig.config.joints])
        self._followed = Delay(lags, 1.0 / hz)
        self._written, self._meant = rig.positions.copy(), rig.positions.copy()
        self._measured, self._held = np.full(len(joints), np.nan), np.full(len(joints), np.nan)
        self._measured[self._order] = rig.positions
        self._squares, self._samples = 0.0, 0
        self.correction: Correction | None = None  # learns from what the joints measure; None without one
        self._free = np.zeros(len(joints), dtype=np.bool_)
        self._lost = ""

    def write(self, targets: Array, pose: Pose) -> None:
        """Takes the last state, sends targets, asks for the next, and never waits; MotiondeckError once it stopped."""
        if self._lost:
            raise MotiondeckError(self._lost)
        try:
            self._exchange(targets)
        except Exception as error:
            self._lost = str(error)
            raise

    def _exchange(self, targets: Array) -> None:
        rig = self.rig
        collected = rig.collect_state()
        # Of the positions collected just now, s: they were taken right after the goals before.
        age = 1.0 / self._hz if self.guarded is None else self.guarded.age
        if collected:
            # The state was taken right after the goals before were sent: the joints were following these.
            error = rig.positions - self._meant
            self._squares += float(error @ error)
            self._samples += len(error)
            self._measured[self._order] = rig.positions
        self._written[:] = targets[self._order]
        rig.write(self._written)
        self._meant[:] = self._followed(self._written if self.guarded is None else self.guarded.states.goals)
        if collected and self.correction is not None:  # once the goals are on their way, which must not wait for it
            self._free[self._order] = rig.states.conditions == 0
            self.correction.learn(self._measured, age, self._free)

    def measured(self) -> Array | None:
        """The latest measured positions (J,), rad; NaN for joints that the rig lacks."""
        return self._measured

    def held(self) -> Array | None:
        """Where the guard holds the joints on its own (J,), rad, NaN for joints that the rig lacks; else None."""
        if self.guarded is None or (held := self.guarded.held) is None:
            return None
        self._held[self._order] = held
        return self._held

    @property
    def at_rest(self) -> bool:
        """Whether the guard, if there is one, holds the joints."""
        return self.guarded is None or self.guarded.at_rest

    @property
    def description(self) -> RigDescription:
        """The servos for the page."""
        from hardware.rig.supervision.servo_states import CONDITIONS
        from motiondeck.page.web.page_state import RigDescription, ServoDescription

        servos = [ServoDescription(s.name, s.id, s.model, s.lower, s.upper, s.hottest) for s in self.rig.config.joints]
        return RigDescription(list(CONDITIONS), self._hz, servos)

    def switch(self, joint: str, *, on: bool) -> None:
        """Takes a joint's torque off, or has it set up and switched on where it stands; UnknownNameError without it."""
        place = self._place(joint)
        if on:
            self.rig.set_up_again(place)
        else:
            self.rig.switch_off(place)

    def restart(self, joint: str) -> None:
        """Has the servo of a joint restarted and set up again; MotiondeckError if there is none, or it cannot be."""
        self.rig.restart(self._place(joint))

    def registers(self, joint: str, write: tuple[str, int] | None = None) -> Awaited:
        """Has a servo's registers read, after a count is written into one of them; UnknownNameError without it."""
        return self._guard.ask(self._place(joint), write)

    def scan(self) -> Awaited:
        """Scans the rig's ports for servos."""
        return self._guard.ask()

    @property
    def _guard(self) -> GuardedRig:
        assert self.guarded is not None, "the rig of a run is behind a guard"
        return self.guarded

    def _place(self, joint: str) -> int:
        names = self.rig.names
        UnknownNameError.check("joint", joint, names)
        return names.index(joint)

    @property
    def incidents(self) -> list[str]:
        """What has happened to its servos lately, in words, in order of time."""
        return [f"{incident.source} {incident.what}" for incident in self.rig.incidents]

    def explain(self, new: Collection[str]) -> list[tuple[str, bool]]:
        """Some of them by their causes, with what to check, and whether each is a fault."""
        ports = {joint.label: part.port for part in self.rig.config.parts for joint in part.servos.joints}
        return explained(self.rig.incidents, new, ports)

    def report(self) -> Mapping[str, object]:
        """The rig's part of the report of the run."""
        rig, report = self.rig, self.rig.report
        known = rig.states.temperatures[np.isfinite(rig.states.temperatures)]
        return {
            "kind": "servos",
            "joints": len(rig.names),
            "hz": self._hz,
            "write_us": report.write_us,
            "read_us": report.read_us,
            "tracking_rmse_rad": (self._squares / self._samples) ** 0.5 if self._samples else None,
            "recoveries": report.recoveries,
            "incidents": self.incidents,
            "causes": [text for text, _ in self.explain(self.incidents)],
            "hottest_degc": float(known.max()) if len(known) else None,
            "faults": report.faults,
            "faults_by_joint": report.by_joint,
        }

    def close(self) -> None:
        """Ends the rig as its file says, and names the joints that did not confirm it; may be called twice."""
        from hardware.errors import still_on

        if unconfirmed := self.rig.close():
            print(f"motiondeck: {still_on(unconfirmed)}", file=sys.stderr)


def open_rig(
    opening: ExitStack, guard: GuardProcess, file: Path, robot: Robot, rate: float, *, emulated: bool
) -> tuple[Channel, JointLimits]:
    """Connects a rig, behind its guard, for a loop of some rate (Hz); it as an output, and the limits of both.

    The guard is from `guard_process`, which takes a while to be ready; `opening` closes the rig.
    MotiondeckError if the rig does not fit the robot or the rate, or cannot be connected.
    """
    from hardware.rig.rig_file import load_rig

    config = load_rig(file)
    every = rate / config.rate_hz
    if every < 1.0 or abs(every - round(every)) > 1e-6:
        raise MotiondeckError(f"{file}: rate_hz = {config.rate_hz:g} does not divide --rate {rate:g}; give another")
    limits = narrowed(robot.limits, robot, config)
    check_joints(config.names, robot.joints)
    places = [robot.joints.index(name) for name in config.names]
    rig = connect(*guard, config, limits, places, (), str(file) if emulated else None)
    opening.callback((output := RigOutput(rig, robot.joints, config.rate_hz)).close)
    return Channel(output, round(every)), limits


def check_joints(names: Sequence[str], joints: Sequence[str]) -> None:
    """Checks that a robot has the joints of a rig; raises a MotiondeckError that names those that are missing."""
    missing = [name for name in names if name not in joints]
    if missing:
        raise MotiondeckError(
            f"the rig's joints {listed(missing)} are not joints of this robot (it has: {listed(joints)}). Give the "
            "robot that has them with --robot, or name the joints in the rig file as the robot does."
        )


def narrowed(limits: JointLimits, robot: Robot, config: RigConfig) -> JointLimits:
    """The limits that robot and rig both allow, so that no servo gets a target that it would clip."""
    lower, upper, velocity = limits.lower.copy(), limits.upper.copy(), limits.velocity.copy()
    for joint in config.joints:
        if joint.name in robot.joints:
            index = robot.joints.index(joint.name)
            lower[index], upper[index] = max(lower[index], joint.lower), min(upper[index], joint.upper)
            velocity[index] = min(velocity[index], joint.velocity)
    outside = (robot.rest < lower) | (robot.rest > upper)
    if outside.any():
        index = int(np.argmax(outside))
        raise MotiondeckError(
            f"the rest pose of {robot.name} has {robot.joints[index]} at {robot.rest[index]:.2f} rad, "
            f"but with this rig it may go from {lower[index]:.2f} to {upper[index]:.2f} rad only"
        )
    return replace(limits, lower=lower, upper=upper, velocity=velocity)
