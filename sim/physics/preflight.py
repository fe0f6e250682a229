"""Preflight: what would happen to a robot that plays a motion or a switch, and the speed at which it goes well.

Each finding is a number with its limit; what is beyond the limit would hurt the robot or not be the motion any more.
Numbers that tell about standing count where the root is free, and are told otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits
from controller.loop.safety_envelope import SafetyEnvelope
from controller.mocap.posture import Pose
from controller.rotations import Array, continuous, normalise
from sim.models.servo_motor import ROOM
from sim.physics.loads import Loads, loads_of
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import DT, Take
from sim.robots.robot import Robot
from sim.robots.self_collision import OVERLAP, SelfCollision

TICK = 0.005
TEN_MINUTES = 600.0
# A motion is no longer the motion when a joint is so far from where it is played, rad, for longer than BRIEFLY, s.
ASTRAY = 0.17
BRIEFLY = 0.05
# A body that is off balance for longer than this, s, falls.
OFF_BALANCE = 0.25
# What lies on something else than its soles, its centre of mass below this share of the height of a standing root,
# is down already.
DOWN = 0.7
# Played freely for so long, s, what falls has fallen.
FALL_SECONDS = 10.0
SLOWEST = 0.1
_AT_ANY_TEMPO = ("out of reach", "self-collision")
_HALVINGS = 5
# What passes without simulating and fails in physics is tried again so much slower.
_SLOWER = 0.9


@dataclass(frozen=True)
class Finding:
    """One number of a preflight.

    Attributes:
        check: what was looked at.
        value: what was found, in the unit.
        limit: beyond which it is not all right; None where the number only informs.
        unit: of both.
        where: the joint or the bodies at fault, or "".
        ok: whether it is within its limit.
    """

    check: str
    value: float
    limit: float | None
    unit: str
    where: str = ""
    ok: bool = True


@dataclass(frozen=True)
class PreflightVerdict:
    """What was found out about one take.

    Attributes:
        name: of the take.
        findings: all of them.
        passes_at: the largest tempo up to the take's own at which all is well; None where slowing down does not help.
        by_way_of: for a switch that is made by way of other motions, those; it is judged by its parts.
    """

    name: str
    findings: tuple[Finding, ...]
    passes_at: float | None
    by_way_of: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the robot can play it."""
        return all(finding.ok for finding in self.findings)

    @property
    def troubles(self) -> tuple[Finding, ...]:
        """What is not all right."""
        return tuple(finding for finding in self.findings if not finding.ok)


