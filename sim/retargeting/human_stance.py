"""The stance of a human: how still heel and ball of each foot are, which feet stand, and how high they are lifted.

The floor of the human is where its still foot is, because recordings stand a few centimetres off and even drift.
"""

from __future__ import annotations

from math import dist, exp, hypot

from controller.motion.posture import Pose
from controller.motion.skeleton import Skeleton
from sim.retargeting.flat_feet import FlatFeet
from sim.retargeting.human_soles import Sole, Soles

# In lengths of the leg: how far a sole may seem to be off the floor and still stand on it.
STANDS = 0.02
# Lengths of the leg a second: heel or ball is still below the first; a foot stands flat whose ankle and ball are slower
# than the second.
STILL, FLAT = 0.4, 0.15
NEAR = 0.05  # lengths of the leg above the other foot: so high a still foot hardly stands
# So much a foot holds that rolls, where the other one stands on its whole sole.
ROLLING = 0.1
# So fast the floor follows a foot upwards, 1/s, that has been still for so long, s: at the top of a leap it is still
# for a moment. Down it follows any foot at once.
FOLLOWS, SURE = 60.0, 0.08
TELEPORT = 0.3  # lengths of the leg in one tick: nobody walked there


class HumanStance:
    """Watches the feet of one human, pose by pose.

    Attributes:
        feet: how many the skeleton has, 2 or 0; of one without feet the lowest joint is watched as if it were one.
        leg: length of the human's, m.
        flat: the slopes that the feet have while they stand flat.
        begun: whether the human appeared in the last pose, or came there as nobody walks.
        standing: how much each foot stands: 1 if its heel or its ball is still, and low; towards 0 the faster both go.
        planted: how much each foot stands on its whole sole: its heel and its ball are still.
        holding: how much what touches under each foot is to stay where it is: as it stands, but a foot that rolls, or
            turns on its ball, holds little while the other one stands on its whole sole.
        rolled: which part of each foot is stiller: 0 its heel, 1 its ball.
        heights: of that part of each foot, m.
        raised: how high the lowest sole is above the floor, m.
    """

    def __init__(self, skeleton: Skeleton, dt: float) -> None:
        """Args: whose poses will come, and the seconds from one to the next."""
        self._soles = Soles(skeleton)
        self.feet, self.leg = self._soles.count, max(skeleton.leg_length, 1e-3)
        self.flat = FlatFeet(dt)
        self._dt = dt
        self.reset()

    def reset(self, dt: float | None = None) -> None:
        """Forgets the human; from now on poses are dt seconds apart, by default as before."""
        self._dt = dt or self._dt
        self.flat.reset(self._dt)
        self._pose: Pose | None = None
        self._askers: list[str] = []
        self._before: list[Sole] | None = None
        self._at = (0.0, 0.0)
        self._floor = self._still_for = 0.0

    def __call__(self, pose: Pose, asker: str) -> None:
        """Looks at the next pose; a pose that two askers have in turn is one moment.

        Args:
            pose: of the human.
            asker: who asks: the same one asks once a moment.
        """
        if pose is self._pose and asker not in self._askers:
            self._askers.append(asker)
            return
        self._pose, self._askers = pose, [asker]
        soles = self._soles(pose, self.flat.slope)
        x, y = pose.root_position[:2].tolist()
        self.begun = self._before is None or hypot(x - self._at[0], y - self._at[1]) > TELEPORT * self.leg
        if self.begun or self._before is None:
            self._floor, self._before = min([sole.lowest for sole in soles]), soles
        self._look(soles, self._before)
        self._before, self._at = soles, (x, y)

    def _look(self, soles: list[Sole], before: list[Sole]) -> None:
        slow, flat_below = STILL * self.leg * self._dt, FLAT * self.leg * self._dt
        still, flat, self.rolled, self.heights = [], [], [], []
        for foot, (now, then) in enumerate(zip(soles, before, strict=True)):
            heel, ball = dist(now.heel, then.heel), dist(now.ball, then.ball)
            still.append(1.0 / (1.0 + (min(heel, ball) / slow) ** 8))
            rolled = heel / max(heel + ball, 1e-9)
            self.rolled.append(rolled)
            self.heights.append((1.0 - rolled) * now.heel[2] + rolled * now.ball[2])
            flat.append(1.0 / (1.0 + (max(heel, ball) / slow) ** 8))
            if max(ball, dist(now.ankle, then.ankle)) < flat_below and now is not then:
                self.flat.stood(foot, now.slope)
        lows = [sole.lowest for sole in soles]
        low = min(lows)
        rise = low - self._floor
        self._still_for = self._still_for + self._dt if still[lows.index(low)] > 0.5 else 0.0
        if rise > 0.0:
            rise *= min(FOLLOWS * self._dt, 1.0) if self._still_for > SURE else 0.0
        self._floor += rise
        self.raised = max(low - self._floor - STANDS * self.leg, 0.0)
        self.standing, self.planted = [], []
        for foot, height in enumerate(lows):
            # What stands is not the higher one of two feet that are still.
            other = still[1 - foot] if len(lows) == 2 else 0.0
            near = 1.0 - other * (1.0 - exp((low - height) / (NEAR * self.leg)))
            self.standing.append(still[foot] * near)
            self.planted.append(flat[foot] * near)
        most = max(self.planted) + ROLLING
        self.holding = [s * (p + ROLLING) / most for s, p in zip(self.standing, self.planted, strict=True)]
