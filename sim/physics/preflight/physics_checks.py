"""Preflight checks in physics: whether servos follow, and whether a free robot stands or walks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, repeat
from typing import Any, cast

import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rotations import Array
from sim.models.servo_motor import ROOM
from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import PlayedMotion, endless_poses, poses_at, targets_at
from sim.physics.preflight.findings import Finding, limited
from sim.physics.preflight.static_checks import ASTRAY, TEN_MINUTES, TICK, sustained_until
from sim.robots.robot import Robot
from sim.robots.target_limiter import Limiter

FALL_SECONDS = 10.0  # simulated on a free root, s


class PhysicsChecks:
    """Plays motions in physics on one robot; the arguments are those of `Preflight`."""

    def __init__(
        self, robot: Robot, limits: JointLimits, limiter: Limiter, root: str, balance: bool, walk: bool
    ) -> None:
        self._limiter = limiter
        self.robot, self.limits, self.root, self.balance, self.walk = robot, limits, root, balance, walk
        self._models: dict[str, mujoco.MjModel] = {}

    def findings(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Whether the servos follow, and whether a free robot stands."""
        astray, joint, _ = self.play(played, tempo, self._carried())
        found = [limited("physics: off target", astray, ASTRAY, "rad", self.robot.joints[joint])]
        if self.walk:
            found += self._walked_findings(played, tempo)
        elif self.root == "free":
            _, _, fell = self.play(played, tempo, "free", FALL_SECONDS)
            stood = FALL_SECONDS if fell is None else fell
            found.append(replace(Finding("physics: stands", stood, FALL_SECONDS, "s"), ok=fell is None))
        return found

    def follow(self, played: PlayedMotion, tempo: float) -> bool:
        """Whether all `findings` pass; it stops at the first that fails."""
        astray, _, _ = self.play(played, tempo, self._carried(), until=ASTRAY)
        if astray > ASTRAY or self.root != "free":
            return astray <= ASTRAY
        if self.walk:
            return all(finding.ok for finding in self._walked_findings(played, tempo))
        return self.play(played, tempo, "free", FALL_SECONDS)[2] is None

    def _walked_findings(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Findings of walking it on the robot's own feet for FALL_SECONDS."""
        stage = self.walked(played, tempo)
        stood = FALL_SECONDS if stage.fell_s is None else stage.fell_s
        asked, walked = stage.travel or (0.0, 0.0)
        report = cast(Mapping[str, Any], stage.report())
        found = [
            replace(Finding("physics: stands", stood, FALL_SECONDS, "s"), ok=stage.fell_s is None),
            limited("capture point off", 100.0 * report["capture_point_off"], 100.0, "%"),
            Finding("motion goes", asked, None, "m"),
            Finding("robot goes", walked, None, "m"),
        ]
        servo = self.robot.servo
        if servo is not None:
            drawn = np.array(report["servos"]["rms_current_a"])
            warm = float(servo.temperature(drawn**2, TEN_MINUTES, ROOM))
            found.append(limited("walking: heat in 10 min", warm, servo.hottest, "degC"))
            found.append(Finding("walking: at torque limit", 100.0 * report["servos"]["at_limit"], None, "%"))
        return found

    def walked(self, played: PlayedMotion, tempo: float) -> PhysicsPlayback:
        """The robot after it has walked a motion for FALL_SECONDS, or has fallen."""
        stage = self._stage("free", walk=True)
        for _ in self._played(stage, played, tempo, FALL_SECONDS):
            pass
        return stage

    def _carried(self) -> str:
        """The root for checks of the servos."""
        return self.root if self.root != "free" else "gantry"

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
        limited = self._limiter(self.limits, TICK)
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
