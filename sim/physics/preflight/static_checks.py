"""Preflight checks without simulation: joints, servos, collisions, balance, and where limbs and trunk point."""

from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.clip import Clip, runs
from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from sim.models.overlaps import OVERLAP
from sim.models.servo_motor import ROOM
from sim.physics.loads import Loads
from sim.physics.played_motions import DT, PlayedMotion, poses_at, targets_at
from sim.robots.carried_findings import carried_findings, segment_angles
from sim.robots.fidelity import Carried, lines_for
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Limiter, Robot
from sim.robots.verdict import Finding, limited

TICK = 0.005  # s
BRIEFLY = 0.05  # s
TEN_MINUTES = 600.0
# A motion is not played any more if a joint is farther than this from its target, rad, for longer than BRIEFLY;
# STARTING, s, is not counted.
ASTRAY = 0.17
STARTING = 0.2
OFF_BALANCE = 0.25  # s after which a body that is off balance falls
# A robot that touches the floor with more than its soles, its centre of mass below this share of the height of a
# standing root, is lying down already.
DOWN = 0.7


def sustained(off: Array, dt: float = TICK) -> Array:
    """The largest value that each column of (T, J) exceeds for a whole BRIEFLY, shape (J,)."""
    window = min(len(off), max(1, round(BRIEFLY / dt)))
    return np.lib.stride_tricks.sliding_window_view(off, window, axis=0).min(axis=-1).max(axis=0)


def sustained_until(off: Iterable[Array], until: float) -> Array:
    """The same of rows (J,), a tick each; it stops once a column has been above `until` for BRIEFLY."""
    rows: list[Array] = []
    long = np.zeros(1, dtype=np.int64)
    for row in off:
        rows.append(row)
        long = np.where(row > until, long + 1, 0)
        if long.max() >= round(BRIEFLY / TICK):
            break
    return sustained(np.array(rows))


def of_joints(check: str, values: Array, limit: float | None, unit: str, joints: tuple[str, ...]) -> Finding:
    """The largest of the values of all joints, shape (J,), with the joint."""
    worst = int(np.argmax(values))
    return limited(check, float(values[worst]), limit, unit, joints[worst])


class StaticChecks:
    """Judges a motion on a robot; the arguments are those of `Preflight`, `falls` without gantry and controller."""

    def __init__(self, robot: Robot, limits: JointLimits, limiter: Limiter, *, falls: bool) -> None:
        self._robot, self._limits, self._limiter, self._falls = robot, limits, limiter, falls

    def findings(self, played: PlayedMotion, loads: Loads, tempo: float) -> list[Finding]:
        """All of them."""
        depth = float(loads.collision.max())
        collision = limited("self-collision", 1e3 * depth, 1e3 * OVERLAP, "mm", loads.colliding)
        found = [*self._joints(played, loads, tempo), *self._servos(loads, tempo), collision]
        return found + self.standing(loads, tempo)

    def passes_at_tempo(self, played: PlayedMotion, loads: Loads, tempo: float) -> bool:
        """Whether all findings that depend on the tempo pass; it stops at the first that fails."""
        found = [*self._servos(loads, tempo), *self.standing(loads, tempo)]
        return all(one.ok for one in found) and self._held_back(played, tempo, until=ASTRAY).max() <= ASTRAY

    def _joints(self, played: PlayedMotion, loads: Loads, tempo: float) -> list[Finding]:
        joints, limits = self._robot.joints, self._limits
        beyond = sustained(np.maximum(limits.lower - played.targets, played.targets - limits.upper), DT)
        ends = np.minimum(played.targets - limits.lower, limits.upper - played.targets) < 1e-6
        share = ends.mean(axis=0)
        speed = tempo * np.abs(loads.velocity).max(axis=0) / limits.velocity
        held = self._held_back(played, tempo)
        return [
            of_joints("at a joint's end", 100.0 * share, None, "%", joints),
            limited("out of reach", max(float(beyond.max()), 0.0), ASTRAY, "rad", joints[int(np.argmax(beyond))]),
            of_joints("speed", 100.0 * speed, None, "%", joints),
            of_joints("held back", held, ASTRAY, "rad", joints),
        ]

    def _held_back(self, played: PlayedMotion, tempo: float, until: float = np.inf) -> Array:
        """Distance at which the limiter keeps each joint from its target for longer than BRIEFLY, shape (J,), rad."""
        # It ends once a joint exceeds `until`, rad, for that long.
        targets = targets_at(played, tempo, TICK)
        inside = np.clip(targets, self._limits.lower, self._limits.upper)
        limited = self._limiter(self._limits, TICK)
        limited.start(inside[0])
        # The envelope starts at rest, and so lags at first.
        first = min(len(targets) - 1, round(STARTING / TICK))
        for target in targets[:first]:
            limited(target)
        off = (np.abs(limited(target) - goal) for target, goal in zip(targets[first:], inside[first:], strict=True))
        return sustained_until(off, until)

    def _servos(self, loads: Loads, tempo: float) -> list[Finding]:
        motors, joints = self._robot.motors, self._robot.joints
        torque = loads.torque(tempo)
        share = sustained(np.abs(torque), DT) / self._robot.strength
        if motors is None:
            unknown, count = int(np.isinf(self._robot.strength).sum()), len(joints)
            found = [of_joints("torque", 100.0 * share, 100.0, "%", joints)]
            if unknown == count:
                found = [of_joints("torque", np.abs(torque).max(axis=0), None, "N m", joints)]
            return found + [Finding("joints of unknown torque", unknown, None, f"of {count} joints")] * bool(unknown)
        velocity = np.clip(tempo * loads.velocity, -self._limits.velocity, self._limits.velocity)
        lag = servo_lag(torque / motors.torque + velocity / motors.speed, DT / tempo) * motors.speed
        drawn = motors.drawn(np.clip(torque, -motors.most, motors.most))
        rms = np.sqrt(np.square(drawn).mean(axis=0))
        warm = motors.servo.temperature(rms**2, TEN_MINUTES, ROOM)
        return [
            of_joints("torque", 100.0 * share, 100.0, "%", joints),
            of_joints("servo lag", lag, ASTRAY, "rad", joints),
            of_joints("current (rms)", rms, None, "A", joints),
            of_joints("heat in 10 min", warm, motors.servo.hottest, "degC", joints),
        ]

    def standing(self, loads: Loads, tempo: float) -> list[Finding]:
        """Findings about feet and balance, without physics."""
        inside = loads.balance(tempo)
        down = loads.lies & (loads.com[:, 2] < DOWN * self._robot.root_height)
        off = max((end - start for start, end in runs((inside < 0.0) & ~down)), default=0) * DT / tempo
        slide = tempo * float(np.median(loads.slide))
        margin = float(np.median(inside))
        found = [
            Finding("into the ground", -1e3 * min(float(loads.lowest.min()), 0.0), None, "mm"),
            Finding("foot slide", 1e3 * slide, None, "mm/s"),
            Finding("balance margin", 1e3 * margin, None, "mm"),
            limited("off balance", off, OFF_BALANCE if self._falls else None, "s"),
        ]
        # A robot without feet, or with its feet in the air most of the time, has no margin.
        return [finding for finding in found if np.isfinite(finding.value)]


