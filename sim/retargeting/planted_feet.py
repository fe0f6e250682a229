"""Planted feet: two feet that stand keep their distance, and a foot that stands on its sole does not turn.

Legs of other proportions that point as the human's do bring feet that stand together, or apart: then one of them
slides, wherever the root goes. So while both stand, the vector from one sole to the other is held as it was when they
began to, and so is the way that a sole points which stands flat. What is held goes along with the robot as far as the
human's foot does not stand, so that nothing jumps where a foot is put down or lifted.
"""

from __future__ import annotations

from math import exp

import numpy as np

from controller.motion.posture import Pose
from controller.motion.rotations import Array, to_matrix
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.limb_finder import FEET
from sim.retargeting.robot_limbs import RobotLimbs
from sim.retargeting.robot_parts import SIDES

# How soon a foot that stands is held, and let go, s; how soon what is held goes along with a foot that does not stand.
SETTLES, GOES_ALONG = 0.03, 0.01
# The way that a sole points is let go more slowly, s: let go at once, it would turn before the foot has left the floor.
TURNS = 0.2
# A foot that stands by more than this is held in full; by less than this, not at all.
SURE, DOUBTFUL = 0.6, 0.2
# A foot is to be as high above the other one as the human's while it is near the floor: in lengths of the leg.
LOW = 0.1


class PlantedFeet:
    """Holds the feet of one robot while the human's stand.

    Attributes:
        root: the rotation of the root, shape (3, 3).
        between: from the right sole to the left one, seen from the root, shape (3,), m.
        apart: how much its part along the floor is held, 0 to 1.
        higher: how much its height is: both feet are to be as high above the floor as the human's, to scale.
        ahead: which way the soles point, seen from the root, shape (2, 3), m.
        turned: how much each of these is held, shape (2,).
    """

    def __init__(self, stance: HumanStance, limbs: RobotLimbs, scale: float, dt: float) -> None:
        """Args: the human's stance, the robot's limbs, its size over the human's, seconds from one pose to the next."""
        self._stance, self._limbs, self._scale = stance, limbs, scale
        names = limbs.vectors.names
        self._rows = [names.index(name) for name in (FEET, *(f"{side}_foot_ahead" for side in SIDES))]
        self._settles, self._ticks = 1.0 - exp(-dt / SETTLES), dt / GOES_ALONG
        self._lets_go = 1.0 - np.exp(-dt / np.array([SETTLES, TURNS, TURNS]))
        self.reset()

    def reset(self) -> None:
        """Forgets the feet."""
        self._begun = False
        self._held, self.root = np.zeros((3, 3)), np.eye(3)
        self._shares, self.higher = np.zeros(3), 0.0

    def __call__(self, pose: Pose, q: Array) -> None:
        """What to hold in the next pose, for a robot whose joints (N,) are still at q, rad."""
        stance, limbs = self._stance, self._limbs
        if stance.begun:
            self.reset()
        limbs.place(q)
        before = limbs.feet_apart()
        limbs.stand_on(stance.rolled)
        start, end = limbs.positions()
        vectors = (end - start)[self._rows]
        now = vectors @ self.root.T
        if not self._begun:
            self._held = now
        else:
            # From heel to ball the foot stands on another part, and stays where it is.
            self._held[0] += self.root @ (vectors[0] - before)
            shares = _certain(np.array([min(stance.standing), *stance.planted]))
            more = shares - self._shares
            self._shares += np.where(more > 0.0, self._settles, self._lets_go) * more
            raised = abs(stance.heights[1] - stance.heights[0]) / (LOW * stance.leg)
            self.higher += self._settles * (max(stance.standing) * exp(-raised * raised) - self.higher)
            self._held += (1.0 - np.exp((self._shares - 1.0) * self._ticks))[:, None] * (now - self._held)
        self._begun = not stance.begun
        self._held[0, 2] = self._scale * (stance.heights[1] - stance.heights[0])
        self.root = to_matrix(pose.rotation[0])
        seen = self._held @ self.root
        self.between, self.ahead = seen[0], seen[1:]
        self.apart, self.turned = float(self._shares[0]), self._shares[1:]


def _certain(shares: Array) -> Array:
    """Shares that are full from SURE on, and nothing below DOUBTFUL."""
    x = np.clip((shares - DOUBTFUL) / (SURE - DOUBTFUL), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
