"""Planted feet: two standing feet keep their distance, and a foot on its sole does not turn.

Legs of other proportions in the human's directions move standing feet together or apart, so that one slides wherever
the root goes. So while both stand, the vector between the soles is held, and so is the direction of a flat sole. As far
as the human's foot does not stand, the held values follow the robot, without a jump when a foot is put down or lifted.
"""

from math import exp

import numpy as np

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.limb_finder import FEET, SIDES
from sim.retargeting.robot_limbs import RobotLimbs

# Time constants of holding and releasing a foot, and of held values that follow the robot, s.
SETTLES, GOES_ALONG = 0.03, 0.01
# Time constant of releasing a sole's direction, s: at once, it would turn before the foot has left the floor.
TURNS = 0.4
SURE, DOUBTFUL = 0.6, 0.2  # standing above which a foot is held in full, and below which not at all
LOW = 0.1  # height near the floor in which the difference of the feet's heights is the human's, lengths of the leg


class PlantedFeet:
    """Holds the feet of one robot while the human's stand.

    Attributes:
        root: rotation of the root, shape (3, 3).
        between: from the right sole to the left one, in the frame of the root, shape (3,), m.
        apart, higher: weights of its parts along the floor and upwards, 0 to 1.
        ahead, turned: directions of the soles in the frame of the root, shape (2, 3), m, and their weights, shape (2,).
    """

    def __init__(self, stance: HumanStance, limbs: RobotLimbs, scale: float, dt: float) -> None:
        """Args: the human's stance; the robot's limbs; its size over the human's; seconds from pose to pose."""
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

    def __call__(self, pose: Pose, q: Array, root: Array) -> None:
        """Updates the held values for the next pose, the last joints q (N,), rad, and the root's rotation (3, 3)."""
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
            # From heel to ball the foot stands on another part, in the same place.
            self._held[0] += self.root @ (vectors[0] - before)
            sure = (np.array([min(stance.standing), *stance.planted]) - DOUBTFUL) / (SURE - DOUBTFUL)
            sure = np.clip(sure, 0.0, 1.0)
            more = sure * sure * (3.0 - 2.0 * sure) - self._shares
            self._shares += np.where(more > 0.0, self._settles, self._lets_go) * more
            raised = abs(stance.heights[1] - stance.heights[0]) / (LOW * stance.leg)
            self.higher += self._settles * (max(stance.standing) * exp(-raised * raised) - self.higher)
            self._held += (1.0 - np.exp((self._shares - 1.0) * self._ticks))[:, None] * (now - self._held)
        self._begun = not stance.begun
        self._held[0, 2] = self._scale * (stance.heights[1] - stance.heights[0])
        self.root = root
        seen = self._held @ self.root
        self.between, self.ahead = seen[0], seen[1:]
        self.apart, self.turned = float(self._shares[0]), self._shares[1:]
