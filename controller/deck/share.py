"""The share that joint targets p have in those beneath, q: q + s (p - q).

While s changes, the speed of a joint is a mean of both plus s' (p - q), and its acceleration one of theirs plus
2 s' (p - q)' + s'' (p - q). The pace s' is kept so low that these stay within the limits of a join: with V and A, the
largest speed and acceleration of joints in both motions,

    |s'| <= 0.4 V / d,    |s'| <= A / 8 V,    |s''| <= 0.45 A / d,

where d is the largest |p - q| so far.
"""

from dataclasses import dataclass
from math import copysign, sqrt

FASTER, TURNS, HARDER = 0.4, 8.0, 0.45  # as above
QUICKEST, SHARPEST = 3.0, 20.0  # of the pace of a share, 1/s, and its change, 1/s^2


@dataclass(eq=False, kw_only=True)
class Share:
    """A share on its way to a goal."""

    goal: float
    speed: float  # the largest of a joint in what it joins, rad/s
    acceleration: float  # likewise, rad/s^2
    farthest: float = 1e-6  # that it has been from what is beneath, rad
    share: float = 0.0
    pace: float = 0.0  # of the share, 1/s

    @property
    def arrived(self) -> bool:
        """Whether its share is at its goal."""
        return self.share == self.goal

    def approach(self, apart: float, dt: float, *, may_change: bool) -> None:
        """Advances by dt seconds, with the targets `apart`, rad, from those beneath; else it brakes."""
        # By the largest distance so far: a pace that the present one allows could not end in time when it grows.
        left, self.farthest = self.goal - self.share, max(apart, self.farthest)
        slew = min(SHARPEST, HARDER * self.acceleration / self.farthest)
        most = min(QUICKEST, FASTER * self.speed / self.farthest, self.acceleration / (TURNS * self.speed))
        wanted = copysign(min(most, sqrt(slew * abs(left))), left) if may_change else 0.0
        change = min(max(wanted - self.pace, -slew * dt), slew * dt)
        self.pace = round(min(max(self.pace + change, -most), most), 9)  # a sum of steps comes to exactly 0
        step = self.pace * dt
        if abs(left) <= max(abs(step), 1e-9) and step * left >= 0.0 and may_change:
            self.share, self.pace = self.goal, 0.0
        else:
            self.share = min(max(self.share + step, 0.0), 1.0)
