"""Preflight: what would happen to a robot that plays a motion or a switch, and the tempo at which it goes well.

Each finding is a number with its limit; beyond the limit the robot would be damaged, or not play the motion any more.
Findings about standing are judged if the root is free, and only reported otherwise.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import chain, repeat
from typing import Any, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.rotations import Array
from sim.models.overlaps import OVERLAP
from sim.models.servo_motor import ROOM, strength
from sim.physics.loads import Loads, loads_of
from sim.physics.physics_model import feet_of
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import DT, PlayedMotion, onward, poses_at, targets_at
from sim.robots.robot import Robot
from sim.robots.self_collision import SelfCollision

TICK = 0.005
TEN_MINUTES = 600.0
# A motion is not played any more if a joint is farther than this from its target, rad, for longer than BRIEFLY, s;
# STARTING, s, is not counted.
ASTRAY = 0.17
BRIEFLY = 0.05
STARTING = 0.2
# A body that is off balance for longer than this, s, falls.
OFF_BALANCE = 0.25
# A robot that touches the floor with more than its soles, its centre of mass below this share of the height of a
# standing root, is lying down already.
DOWN = 0.7
# After so long on a free root, s, a robot that falls has fallen.
FALL_SECONDS = 10.0
SLOWEST = 0.1
_AT_ANY_TEMPO = ("out of reach", "self-collision")
# How close to the fastest tempo that passes the one found is, as a ratio: by the numbers, and in physics.
_WITHIN, _WITHIN_IN_PHYSICS = 1.02, 1.1


@dataclass(frozen=True)
class Finding:
    """One number of a preflight.

    Attributes:
        check: its name.
        value: in the unit.
        limit: the largest value that passes; None if the number only informs.
        unit: of both.
        where: the joint or the bodies concerned, or "".
        ok: whether it is within its limit.
        cause: why it fails even at the slowest tempo, in words, or "".
    """

    check: str
    value: float
    limit: float | None
    unit: str
    where: str = ""
    ok: bool = True
    cause: str = ""


@dataclass(frozen=True)
class PreflightVerdict:
    """The findings about one motion or switch.

    Attributes:
        name: of the motion or switch.
        findings: all of them.
        passes_at: the largest tempo, up to the judged one, at which all passes; None if no slower tempo helps.
        by_way_of: the motions on the way of a switch that is not direct; it is judged by its parts.
        obstacles: where no tempo passes, the findings that fail even at the slowest.
    """

    name: str
    findings: tuple[Finding, ...]
    passes_at: float | None
    by_way_of: tuple[str, ...] = ()
    obstacles: tuple[Finding, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the robot can play it."""
        return all(finding.ok for finding in self.findings)

    @property
    def troubles(self) -> tuple[Finding, ...]:
        """The findings beyond their limits."""
        return tuple(finding for finding in self.findings if not finding.ok)


