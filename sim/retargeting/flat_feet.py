"""Flat feet: slope of a human's foot bones while the soles are flat on the floor.

Skeletons differ: a foot bone ends at the ball, at the toes, or somewhere above them, and slopes by 0.04 to 0.7 rad on
flat feet. With one slope for all, one human would walk on the heels and another on tiptoe. So it is measured while a
foot stands, and soles that are flat for the human are flat for the robot.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt

import numpy as np

from controller.motion.anatomy import anatomy
from controller.motion.clip import Clip
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array
from sim.retargeting.human_limbs import LIMBS

# Time constants of the slope towards larger and smaller ones, s: people stand on tiptoe for moments only.
RISES, SINKS = 1.0, 0.2
STEEPEST = 1.0  # rad
# Speed of ankle and ball below which a foot stands flat, lengths of the leg a second, and frames of standing needed.
STILL, ENOUGH = 0.15, 3

_FEET = ((LIMBS.index("r_shank"), LIMBS.index("r_foot")), (LIMBS.index("l_shank"), LIMBS.index("l_foot")))


class FlatFeet:
    """The slopes of the right and the left foot bone of one human.

    Attributes:
        slope: while they stand flat, rad.
    """

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
        """The directions of the limbs (14, 3) with feet that slope by FOOT_SLOPE where they stand flat."""
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
        still = speeds < STILL * clip.skeleton.leg_length
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
