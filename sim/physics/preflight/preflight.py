"""Preflight: checks of a robot that is to play a motion or a switch, and the fastest tempo at which they pass.

Beyond a finding's limit the robot would be damaged, or leave the motion. Findings about standing are judged with a free
root, and only reported otherwise.
"""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import chain, repeat
from typing import Any, cast

import msgspec
import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array
from sim.models.servo_motor import ROOM
from sim.physics.loads import loads_of
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import PlayedMotion, endless_poses, poses_at, targets_at
from sim.physics.preflight.static_checks import ASTRAY, TEN_MINUTES, TICK, CarriedChecks, StaticChecks, sustained_until
from sim.robots.robot import Limiter, Robot
from sim.robots.self_collision import SelfCollision
from sim.robots.verdict import AT_ANY_TEMPO, SLOWEST, Finding, RobotVerdict, fastest_passing, limited

_WITHIN = 1.02  # how close to the fastest tempo that passes by the numbers the one found is, as a ratio
FALL_SECONDS = 10.0  # simulated on a free root, s


@dataclass
class Preflight:
    """Judges played motions on one robot."""

    robot: Robot
    limits: JointLimits  # of its joints, narrowed to those of a rig
    limiter: Limiter  # of the joint targets
    root: str = "gantry"
    balance: bool = False  # whether a free robot keeps its balance
    walk: bool = False  # whether a free robot walks
    carried: CarriedChecks | None = None  # None for a robot of unknown parts

    def __post_init__(self) -> None:
        # A separate footing: earlier motions must not change later verdicts, nor how motions are sampled.
        self.robot = replace(self.robot, footing=deepcopy(self.robot.footing, {id(self.robot.model): self.robot.model}))
        self._collisions, self._feet = SelfCollision(self.robot), feet_of(self.robot)
        falls = self.root == "free" and not (self.balance or self.walk)
        self.static = StaticChecks(self.robot, self.limits, self.limiter, falls=falls)
        self._held = self.root if self.root != "free" else "gantry"  # the root for checks of the servos
        self._models: dict[str, mujoco.MjModel] = {}

    def judge(self, played: PlayedMotion, *, simulate: bool, tempo: float = 1.0) -> RobotVerdict:
        """Judges a motion or a switch at a tempo.

        `simulate` adds how limbs point, and physics, with a free root for FALL_SECONDS.
        """
        loads = loads_of(self.robot, played, free=self.root == "free", collisions=self._collisions, feet=self._feet)
        findings = tuple(self.static.findings(played, loads, tempo))
        if simulate:
            findings = (*self._carried(played, tempo), *findings, *self.simulated(played, tempo))
        if all(finding.ok for finding in findings):
            return RobotVerdict(played.name, findings, tempo, tempo=tempo)
        lasting = tuple(finding for finding in findings if finding.check in AT_ANY_TEMPO and not finding.ok)
        if lasting:
            return RobotVerdict(played.name, findings, None, obstacles=lasting, tempo=tempo)

        def passes_static(slow: float) -> bool:
            return self.static.passes_at_tempo(played, loads, slow)

        def passes_simulated(slow: float) -> bool:
            carried = all(finding.ok for finding in self._carried(played, slow))
            follows = carried and all(one.ok for one in self.simulated(played, slow, until=ASTRAY))
            return follows and passes_static(slow)

        passes = fastest_passing(passes_static, tempo, _WITHIN)
        if simulate and passes is not None and not passes_simulated(passes):
            passes = fastest_passing(passes_simulated, passes)
        if passes is not None:
            return RobotVerdict(played.name, findings, passes, tempo=tempo)
        # The obstacles are what fails at the slowest tempo; of a simulation only if nothing else does.
        found = self.static.findings(played, loads, SLOWEST)
        if simulate and all(one.ok for one in found):
            found = [*self._carried(played, SLOWEST), *self.simulated(played, SLOWEST)]
        torque = np.abs(loads.torque(SLOWEST)).max(axis=0)
        failed = (msgspec.structs.replace(one, cause=self._cause(one, torque)) for one in found if not one.ok)
        return RobotVerdict(played.name, findings, None, obstacles=tuple(failed), tempo=tempo)

    def _carried(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        return self.carried.findings(played, tempo) if self.carried is not None else []

    def _cause(self, finding: Finding, torque: Array) -> str:
        """The cause of a failure under torques (J,), N m, or ""."""
        if finding.check not in ("torque", "off target") or finding.where not in self.robot.joints:
            return ""
        joint = self.robot.joints.index(finding.where)
        needs, most = float(torque[joint]), float(self.robot.strength[joint])
        stiffness = float(self.robot.model.actuator_gainprm[joint, 0])
        if needs > most:
            return f"it needs {needs:.3g} N m to carry its limb and has {most:.3g}"
        if stiffness > 0.0 and needs / stiffness > 0.5 * ASTRAY:
            sag = needs / stiffness
            return f"its servo is soft: under {needs:.3g} N m its {stiffness:.3g} N m/rad give way by {sag:.2f} rad"
        return ""

    def simulated(self, played: PlayedMotion, tempo: float, until: float = np.inf) -> Iterator[Finding]:
        """The findings of physics, one by one as they are asked for: servos, to an error `until`, rad; then falls."""
        astray, joint, _ = self.play(played, tempo, self._held, until=until)
        yield limited("off target", astray, ASTRAY, "rad", self.robot.joints[joint])
        if self.walk:
            yield from self._walked_findings(played, tempo)
        elif self.root == "free":
            yield _falls(self.play(played, tempo, "free", FALL_SECONDS)[2])

    def _walked_findings(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Findings of walking it on the robot's own feet for FALL_SECONDS, or until a fall."""
        stage = self._stage("free", walk=True)
        for _ in self._played(stage, played, tempo, FALL_SECONDS):
            pass
        asked, walked = stage.travel or (0.0, 0.0)
        report = cast(Mapping[str, Any], stage.report())
        found = [
            _falls(stage.fell_s),
            limited("capture point off", 100.0 * report["capture_point_off"], 100.0, "%"),
            Finding("motion goes", asked, None, "m"),
            Finding("robot goes", walked, None, "m"),
        ]
        servo = self.robot.servo
        if servo is not None:
            drawn = np.array(report["servos"]["rms_current_a"])
            warm = float(servo.temperature(drawn**2, TEN_MINUTES, ROOM))
            found.append(limited("heat of walking", warm, servo.hottest, "degC"))
            found.append(Finding("at torque limit", 100.0 * report["servos"]["at_limit"], None, "%"))
        return found

    def play(
        self, played: PlayedMotion, tempo: float, root: str, seconds: float | None = None, until: float = np.inf
    ) -> tuple[float, int, float | None]:
        """Plays a motion in physics, once or for some seconds, until a fall or an error above `until`, rad.

        Returns:
            a joint's largest error that lasted longer than BRIEFLY, rad; the joint; when the robot fell, s, or None.
        """
        stage = self._stage(root)
        worst = sustained_until(self._played(stage, played, tempo, seconds), until)
        return float(worst.max()), int(np.argmax(worst)), stage.fell_s

    def _stage(self, root: str, *, walk: bool = False) -> PhysicsPlayback:
        balance = self.balance and root == "free" and not walk
        if root not in self._models:
            self._models[root] = physics_model(self.robot, root)
        return PhysicsPlayback(self.robot, TICK, root, balance, walk=walk, compiled=self._models[root])

    def _played(
        self, stage: PhysicsPlayback, played: PlayedMotion, tempo: float, seconds: float | None
    ) -> Iterator[Array]:
        """Plays a motion on a stage until the robot falls; the joints' errors (J,), rad, in each tick."""
        targets, poses = targets_at(played, tempo, TICK), poses_at(played, tempo, TICK)
        inside = np.clip(targets, self.limits.lower, self.limits.upper)
        limited = self.limiter(self.limits, TICK)
        limited.start(inside[0])
        if self.robot.footing is not None:
            self.robot.footing.reset(TICK)
        # A one-shot holds its end, a loop goes round.
        rounds = endless_poses(poses) if played.loop else chain(poses, repeat(poses[-1]))
        for k, pose in zip(range(len(targets) if seconds is None else round(seconds / TICK)), rounds, strict=False):
            at = k % len(targets) if played.loop else min(k, len(targets) - 1)
            stage.write(limited(targets[at]), pose)
            yield np.abs(stage.measured() - inside[at])
            if stage.fell_s is not None:
                break


def _falls(fell: float | None) -> Finding:
    return Finding("falls", FALL_SECONDS if fell is None else fell, FALL_SECONDS, "s", ok=fell is None)
