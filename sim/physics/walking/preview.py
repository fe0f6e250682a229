"""Preview: the body follows the motion with a delay, so that its next footfalls are known before they begin.

This needs no prediction: the future of the body has been played already, whatever motion, tempo and switches. A foot
swings while its sole is the faster one of the two, and moves or is raised; small displacements are no steps. So one
foot always stands, also in a run.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from sim.physics.walking.steps import rotated

AHEAD = 1.2  # delay of the body behind the motion, s

# Window of the root's mean height before and after, s: at half the tempo the body would else bob with each step.
EVEN = 0.5 * AHEAD
SWAY = 0.5  # time constant of the path, s, against the sway of the body
# Speed of a sole at the beginning and the end of a swing, heights of the root a second, and its time constant, s.
BEGINS, ENDS, SMOOTHING = 0.2, 0.15, 0.01
# Least length of a step, heights of the root, or turn, rad; least duration of a swing and of a step, s: blends shuffle.
FAR, TURN, LONG, BRIEF = 0.04, 0.15, 0.12, 0.15
PAUSE = 0.3  # longest pause within one step, s
# Speed and duration, s, of a rest that ends a swing, also of a raised foot.
STILL, HOLDS = 0.03, 0.15
_FLAT = np.zeros(2)


class Travel:
    """Distance of a swaying body along the ground so far, in `metres`."""

    def __init__(self, dt: float) -> None:
        """Args: the tick, s."""
        self.metres = 0.0
        self._share = 1.0 - float(np.exp(-dt / SWAY))
        self._smooth: Array | None = None

    def add(self, place: Array) -> None:
        """Adds the next place, shape (2,), m."""
        if self._smooth is None:
            self._smooth = place.copy()
        step = self._share * (place - self._smooth)
        self._smooth += step
        self.metres += float(np.hypot(*step))


class Preview:
    """The motion from the tick of the body to the latest one."""

    def __init__(self, height: float, dt: float) -> None:
        """Args: height of the root, m; the tick, s."""
        self._dt, self._newest = dt, AHEAD
        self._ring: deque[tuple[Array, float]] = deque(maxlen=round(AHEAD / dt) + 1)
        self._near = round(EVEN / dt)
        self._heights: deque[float] = deque([height] * (2 * self._near), maxlen=2 * self._near)
        self.footfalls = Footfalls(height, dt)  # the present and coming swings
        self.travel = Travel(dt)  # distance of the motion up to the body's tick

    def add(self, goal: Array, heading: float, soles: Array, yaws: Array, pitches: Array) -> None:
        """Adds the next tick, a posture (nq,) with heading, rad, soles (2, 3), m, their yaws and pitches (2,), rad."""
        # Before the first one, the motion stood still.
        for _ in range(1 if self._ring else self._ring.maxlen or 1):
            self._ring.append((goal.copy(), heading))
        self._newest += self._dt
        self.footfalls.add(self._newest, soles, yaws, heading, pitches)
        self._heights.append(float(self._ring[self._near][0][2]))
        self.travel.add(self.goal[:2])

    @property
    def goal(self) -> Array:
        """The posture of the body's tick, shape (nq,)."""
        return self._ring[0][0]

    @property
    def heading(self) -> float:
        """Its heading, rad."""
        return self._ring[0][1]

    @property
    def height(self) -> float:
        """Mean height of the root around the body's tick, m."""
        return float(np.mean(self._heights))


@dataclass(eq=False)
class Swing:
    """One swing of a foot, in the lengths of the played motion; until it ends, its place is the present one."""

    foot: int  # 0 or 1
    start: float  # time of leaving the floor, s
    end: float | None  # time of landing, s; None until it is known
    from_other: Array  # place from the other foot, ahead and left of the heading, shape (2,), m
    yaw: float  # of the foot there, rad
    heading: float  # of the body there, rad
    leaves: float = 0.0  # pitch of the sole, toes down, as it leaves the floor, rad
    lands: float = 0.0  # pitch of the sole, toes down, as it lands, rad


class Footfalls:
    """Finds the swings in a motion, tick by tick: `swings`, in the order of their starts."""

    def __init__(self, height: float, dt: float) -> None:
        """Args: height of the root, m; the tick, s."""
        self._height, self._dt = height, dt
        self.swings: list[Swing] = []
        self._before: Array | None = None
        self._speed = np.zeros(2)
        self._from = np.zeros(3)
        self._went = self._yaw = self._held = 0.0

    def add(self, now: float, soles: Array, yaws: Array, heading: float, pitches: Array = _FLAT) -> None:
        """Adds the tick at `now`, s: middles of the soles (2, 3), m, with yaws and pitches, toes down, (2,), rad."""
        before = soles if self._before is None else self._before
        raw = np.linalg.norm(soles - before, axis=1) / (self._dt * self._height)
        self._speed += (1.0 - np.exp(-self._dt / SMOOTHING)) * (raw - self._speed)
        self._before = soles.copy()
        swing = self.swings[-1] if self.swings and self.swings[-1].end is None else None
        if swing is not None:
            self._went = max(self._went, float(np.linalg.norm(soles[swing.foot] - self._from)))
            swing.lands = float(pitches[swing.foot])
            self._go_on(swing, now, soles, yaws, heading)
        if not self.swings or self.swings[-1].end is not None:
            self._begin(now, soles, yaws, heading, pitches)

    def forget(self, swing: Swing) -> None:
        """Drops a swing that is over."""
        self.swings = [other for other in self.swings if other is not swing]

    def _begin(self, now: float, soles: Array, yaws: Array, heading: float, pitches: Array) -> None:
        foot = int(np.argmax(self._speed))
        if self._speed[foot] < BEGINS:
            return
        last = self.swings[-1] if self.swings else None
        if last is not None and last.foot == foot and last.end is not None and now - last.end < PAUSE:
            last.end = None
            return
        self.swings.append(Swing(foot, now, None, np.zeros(2), 0.0, heading, float(pitches[foot])))
        self._from, self._went, self._yaw, self._held = soles[foot].copy(), 0.0, float(yaws[foot]), 0.0
        self._place(self.swings[-1], soles, yaws, heading)

    def _go_on(self, swing: Swing, now: float, soles: Array, yaws: Array, heading: float) -> None:
        self._place(swing, soles, yaws, heading)
        speed, other = self._speed[swing.foot], self._speed[1 - swing.foot]
        raised = soles[swing.foot, 2] - soles[1 - swing.foot, 2] > 0.5 * FAR * self._height
        self._held = self._held + self._dt if max(speed, other) < STILL else 0.0
        if now - swing.start < LONG or (self._held < HOLDS and speed >= other and (speed > ENDS or raised)):
            return
        turned = float(np.abs(np.angle(np.exp(1j * (swing.yaw - self._yaw)))))
        if now - swing.start < BRIEF or (self._went < FAR * self._height and turned < TURN):
            self.swings.pop()
        else:
            swing.end = now

    def _place(self, swing: Swing, soles: Array, yaws: Array, heading: float) -> None:
        swing.from_other = rotated((soles[swing.foot] - soles[1 - swing.foot])[:2], -heading)
        swing.yaw, swing.heading = float(yaws[swing.foot]), heading
