"""The stance of a human: soles and their stillness, which feet stand, how high they are lifted, slopes of flat feet.

The floor of the human is where its still foot is, because recordings stand a few centimetres off and even drift.
Skeletons differ: a foot bone ends at the ball, at the toes, or somewhere above them, and slopes by 0.04 to 0.7 rad on
flat feet. With one slope for all, one human would walk on the heels and another on tiptoe. So it is measured while a
foot stands, and soles that are flat for the human are flat for the robot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, dist, exp, hypot, sin, sqrt

import numpy as np

from controller.motion.anatomy import anatomy
from controller.motion.clip import Clip
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton
from sim.retargeting.human_limbs import LIMBS, turning

Point = tuple[float, float, float]

HEEL = 1.25 * cos(FOOT_SLOPE)  # lengths of the foot bone from the ball back to the heel
# Heights of a sole that still stands, and of a still foot above the other one that hardly does, lengths of the leg.
STANDS, NEAR = 0.02, 0.05
# Speeds below which heel or ball is still, and ankle and ball of a flat foot are, lengths of the leg a second.
STILL, FLAT = 0.4, 0.15
ROLLING = 0.1  # weight of a rolling foot beside one that stands on its whole sole
# Rate, 1/s, at which the floor follows a foot upwards that is still for some time, s: the top of a leap is still for a
# moment. Down it follows at once.
FOLLOWS, SURE = 60.0, 0.08
TELEPORT = 0.3  # lengths of the leg in one tick: a cut, not a step
# Time constants of the slope towards larger and smaller ones, s: people stand on tiptoe for moments only.
RISES, SINKS = 1.0, 0.2
STEEPEST = 1.0  # rad
ENOUGH = 3  # frames of standing

_FEET = ((LIMBS.index("r_shank"), LIMBS.index("r_foot")), (LIMBS.index("l_shank"), LIMBS.index("l_foot")))


@dataclass(slots=True)
class Sole:
    """One foot: heel, ball and ankle, x, y, z in m; downward slope of its bone, rad; height of its lowest point, m."""

    heel: Point
    ball: Point
    ankle: Point
    slope: float
    lowest: float


class Soles:
    """Finds the soles of one skeleton; without feet it stands on its lowest joint."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        parts = anatomy(skeleton)
        feet = [foot for side in ("right", "left") if (foot := parts.first("foot", side)) is not None]
        self.count = len(feet)
        if not feet:
            return
        # The bones from the root to the toes; balls and foot bones are linear in the products of their quaternions.
        on_way = np.flatnonzero(skeleton.chain[feet].any(axis=0))
        offset = (skeleton.rest_direction * skeleton.length[:, None])[on_way]
        self._rows = (4 * (on_way + 1)[:, None] + np.arange(4)).ravel()
        turn = np.stack([turning(v) for v in offset])  # (B, 16, 3)
        ball = skeleton.chain[feet][:, on_way, None, None] * turn
        own = (on_way == np.array(feet)[:, None])[:, :, None, None] * turn
        turns = np.concatenate([ball, own], axis=3).reshape(len(feet), -1, 6)
        self._turn = turns.transpose(1, 0, 2).reshape(-1, 6 * len(feet))
        self._back = (HEEL * skeleton.length[feet]).tolist()

    def __call__(self, pose: Pose, flat: Sequence[float]) -> list[Sole]:
        """The right and the left sole, for the slopes of flat feet, rad; without feet one without length."""
        if not self.count:
            joints = self._skeleton.joints(pose.root_position, pose.rotation)
            x, y, z = joints[np.argmin(joints[:, 2])].tolist()
            return [Sole((x, y, z), (x, y, z), (x, y, z), 0.0, z)]
        q = pose.rotation.ravel().take(self._rows).reshape(-1, 4)
        numbers = ((q[:, :, None] * q[:, None, :]).ravel() @ self._turn).tolist()
        rx, ry, rz = pose.root_position.tolist()
        found = []
        for foot, (back, even) in enumerate(zip(self._back, flat, strict=False)):
            bx, by, bz, fx, fy, fz = numbers[6 * foot : 6 * foot + 6]
            x, y, z = rx + bx, ry + by, rz + bz
            # On a flat foot heel and ball are level.
            level = hypot(fx, fy)
            slope = atan2(-fz, level)
            along = back * cos(slope - even) / level if level > 1e-9 else 0.0
            heel = (x - along * fx, y - along * fy, z + back * sin(slope - even))
            found.append(Sole(heel, (x, y, z), (x - fx, y - fy, z - fz), slope, min(heel[2], z)))
        return found