@dataclass
class Preflight:
    """Judges takes on one robot.

    Attributes:
        robot: who plays.
        limits: of its joints, narrowed to those of a rig where there is one.
        root: "gantry", "fixed" or "free": what holds the robot.
        balance: whether a free robot keeps its balance.
    """

    robot: Robot
    limits: JointLimits
    root: str = "gantry"
    balance: bool = False
    _collisions: SelfCollision = field(init=False)

    def __post_init__(self) -> None:
        self._collisions = SelfCollision(self.robot)

    def judge(self, take: Take, *, simulate: bool, tempo: float = 1.0) -> PreflightVerdict:
        """What a take does to the robot.

        Args:
            take: a motion or a switch.
            simulate: whether to play it in physics too, once through its servos, and freely where the root is free.
            tempo: how fast it is played.
        """
        loads = loads_of(self.robot, take, free=self.root == "free", collisions=self._collisions)
        findings = self.findings(take, loads, tempo, simulate=simulate)
        if all(finding.ok for finding in findings):
            return PreflightVerdict(take.name, findings, tempo)
        if any(finding.check in _AT_ANY_TEMPO for finding in findings if not finding.ok):
            return PreflightVerdict(take.name, findings, None)
        passes = fastest_passing(lambda slow: self._passes(take, loads, slow, simulate=False), tempo)
        while simulate and passes is not None and not self._passes(take, loads, passes, simulate=True):
            passes = _SLOWER * passes if _SLOWER * passes >= SLOWEST else None
        return PreflightVerdict(take.name, findings, passes)

    def findings(self, take: Take, loads: Loads, tempo: float, *, simulate: bool) -> tuple[Finding, ...]:
        """All numbers at a tempo."""
        found = [*self._joints(take, loads, tempo), *self._servos(loads, tempo), self._collision(loads)]
        found += self.standing(loads, tempo)
        if simulate:
            found += self.simulated(take, tempo)
        return tuple(found)

    def simulated(self, take: Take, tempo: float) -> list[Finding]:
        """What physics makes of it: whether the servos follow, and whether a free robot stands."""
        astray, joint, _ = self.play(take, tempo, self.root if self.root != "free" else "gantry", rounds=1)
        found = [_finding("physics: off target", astray, ASTRAY, "rad", self.robot.joints[joint])]
        if self.root == "free":
            _, _, fell = self.play(take, tempo, "free", rounds=None)
            stood = FALL_SECONDS if fell is None else fell
            found.append(replace(Finding("physics: stands", stood, FALL_SECONDS, "s"), ok=fell is None))
        return found

    def play(self, take: Take, tempo: float, root: str, rounds: int | None) -> tuple[float, int, float | None]:
        """Plays a take in physics; `rounds` of it, or for FALL_SECONDS.

        Returns:
            how far a joint was from its target for longer than BRIEFLY, rad; which; when the robot fell, s, or None.
        """
        targets, poses = _targets(take, tempo), _poses(take, tempo)
        envelope = SafetyEnvelope(self.limits, TICK)
        envelope.start(np.clip(targets[0], self.limits.lower, self.limits.upper))
        if self.robot.footing is not None:
            self.robot.footing.reset(TICK)
        stage = PhysicsPlayback(self.robot, TICK, root, self.balance and root == "free")
        ticks = len(targets) if rounds is not None else round(FALL_SECONDS / TICK)
        off = np.zeros((ticks, targets.shape[1]))
        for k in range(ticks):
            # What happens once holds its end, a loop goes round.
            at = k % len(targets) if take.loop else min(k, len(targets) - 1)
            stage.write(envelope(targets[at]), poses[at])
            off[k] = np.abs(stage.measured() - np.clip(targets[at], self.limits.lower, self.limits.upper))
            if stage.fell_s is not None:
                break
        worst = _lasting(off)
        return float(worst.max()), int(np.argmax(worst)), stage.fell_s

    def _passes(self, take: Take, loads: Loads, tempo: float, *, simulate: bool) -> bool:
        return all(finding.ok for finding in self.findings(take, loads, tempo, simulate=simulate))

    def _joints(self, take: Take, loads: Loads, tempo: float) -> list[Finding]:
        joints, limits = self.robot.joints, self.limits
        beyond = _lasting(np.maximum(limits.lower - take.targets, take.targets - limits.upper), DT)
        ends = np.minimum(take.targets - limits.lower, limits.upper - take.targets) < 1e-6
        share = ends.mean(axis=0)
        speed = tempo * np.abs(loads.velocity).max(axis=0) / limits.velocity
        held = self._held_back(take, tempo)
        return [
            Finding("at a joint's end", 100.0 * float(share.max()), None, "%", _of(joints, share)),
            _finding("out of reach", max(float(beyond.max()), 0.0), ASTRAY, "rad", _of(joints, beyond)),
            Finding("speed", 100.0 * float(speed.max()), None, "%", _of(joints, speed)),
            _finding("held back", float(held.max()), ASTRAY, "rad", _of(joints, held)),
        ]

    def _held_back(self, take: Take, tempo: float) -> Array:
        """How far the safety envelope keeps each joint from its target for longer than BRIEFLY, shape (J,), rad."""
        targets = _targets(take, tempo)
        inside = np.clip(targets, self.limits.lower, self.limits.upper)
        envelope = SafetyEnvelope(self.limits, TICK)
        envelope.start(inside[0])
        off = np.array([np.abs(envelope(target) - goal) for target, goal in zip(targets, inside, strict=True)])
        # It starts at rest, and so behind.
        return _lasting(off[min(len(off) - 1, round(0.2 / TICK)) :])

    def _servos(self, loads: Loads, tempo: float) -> list[Finding]:
        servo, joints = self.robot.servo, self.robot.joints
        torque = loads.torque(tempo)
        if servo is None:
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
        """What feet and balance do, told without simulating."""
        inside = loads.balance(tempo)
        root = self.robot.model.body(int(self.robot.model.jnt_bodyid[0]))
        down = loads.lies & (loads.com[:, 2] < DOWN * float(root.pos[2]))
        off = _longest((inside < 0.0) & ~down) * DT / tempo
        free = self.root == "free" and not self.balance
        slide = tempo * float(np.median(loads.slide))
        margin = float(np.median(inside))
        found = [
            Finding("into the ground", -1e3 * min(float(loads.lowest.min()), 0.0), None, "mm"),
            Finding("foot slide", 1e3 * slide, None, "mm/s"),
            Finding("balance margin", 1e3 * margin, None, "mm"),
            replace(Finding("off balance", off, OFF_BALANCE if free else None, "s"), ok=not free or off <= OFF_BALANCE),
        ]
        # What has no feet, or has them in the air for most of the time, has no margin.
        return [finding for finding in found if np.isfinite(finding.value)]


def _ticks(take: Take, tempo: float) -> tuple[NDArray[np.int64], Array]:
    """Which sample comes before each of the K ticks of a loop, and how far the tick is on the way to the next one."""
    at = np.arange(0.0, len(take.targets) - 1, TICK * tempo / DT)
    before = at.astype(np.int64)
    return before, at - before


def _targets(take: Take, tempo: float) -> Array:
    """The targets of a take at the ticks, shape (K, J), rad."""
    k, share = _ticks(take, tempo)
    return take.targets[k] + share[:, None] * (take.targets[k + 1] - take.targets[k])


def _poses(take: Take, tempo: float) -> list[Pose]:
    """The poses of a take at the ticks, length K."""
    k, share = _ticks(take, tempo)
    root = np.array([pose.root_position for pose in take.poses])
    heading = np.unwrap([float(pose.heading) for pose in take.poses])
    rotation = continuous(np.array([pose.rotation for pose in take.poses]))
    root = root[k] + share[:, None] * (root[k + 1] - root[k])
    heading = heading[k] + share * (heading[k + 1] - heading[k])
    # From sample to sample a bone turns so little that the chord does for the arc.
    rotation = normalise(rotation[k] + share[:, None, None] * (rotation[k + 1] - rotation[k]))
    return [Pose(*pose) for pose in zip(root, heading, rotation, strict=True)]


def _lasting(off: Array, dt: float = TICK) -> Array:
    """The largest value of each column of (T, J) that is not undercut for BRIEFLY, shape (J,)."""
    window = min(len(off), max(1, round(BRIEFLY / dt)))
    return np.lib.stride_tricks.sliding_window_view(off, window, axis=0).min(axis=-1).max(axis=0)


def _longest(flags: NDArray[np.bool_]) -> int:
    """How many samples in a row are set at most."""
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


def fastest_passing(passes: Callable[[float], bool], tempo: float) -> float | None:
    """The largest tempo from SLOWEST to the given one at which it passes, found by halving; None where none does."""
    low, high = SLOWEST, tempo
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(middle) else (low, middle)
    # The slowest takes longest to look at, and is rarely asked about.
    return low if low > SLOWEST or passes(SLOWEST) else None