def servo_lag(drive: Array, dt: float) -> Array:
    """Lag of servos, in no-load speeds times seconds, shape (J,).

    A motor needs the share  torque / T + velocity / w  of its voltage, `drive` (T, J), every dt seconds. Beyond 1 it
    loses speed, below it catches up.
    """
    behind, worst = np.zeros((2, drive.shape[1]))
    for needed in np.abs(drive):
        behind = np.maximum(behind + (needed - 1.0) * dt, 0.0)
        worst = np.maximum(worst, behind)
    return worst


class CarriedChecks:
    """Carries motions of one skeleton onto one robot of known parts, again for each tempo.

    Inverse kinematics keeps to the joints' speeds: what it cannot follow at one tempo it follows at a slower one.
    """

    def __init__(
        self, robot: Robot, parts: Mapping[str, str], root_rotation: tuple[float, ...], skeleton: Skeleton
    ) -> None:
        """Args: as of `LimbDirections` and of the poses; the robot is posed once per sample."""
        self._robot, self._skeleton = robot, skeleton
        self._directions = LimbDirections(robot.model, parts, np.array(root_rotation))

    def findings(self, played: PlayedMotion, tempo: float) -> list[Finding]:
        """Limbs and trunk at a tempo."""
        shared = {id(self._robot.model): self._robot.model}
        retarget, footing = deepcopy((self._robot.retarget, self._robot.footing), shared)
        robot = replace(self._robot, retarget=retarget, footing=footing)
        if footing is not None:
            footing.reset(DT)
        poses = list(played.poses) if tempo == 1.0 else poses_at(played, tempo, DT)
        roots, turns = (np.array([getattr(p, name) for p in poses]) for name in ("root_position", "rotation"))
        offsets = poses[-1].offsets
        body = self._skeleton if offsets is None else self._skeleton.with_offsets(offsets)
        clip = Clip(played.name, body, 1.0 / DT, roots, turns)
        joints, qpos = np.empty((len(poses), len(robot.joints))), np.tile(robot.model.qpos0, (len(poses), 1))
        for k, pose in enumerate(poses):
            joints[k] = np.clip(retarget(pose), robot.limits.lower, robot.limits.upper)
            robot.place(joints[k], pose, qpos[k])
        carried = Carried(joints, joints, qpos, lines_for(robot, clip))
        angles = segment_angles(robot, self._directions, carried, 1.0 / DT)
        return carried_findings(robot, self._directions, carried, angles)
