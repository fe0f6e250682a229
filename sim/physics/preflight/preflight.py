"""Preflight: what would happen to a robot that plays a motion or a switch, and the tempo at which it goes well.

Each finding is a number with its limit; beyond the limit the robot would be damaged, or not play the motion any more.
Findings about standing are judged if the root is free, and only reported otherwise.
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
from sim.physics.preflight.by_numbers import ASTRAY, Numbers
from sim.physics.preflight.findings import Finding, PreflightVerdict
from sim.physics.preflight.trials import Trials
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
        robot: which robot.
        limits: of its joints, narrowed to those of a rig if there is one.
        limiter: bounds the joint targets that are played.
        root: "gantry", "fixed" or "free": what holds the robot.
        balance: whether a free robot keeps its balance.
        walk: whether a free robot goes where the motion goes, on its own feet.
        numbers: what it finds without simulation.
        trials: what it finds in physics.
    """

    robot: Robot
    limits: JointLimits
    limiter: Limiter
    root: str = "gantry"
    balance: bool = False
    walk: bool = False

    def __post_init__(self) -> None:
        # A footing of its own: what was judged before changes neither what comes next nor how motions are sampled.
        self.robot = replace(self.robot, footing=deepcopy(self.robot.footing, {id(self.robot.model): self.robot.model}))
        self._collisions, self._feet = SelfCollision(self.robot), feet_of(self.robot)
        falls = self.root == "free" and not (self.balance or self.walk)
        self.numbers = Numbers(self.robot, self.limits, self.limiter, falls=falls)
        self.trials = Trials(self.robot, self.limits, self.limiter, self.root, self.balance, self.walk)

    def judge(self, played: PlayedMotion, *, simulate: bool, tempo: float = 1.0) -> PreflightVerdict:
        """Judges what playing a motion does to the robot.

        Args:
            played: a motion or a switch.
            simulate: whether to play it in physics too: once with its servos and, with a free root, for FALL_SECONDS.
            tempo: at which it is played.
        """
        loads = loads_of(self.robot, played, free=self.root == "free", collisions=self._collisions, feet=self._feet)
        findings = tuple(self.numbers.findings(played, loads, tempo))
        if simulate:
            findings += tuple(self.trials.findings(played, tempo))
        if all(finding.ok for finding in findings):
            return PreflightVerdict(played.name, findings, tempo)
        lasting = tuple(finding for finding in findings if finding.check in _AT_ANY_TEMPO and not finding.ok)
        if lasting:
            return PreflightVerdict(played.name, findings, None, obstacles=lasting)

        def by_numbers(slow: float) -> bool:
            return self.numbers.pass_at(played, loads, slow)

        def in_physics(slow: float) -> bool:
            return self.trials.follow(played, slow) and by_numbers(slow)

        passes = fastest_passing(by_numbers, tempo, _WITHIN)
        if simulate and passes is not None and not in_physics(passes):
            passes = fastest_passing(in_physics, passes, _WITHIN_IN_PHYSICS)
        obstacles = self._obstacles(played, loads, simulate=simulate) if passes is None else ()
        return PreflightVerdict(played.name, findings, passes, obstacles=obstacles)

    def _obstacles(self, played: PlayedMotion, loads: Loads, *, simulate: bool) -> tuple[Finding, ...]:
        """The findings that fail at the slowest tempo: those of a simulation only if the others do not tell."""
        found = self.numbers.findings(played, loads, SLOWEST)
        if simulate and all(one.ok for one in found):
            found = self.trials.findings(played, SLOWEST)
        torque = np.abs(loads.torque(SLOWEST)).max(axis=0)
        return tuple(replace(one, cause=self._cause(one, torque)) for one in found if not one.ok)

    def _cause(self, finding: Finding, torque: Array) -> str:
        """What a joint lacks that is asked for so much torque (J,), N m, or ""."""
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
    """The fastest tempo from SLOWEST to below the given one that passes, found by halving; None where none does.

    The tempo returned passes, and one less than `within` times as fast does not; where passing tempos have gaps, it is
    the upper end of one of their stretches.
    """
    low, high = SLOWEST, tempo
    while high > within * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if passes(middle) else (low, middle)
    # The slowest tempo takes longest to check, and is rarely needed.
    return low if low > SLOWEST or passes(SLOWEST) else None