@dataclass
class Preflight:
    """Judges played motions on one robot.

    Attributes:
        robot: which robot.
        limits: of its joints, narrowed to those of a rig if there is one.
        root: "gantry", "fixed" or "free": what holds the robot.
        balance: whether a free robot keeps its balance.
        walk: whether a free robot goes where the motion goes, on its own feet.
    """

    robot: Robot
    limits: JointLimits
    root: str = "gantry"
    balance: bool = False
    walk: bool = False

    def __post_init__(self) -> None:
        # A footing of its own: what was judged before changes neither what comes next nor how motions are sampled.
        self.robot = replace(self.robot, footing=deepcopy(self.robot.footing, {id(self.robot.model): self.robot.model}))
        self._collisions, self._feet = SelfCollision(self.robot), feet_of(self.robot)
        self._models: dict[str, mujoco.MjModel] = {}

    def judge(self, played: PlayedMotion, *, simulate: bool, tempo: float = 1.0) -> PreflightVerdict:
        """Judges what playing a motion does to the robot.

        Args:
            played: a motion or a switch.
            simulate: whether to play it in physics too: once with its servos and, with a free root, for FALL_SECONDS.
            tempo: at which it is played.
        """
        loads = loads_of(self.robot, played, free=self.root == "free", collisions=self._collisions, feet=self._feet)
        findings = self.findings(played, loads, tempo, simulate=simulate)
        if all(finding.ok for finding in findings):
            return PreflightVerdict(played.name, findings, tempo)
        lasting = tuple(finding for finding in findings if finding.check in _AT_ANY_TEMPO and not finding.ok)
        if lasting:
            return PreflightVerdict(played.name, findings, None, obstacles=lasting)

        def by_numbers(slow: float) -> bool:
            return self._passes(played, loads, slow)

        def in_physics(slow: float) -> bool:
            return self._follows(played, slow) and by_numbers(slow)

        passes = fastest_passing(by_numbers, tempo, _WITHIN)
        if simulate and passes is not None and not in_physics(passes):
            passes = fastest_passing(in_physics, passes, _WITHIN_IN_PHYSICS)
        obstacles = self._obstacles(played, loads, simulate=simulate) if passes is None else ()
        return PreflightVerdict(played.name, findings, passes, obstacles=obstacles)

    def _obstacles(self, played: PlayedMotion, loads: Loads, *, simulate: bool) -> tuple[Finding, ...]:
        """The findings that fail at the slowest tempo: those of a simulation only if the others do not tell."""
        by_numbers = self.findings(played, loads, SLOWEST, simulate=False)
        found = by_numbers if not simulate or not all(one.ok for one in by_numbers) else self.simulated(played, SLOWEST)
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

    def findings(self, played: PlayedMotion, loads: Loads, tempo: float, *, simulate: bool) -> tuple[Finding, ...]:
        """All findings at a tempo."""
        found = [*self._joints(played, loads, tempo), *self._servos(loads, tempo), self._collision(loads)]
        found += self.standing(loads, tempo)
        if simulate:
            found += self.simulated(played, tempo)
        return tuple(found)

    def _passes(self, played: PlayedMotion, loads: Loads, tempo: float) -> bool:
        """Whether all findings that a tempo can mend are within their limits; it stops at the first that is not."""
        found = [*self._servos(loads, tempo), *self.standing(loads, tempo)]
        return all(one.ok for one in found) and self._held_back(played, tempo, until=ASTRAY).max() <= ASTRAY

    def simulated(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Findings of playing it in physics: whether the servos follow, and whether a free robot stands."""
        astray, joint, _ = self.play(played, tempo, self._carried())
        found = [_finding("physics: off target", astray, ASTRAY, "rad", self.robot.joints[joint])]
        if self.walk:
            found += self._walked_findings(played, tempo)
        elif self.root == "free":
            _, _, fell = self.play(played, tempo, "free", FALL_SECONDS)
            stood = FALL_SECONDS if fell is None else fell
            found.append(replace(Finding("physics: stands", stood, FALL_SECONDS, "s"), ok=fell is None))
        return found

    def _follows(self, played: PlayedMotion, tempo: float) -> bool:
        """Whether all that `simulated` finds is within its limits; it stops as soon as something is not."""
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
            _finding("capture point off", 100.0 * report["capture_point_off"], 100.0, "%", ""),
            Finding("motion goes", asked, None, "m"),
            Finding("robot goes", walked, None, "m"),
        ]
        servo = self.robot.servo
        if servo is not None:
            drawn = np.array(report["servos"]["rms_current_a"])
            warm = float(servo.temperature(drawn**2, TEN_MINUTES, ROOM))
            found.append(_finding("walking: heat in 10 min", warm, servo.hottest, "degC", ""))
            found.append(Finding("walking: at torque limit", 100.0 * report["servos"]["at_limit"], None, "%"))
        return found

    def walked(self, played: PlayedMotion, tempo: float) -> PhysicsPlayback:
        """The robot after it has walked a motion for FALL_SECONDS, or has fallen."""
        stage = self._stage("free", walk=True)
        for _ in self._played(stage, played, tempo, FALL_SECONDS):
            pass
        return stage

    def _carried(self) -> str:
        """What holds the root while it counts whether the servos follow."""
        return self.root if self.root != "free" else "gantry"

    def play(
        self, played: PlayedMotion, tempo: float, root: str, seconds: float | None = None, until: float = np.inf
    ) -> tuple[float, int, float | None]:
        """Plays a motion in physics, once or for some seconds.

        It ends when the robot falls, or when a joint has been farther than `until`, rad, from its target for longer
        than BRIEFLY.

        Returns:
            how far a joint was from its target for longer than BRIEFLY, rad; which; when the robot fell, s, or None.
        """
        stage = self._stage(root)
        worst = _lasting_until(self._played(stage, played, tempo, seconds), until)
        return float(worst.max()), int(np.argmax(worst)), stage.fell_s

    def _stage(self, root: str, *, walk: bool = False) -> PhysicsPlayback:
        balance = self.balance and root == "free" and not walk
        stage = PhysicsPlayback(self.robot, TICK, root, balance, walk=walk, compiled=self._models.get(root))
        self._models[root] = stage.model
        return stage

    def _played(
        self, stage: PhysicsPlayback, played: PlayedMotion, tempo: float, seconds: float | None
    ) -> Iterator[Array]:
        """Plays a motion on a stage until the robot falls: how far joints are from their targets in each tick (J,)."""
        targets, poses = targets_at(played, tempo, TICK), poses_at(played, tempo, TICK)
        inside = np.clip(targets, self.limits.lower, self.limits.upper)
        envelope = SafetyEnvelope(self.limits, TICK)
        envelope.start(inside[0])
        if self.robot.footing is not None:
            self.robot.footing.reset(TICK)
        # A one-shot holds its end, a loop goes round.
        rounds = onward(poses) if played.loop else chain(poses, repeat(poses[-1]))
        for k, pose in zip(range(len(targets) if seconds is None else round(seconds / TICK)), rounds, strict=False):
            at = k % len(targets) if played.loop else min(k, len(targets) - 1)
            stage.write(envelope(targets[at]), pose)
            yield np.abs(stage.measured() - inside[at])
            if stage.fell_s is not None:
                break

    def _joints(self, played: PlayedMotion, loads: Loads, tempo: float) -> list[Finding]:
        joints, limits = self.robot.joints, self.limits
        beyond = _lasting(np.maximum(limits.lower - played.targets, played.targets - limits.upper), DT)
        ends = np.minimum(played.targets - limits.lower, limits.upper - played.targets) < 1e-6
        share = ends.mean(axis=0)
        speed = tempo * np.abs(loads.velocity).max(axis=0) / limits.velocity
        held = self._held_back(played, tempo)
        return [
            Finding("at a joint's end", 100.0 * float(share.max()), None, "%", _of(joints, share)),
            _finding("out of reach", max(float(beyond.max()), 0.0), ASTRAY, "rad", _of(joints, beyond)),
            Finding("speed", 100.0 * float(speed.max()), None, "%", _of(joints, speed)),
            _finding("held back", float(held.max()), ASTRAY, "rad", _of(joints, held)),
        ]

    def _held_back(self, played: PlayedMotion, tempo: float, until: float = np.inf) -> Array:
        """How far the safety envelope keeps each joint from its target for longer than BRIEFLY, shape (J,), rad.

        It ends when a joint has been kept farther than `until`, rad, for so long.
        """
        targets = targets_at(played, tempo, TICK)
        inside = np.clip(targets, self.limits.lower, self.limits.upper)
        envelope = SafetyEnvelope(self.limits, TICK)
        envelope.start(inside[0])
        # The envelope starts at rest, and so lags at first.
        first = min(len(targets) - 1, round(STARTING / TICK))
        for target in targets[:first]:
            envelope(target)
        off = (np.abs(envelope(target) - goal) for target, goal in zip(targets[first:], inside[first:], strict=True))
        return _lasting_until(off, until)

    def _servos(self, loads: Loads, tempo: float) -> list[Finding]:
        servo, joints = self.robot.servo, self.robot.joints
        torque = loads.torque(tempo)
        if servo is None:
            share = _lasting(np.abs(torque), DT) / strength(self.robot.model)
            if share.any():
                return [_finding("torque", 100.0 * float(share.max()), 100.0, "%", _of(joints, share))]
            peak = np.abs(torque).max(axis=0)
            return [Finding("torque", float(peak.max()), None, "N m", _of(joints, peak))]
        velocity = np.clip(tempo * loads.velocity, -self.limits.velocity, self.limits.velocity)
        share = _lasting(np.abs(torque), DT) / servo.most
        lag = servo_lag(torque / servo.torque + velocity / servo.speed, DT / tempo) * servo.speed
        drawn = servo.drawn(np.clip(torque, -servo.most, servo.most))
        rms = np.sqrt(np.square(drawn).mean(axis=0))
        warm = servo.temperature(rms**2, TEN_MINUTES, ROOM)
        return [
            _finding("torque", 100.0 * float(share.max()), 100.0, "%", _of(joints, share)),
            _finding("servo lag", float(lag.max()), ASTRAY, "rad", _of(joints, lag)),
            Finding("current (rms)", float(rms.max()), None, "A", _of(joints, rms)),
            _finding("heat in 10 min", float(warm.max()), servo.hottest, "degC", _of(joints, warm)),
        ]

    def _collision(self, loads: Loads) -> Finding:
        depth = float(loads.collision.max())
        return _finding("self-collision", 1e3 * depth, 1e3 * OVERLAP, "mm", loads.colliding)

    def standing(self, loads: Loads, tempo: float) -> list[Finding]:
        """Findings about feet and balance, without physics."""
        inside = loads.balance(tempo)
        root = self.robot.model.body(int(self.robot.model.jnt_bodyid[0]))
        down = loads.lies & (loads.com[:, 2] < DOWN * float(root.pos[2]))
        off = _longest((inside < 0.0) & ~down) * DT / tempo
        free = self.root == "free" and not (self.balance or self.walk)
        slide = tempo * float(np.median(loads.slide))
        margin = float(np.median(inside))
        found = [
            Finding("into the ground", -1e3 * min(float(loads.lowest.min()), 0.0), None, "mm"),
            Finding("foot slide", 1e3 * slide, None, "mm/s"),
            Finding("balance margin", 1e3 * margin, None, "mm"),
            replace(Finding("off balance", off, OFF_BALANCE if free else None, "s"), ok=not free or off <= OFF_BALANCE),
        ]
        # A robot without feet, or with its feet in the air most of the time, has no margin.
        return [finding for finding in found if np.isfinite(finding.value)]


def _lasting(off: Array, dt: float = TICK) -> Array:
    """The largest value that each column of (T, J) exceeds for a whole BRIEFLY, shape (J,)."""
    windows = np.lib.stride_tricks.sliding_window_view(off, _window(len(off), dt), axis=0)
    return windows.min(axis=-1).max(axis=0)


def _lasting_until(off: Iterable[Array], until: float) -> Array:
    """The same of rows (J,), a tick each; it looks no further when a column has been above `until` for so long."""
    rows: list[Array] = []
    long = np.zeros(1, dtype=np.int64)
    for row in off:
        rows.append(row)
        long = np.where(row > until, long + 1, 0)
        if long.max() >= round(BRIEFLY / TICK):
            break
    return _lasting(np.array(rows))


def _window(count: int, dt: float) -> int:
    """How many of so many samples are BRIEFLY."""
    return min(count, max(1, round(BRIEFLY / dt)))


def _longest(flags: NDArray[np.bool_]) -> int:
    """The length of the longest run of set samples."""
    longest = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        longest = max(longest, run)
    return longest


def _finding(check: str, value: float, limit: float, unit: str, where: str) -> Finding:
    return Finding(check, value, limit, unit, where, ok=value <= limit)


def _of(joints: tuple[str, ...], values: Array) -> str:
    return joints[int(np.argmax(values))]


def servo_lag(drive: Array, dt: float) -> Array:
    """How far servos fall behind, in no-load speeds times seconds, shape (J,).

    A motor needs the share  torque / T + velocity / w  of its voltage. What it needs beyond all of it, it lacks in
    speed, and what it does not need it has to catch up with.

    Args:
        drive: that share, shape (T, J).
        dt: from sample to sample, s.
    """
    behind, worst = np.zeros((2, drive.shape[1]))
    for needed in np.abs(drive):
        behind = np.maximum(behind + (needed - 1.0) * dt, 0.0)
        worst = np.maximum(worst, behind)
    return worst


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