class HumanStance:
    """Follows the feet of one human, pose by pose.

    Attributes:
        feet: their number, 2 or 0; without feet the lowest joint counts as one.
        leg: its length, m.
        flat: the slopes of flat feet.
        begun: whether the last pose was the first, or after a cut.
        standing: of each foot: 1 if heel or ball is still and low, towards 0 the faster both are.
        planted: the same for heel and ball.
        holding: weight of each foot's contact: as standing, but little for a foot that rolls, or turns on its ball,
            while the other one stands on its whole sole.
        rolled: the stiller part of each foot: 0 heel, 1 ball.
        heights: of that part, m.
        raised: height of the lowest sole above the floor, m.
    """

    def __init__(self, skeleton: Skeleton, dt: float) -> None:
        """Args: the human's skeleton, and the seconds from pose to pose."""
        self._soles, self._dt, self.flat = Soles(skeleton), dt, FlatFeet(dt)
        self.feet, self.leg = self._soles.count, max(skeleton.leg_length, 1e-3)
        self.reset()

    def reset(self, dt: float | None = None) -> None:
        """Resets; poses are dt seconds apart from now on, by default as before."""
        self._dt = dt or self._dt
        self.flat.reset(self._dt)
        self._pose: Pose | None = None
        self._users: list[str] = []
        self._before: list[Sole] | None = None
        self._at = (0.0, 0.0)
        self._floor = self._still_for = 0.0

    def __call__(self, pose: Pose, user: str) -> None:
        """Adds the next pose; calls of several users with one pose count once, each user calls once a pose."""
        if pose is self._pose and user not in self._users:
            self._users.append(user)
            return
        self._pose, self._users = pose, [user]
        soles = self._soles(pose, self.flat.slope)
        x, y = pose.root_position[:2].tolist()
        self.begun = self._before is None or hypot(x - self._at[0], y - self._at[1]) > TELEPORT * self.leg
        if self.begun or self._before is None:
            self._floor, self._before = min([sole.lowest for sole in soles]), soles
        before, self._before, self._at = self._before, soles, (x, y)
        slow, flat_below = STILL * self.leg * self._dt, FLAT * self.leg * self._dt
        still, flat, lows, self.rolled, self.heights = [], [], [], [], []
        for foot, (now, then) in enumerate(zip(soles, before, strict=True)):
            heel, ball = dist(now.heel, then.heel), dist(now.ball, then.ball)
            still.append(1.0 / (1.0 + (min(heel, ball) / slow) ** 8))
            rolled = heel / max(heel + ball, 1e-9)
            self.rolled.append(rolled)
            self.heights.append((1.0 - rolled) * now.heel[2] + rolled * now.ball[2])
            flat.append(1.0 / (1.0 + (max(heel, ball) / slow) ** 8))
            lows.append(now.lowest)
            if max(ball, dist(now.ankle, then.ankle)) < flat_below and now is not then:
                self.flat.stood(foot, now.slope)
        low = min(lows)
        rise = low - self._floor
        self._still_for = self._still_for + self._dt if still[lows.index(low)] > 0.5 else 0.0
        if rise > 0.0:
            rise *= min(FOLLOWS * self._dt, 1.0) if self._still_for > SURE else 0.0
        self._floor += rise
        self.raised = max(low - self._floor - STANDS * self.leg, 0.0)
        self.standing, self.planted, self.holding = [], [], []
        for foot, height in enumerate(lows):
            # What stands is not the higher one of two feet that are still.
            other = still[1 - foot] if len(lows) == 2 else 0.0
            near = 1.0 - other * (1.0 - exp((low - height) / (NEAR * self.leg)))
            self.standing.append(still[foot] * near)
            self.planted.append(flat[foot] * near)
        most = max(self.planted) + ROLLING
        for standing, planted in zip(self.standing, self.planted, strict=True):
            self.holding.append(standing * (planted + ROLLING) / most)


