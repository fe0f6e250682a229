"""Preflight: checks of a robot that is to play a motion or a switch, and the fastest tempo at which they pass.

Beyond a finding's limit the robot would be damaged, or leave the motion. Findings about standing are judged with a free
root, and only reported otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array
from sim.models.servo_motor import strength
from sim.physics.loads import Loads, loads_of
from sim.physics.physics_model import feet_of
from sim.physics.played_motions import PlayedMotion
from sim.physics.preflight.findings import Finding, PreflightVerdict
from sim.physics.preflight.physics_checks import PhysicsChecks
from sim.physics.preflight.static_checks import ASTRAY, StaticChecks
from sim.robots.robot import Robot
from sim.robots.self_collision import SelfCollision
from sim.robots.target_limiter import Limiter

SLOWEST = 0.1
_AT_ANY_TEMPO = ("out of reach", "self-collision")
# How close to the fastest tempo that passes the one found is, as a ratio: by the numbers, and in physics.
_WITHIN, _WITHIN_IN_PHYSICS = 1.02, 1.1


@dataclass
class Preflight:
    """Judges played motions on one robot.

    Attributes:
        robot: the robot.
        limits: of its joints, narrowed to those of a rig.
        limiter: of the joint targets.
        root: "gantry", "fixed" or "free".
        balance, walk: the controller of a free robot, if any.
        static: checks without simulation.
        physics: checks in physics.
    """

    robot: Robot
    limits: JointLimits
    limiter: Limiter
    root: str = "gantry"
    balance: bool = False
    walk: bool = False

    def __post_init__(self) -> None:
        # A separate footing: earlier motions must not change later verdicts, nor how motions are sampled.
        self.robot = replace(self.robot, footing=deepcopy(self.robot.footing, {id(self.robot.model): self.robot.model}))
        self._collisions, self._feet = SelfCollision(self.robot), feet_of(self.robot)
        falls = self.root == "free" and not (self.balance or self.walk)
        self.static = StaticChecks(self.robot, self.limits, self.limiter, falls=falls)
        self.physics = PhysicsChecks(self.robot, self.limits, self.limiter, self.root, self.balance, self.walk)

    def judge(self, played: PlayedMotion, *, simulate: bool, tempo: float = 1.0) -> PreflightVerdict:
        """Judges a motion or a switch at a tempo; `simulate` adds physics, with a free root for FALL_SECONDS."""
        loads = loads_of(self.robot, played, free=self.root == "free", collisions=self._collisions, feet=self._feet)
        findings = tuple(self.static.findings(played, loads, tempo))
        if simulate:
            findings += tuple(self.physics.findings(played, tempo))
        if all(finding.ok for finding in findings):
            return PreflightVerdict(played.name, findings, tempo)
        lasting = tuple(finding for finding in findings if finding.check in _AT_ANY_TEMPO and not finding.ok)
        if lasting:
            return PreflightVerdict(played.name, findings, None, obstacles=lasting)

        def passes_static(slow: float) -> bool:
            return self.static.passes_at_tempo(played, loads, slow)

        def passes_physics(slow: float) -> bool:
            return self.physics.follow(played, slow) and passes_static(slow)

        passes = fastest_passing(passes_static, tempo, _WITHIN)
        if simulate and passes is not None and not passes_physics(passes):
            passes = fastest_passing(passes_physics, passes, _WITHIN_IN_PHYSICS)
        obstacles = self._obstacles(played, loads, simulate=simulate) if passes is None else ()
        return PreflightVerdict(played.name, findings, passes, obstacles=obstacles)

    def _obstacles(self, played: PlayedMotion, loads: Loads, *, simulate: bool) -> tuple[Finding, ...]:
        """The findings that fail at the slowest tempo; those of a simulation only if no others do."""
        found = self.static.findings(played, loads, SLOWEST)
        if simulate and all(one.ok for one in found):
            found = self.physics.findings(played, SLOWEST)
        torque = np.abs(loads.torque(SLOWEST)).max(axis=0)
        return tuple(replace(one, cause=self._cause(one, torque)) for one in found if not one.ok)

    def _cause(self, finding: Finding, torque: Array) -> str:
        """The cause of a failure under torques (J,), N m, or ""."""
        if finding.check not in ("torque", "physics: off target") or finding.where not in self.robot.joints:
            return ""
        joint = self.robot.joints.index(finding.where)
        needs, servo = float(torque[joint]), self.robot.servo
        most = float(strength(self.robot.model)[joint]) if servo is None else servo.most
        stiffness = float(self.robot.model.actuator_gainprm[joint, 0])
        if needs > most:
            return f"it needs {needs:.3g} N m to carry its limb and has {most:.3g}"
        if stiffness > 0.0 and needs / stiffness > 0.5 * ASTRAY:
            sag = needs / stiffness
            return f"its servo is soft: under {needs:.3g} N m its {stiffness:.3g} N m/rad give way by {sag:.2f} rad"
        return ""


def fastest_passing(passes: Callable[[float], bool], tempo: float, within: float) -> float | None:
    """The fastest passing tempo from SLOWEST to below the given one, to a ratio `within`, by bisection; None without.

    Where passing tempos have gaps, it is the upper end of one of their stretches.
    """
    low, high = SLOWEST, tempo
    while high > within * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if passes(middle) else (low, middle)
    # The slowest tempo takes longest to check, and is rarely needed.
    return low if low > SLOWEST or passes(SLOWEST) else None