class FlatFeet:
    """The `slope`, rad, of the right and of the left foot bone of one human while they stand flat."""

    def __init__(self, dt: float) -> None:
        """Args: seconds from one pose to the next."""
        self.slope = [FOOT_SLOPE, FOOT_SLOPE]
        self.reset(dt)

    def reset(self, dt: float) -> None:
        """Forgets the slopes; from now on poses are dt seconds apart."""
        self.slope[:] = FOOT_SLOPE, FOOT_SLOPE
        self._rises, self._sinks = 1.0 - exp(-dt / RISES), 1.0 - exp(-dt / SINKS)

    def stood(self, foot: int, slope: float) -> None:
        """Adds the slope, rad, of a foot (0: right, 1: left) that stands."""
        more = slope - self.slope[foot]
        self.slope[foot] += (self._rises if more > 0.0 else self._sinks) * more
        self.slope[foot] = min(max(self.slope[foot], -STEEPEST), STEEPEST)

    def __call__(self, directions: Array) -> Array:
        """The directions of the limbs (18, 3) with feet that slope by FOOT_SLOPE where they stand flat."""
        turned = directions
        for (shank, foot), slope in zip(_FEET, self.slope, strict=True):
            angle = FOOT_SLOPE - slope
            if abs(angle) < 1e-3:
                continue
            fx, fy, fz = directions[foot].tolist()
            sx, sy, sz = directions[shank].tolist()
            # About the axis across the leg, which a foot in line with its shank does not have.
            lx, ly, lz = fy * sz - fz * sy, fz * sx - fx * sz, fx * sy - fy * sx
            length = sqrt(lx * lx + ly * ly + lz * lz)
            if length < 1e-6:
                continue
            angle *= min(2.0 * length, 1.0)
            c, s = cos(angle), sin(angle) / length
            if turned is directions:
                turned = directions.copy()
            turned[foot] = (
                c * fx + s * (ly * fz - lz * fy),
                c * fy + s * (lz * fx - lx * fz),
                c * fz + s * (lx * fy - ly * fx),
            )
        return turned

    def learn(self, clip: Clip) -> None:
        """Takes the slopes of a recording's standing feet; a foot that never stands keeps its slope."""
        parts, joints = anatomy(clip.skeleton), clip.joints()
        if len(clip) < 2:
            return
        speeds = np.linalg.norm(np.gradient(joints, axis=0), axis=2) * clip.rate
        still = speeds < FLAT * clip.skeleton.leg_length
        for index, side in enumerate(("right", "left")):
            foot = parts.first("foot", side)
            if foot is None:
                continue
            ankle, ball = int(clip.skeleton.parent[foot]) + 1, foot + 1
            low = joints[:, ball, 2]
            stands = still[:, ankle] & still[:, ball] & (low < np.quantile(low, 0.5) + 0.05 * clip.skeleton.leg_length)
            if stands.sum() < ENOUGH:
                continue
            bone = joints[stands, ball] - joints[stands, ankle]
            slopes = np.arctan2(-bone[:, 2], np.hypot(bone[:, 0], bone[:, 1]))
            self.slope[index] = float(np.clip(np.quantile(slopes, 0.3), -STEEPEST, STEEPEST))
